//! Named tensors in safetensors files.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use safetensors::{Dtype, SafeTensors, tensor::TensorView};

use super::parameters::NamedTensor;
use crate::manifest::write_file;

/// Largest file that is read: ten times the weights of the paper's model with its optimiser.
const MAX_BYTES: u64 = 2 << 30;

/// Why a file of tensors cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum TensorsError {
    /// The file system refuses.
    #[error("read {path}: {error}")]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system says.
        error: std::io::Error,
    },
    /// The file is larger than any this program writes.
    #[error("read {path}: it has {found} bytes, at most {MAX_BYTES} are read")]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// Its size.
        found: u64,
    },
    /// The file is not safetensors, or damaged.
    #[error("read {path}: {error}")]
    Format {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        error: safetensors::SafeTensorError,
    },
    /// A tensor is of another type than 32-bit floats.
    #[error("read {path}: {name} is {found:?}, expected F32")]
    Type {
        /// The file.
        path: PathBuf,
        /// The tensor.
        name: String,
        /// Its type.
        found: Dtype,
    },
}

/// Writes tensors so that the file is whole or absent.
///
/// # Errors
/// Any error of the file system; the message names the path.
pub fn write_tensors(path: &Path, tensors: &BTreeMap<String, NamedTensor>) -> std::io::Result<()> {
    let bytes: Vec<(&String, &NamedTensor, Vec<u8>)> = tensors
        .iter()
        .map(|(name, tensor)| {
            let bytes = tensor.values.iter().flat_map(|value| value.to_le_bytes()).collect();
            (name, tensor, bytes)
        })
        .collect();
    let views = bytes
        .iter()
        .map(|(name, tensor, bytes)| Ok((*name, TensorView::new(Dtype::F32, tensor.shape.clone(), bytes)?)))
        .collect::<Result<Vec<_>, safetensors::SafeTensorError>>()
        .and_then(|views| safetensors::serialize(views, None))
        .map_err(|error| std::io::Error::other(format!("write {}: {error}", path.display())))?;
    write_file(path, &views)
}

/// Reads tensors.
///
/// # Errors
/// [`TensorsError`] names the file and what is wrong with it.
pub fn read_tensors(path: &Path) -> Result<BTreeMap<String, NamedTensor>, TensorsError> {
    let io = |error| TensorsError::Io { path: path.to_owned(), error };
    let found = std::fs::metadata(path).map_err(io)?.len();
    if found > MAX_BYTES {
        return Err(TensorsError::TooLarge { path: path.to_owned(), found });
    }
    let bytes = std::fs::read(path).map_err(io)?;
    let tensors = SafeTensors::deserialize(&bytes)
        .map_err(|error| TensorsError::Format { path: path.to_owned(), error })?;
    tensors
        .tensors()
        .into_iter()
        .map(|(name, view)| {
            if view.dtype() != Dtype::F32 {
                return Err(TensorsError::Type { path: path.to_owned(), name, found: view.dtype() });
            }
            let (numbers, _) = view.data().as_chunks::<4>();
            let values = numbers.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect();
            Ok((name, NamedTensor { shape: view.shape().to_vec(), values }))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tensors_come_back_and_damage_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("some.safetensors");
        let tensor =
            |shape: &[usize], values: &[f32]| NamedTensor { shape: shape.to_vec(), values: values.to_vec() };
        let tensors = BTreeMap::from([
            ("a.b".to_owned(), tensor(&[2, 2], &[1.5, -0.0, f32::MIN_POSITIVE, 3.0])),
            ("c".to_owned(), tensor(&[0, 3], &[])),
        ]);
        write_tensors(&path, &tensors).unwrap();
        assert_eq!(read_tensors(&path).unwrap(), tensors);

        let bytes = std::fs::read(&path).unwrap();
        std::fs::write(&path, &bytes[..bytes.len() - 1]).unwrap();
        let error = read_tensors(&path).unwrap_err().to_string();
        assert!(error.contains("some.safetensors"), "{error}");
    }
}
