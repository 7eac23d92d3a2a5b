//! Files of a bounded size, and their checksums.

use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;

use sha2::{Digest, Sha256};

use super::error::EncoderError;
use crate::manifest::hex;

/// The bytes of a file that is at most `limit` long.
pub(super) fn read_bounded(path: &Path, limit: u64) -> Result<Vec<u8>, EncoderError> {
    let io_error = |source| EncoderError::Io { path: path.to_owned(), source };
    let file = File::open(path).map_err(io_error)?;
    let found = file.metadata().map_err(io_error)?.len();
    if found > limit {
        return Err(EncoderError::TooLarge { path: path.to_owned(), found, limit });
    }
    let mut bytes = Vec::new();
    // A file may grow while it is read.
    file.take(limit).read_to_end(&mut bytes).map_err(io_error)?;
    Ok(bytes)
}

/// SHA-256 of files, one after the other, in hexadecimal digits.
pub(super) fn checksum(paths: &[&Path]) -> Result<String, EncoderError> {
    let mut digest = Sha256::new();
    let mut buffer = vec![0; 1 << 20];
    for path in paths {
        let io_error = |source| EncoderError::Io { path: (*path).to_owned(), source };
        let mut file = BufReader::new(File::open(path).map_err(io_error)?);
        loop {
            let num_read = file.read(&mut buffer).map_err(io_error)?;
            if num_read == 0 {
                break;
            }
            digest.update(&buffer[..num_read]);
        }
    }
    Ok(hex(&digest.finalize()))
}
