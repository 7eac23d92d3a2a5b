//! The motions built into the program: name and content of each file in `assets/suite`.

/// Files in the layout of KIT-ML, sorted by name.
pub(super) const FILES: &[(&str, &[u8])] = &[];
