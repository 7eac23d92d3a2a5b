//! The two recurrent autoencoders.

pub mod ops;
