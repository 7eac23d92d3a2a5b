//! What the CPU kernels share: the choice of vector instructions at run time, and exponentials of vectors.

#![expect(clippy::inline_always, reason = "vector code keeps its instruction set only where it is inlined")]

mod exponential;
mod instructions;

pub use exponential::exponential;
pub use instructions::Instructions;
