//! Tensors out of `model.safetensors`, only those that are needed.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use safetensors::tensor::{Dtype, Metadata};

use super::error::EncoderError;

/// Largest header; that of a large model has some hundred kilobytes.
const MAX_HEADER_BYTES: u64 = 32 << 20;

/// An open weights file.
#[derive(Debug)]
pub(super) struct Weights {
    path: PathBuf,
    file: File,
    /// Where the first tensor starts, bytes.
    start: u64,
    metadata: Metadata,
    /// What the names of the encoder's tensors start with in this file: nothing, or the family's name.
    prefix: String,
}

impl Weights {
    /// Reads and checks the header.
    pub fn open(path: &Path, family_name: &str) -> Result<Self, EncoderError> {
        let io_error = |source| EncoderError::Io { path: path.to_owned(), source };
        let malformed = |reason: String| EncoderError::Malformed { path: path.to_owned(), reason };
        let mut file = File::open(path).map_err(io_error)?;
        let num_bytes = file.metadata().map_err(io_error)?.len();
        let mut length = [0; 8];
        file.read_exact(&mut length).map_err(io_error)?;
        let header_bytes = u64::from_le_bytes(length);
        if header_bytes > MAX_HEADER_BYTES.min(num_bytes) {
            return Err(malformed(format!("its header claims {header_bytes} bytes")));
        }
        let mut header = Vec::new();
        Read::by_ref(&mut file).take(header_bytes).read_to_end(&mut header).map_err(io_error)?;
        // Reading it checks that the tensors lie one after the other and are as long as their shapes say.
        let metadata: Metadata =
            serde_json::from_slice(&header).map_err(|error| malformed(format!("its header: {error}")))?;
        let start = 8 + header_bytes;
        let end = start.saturating_add(metadata.data_len() as u64);
        if end != num_bytes {
            return Err(malformed(format!("its header describes {end} bytes and the file has {num_bytes}")));
        }
        let anchor = "embeddings.word_embeddings.weight";
        let prefix = [String::new(), format!("{family_name}.")]
            .into_iter()
            .find(|prefix| metadata.info(&format!("{prefix}{anchor}")).is_some())
            .ok_or_else(|| malformed(format!("it has no tensor {anchor}, with or without {family_name}.")))?;
        Ok(Self { path: path.to_owned(), file, start, metadata, prefix })
    }

    /// Whether there is a tensor of this name.
    pub fn has(&self, name: &str) -> bool {
        self.metadata.info(&format!("{}{name}", self.prefix)).is_some()
    }

    /// The numbers of a tensor of exactly this shape, row by row.
    pub fn read(&mut self, name: &str, shape: &[usize]) -> Result<Vec<f32>, EncoderError> {
        let full_name = format!("{}{name}", self.prefix);
        let malformed = |reason: String| EncoderError::Malformed { path: self.path.clone(), reason };
        // Old exports call the scale and shift of normalisation gamma and beta.
        let old_name = full_name
            .replace("LayerNorm.weight", "LayerNorm.gamma")
            .replace("LayerNorm.bias", "LayerNorm.beta");
        let info = self
            .metadata
            .info(&full_name)
            .or_else(|| self.metadata.info(&old_name))
            .ok_or_else(|| malformed(format!("it has no tensor {full_name}")))?;
        if info.shape != shape {
            return Err(malformed(format!("{full_name} has shape {:?} and not {shape:?}", info.shape)));
        }
        let (begin, end) = info.data_offsets;
        let dtype = info.dtype;
        let mut bytes = vec![0; end - begin];
        let io_error = |source| EncoderError::Io { path: self.path.clone(), source };
        self.file.seek(SeekFrom::Start(self.start + begin as u64)).map_err(io_error)?;
        self.file.read_exact(&mut bytes).map_err(io_error)?;
        let numbers = numbers(&bytes, dtype)
            .ok_or_else(|| malformed(format!("{full_name} is of type {dtype:?}, not F32, F16 or BF16")))?;
        if numbers.len() != shape.iter().product::<usize>() {
            return Err(malformed(format!("{full_name} has {} numbers for {shape:?}", numbers.len())));
        }
        if numbers.iter().any(|number| !number.is_finite()) {
            return Err(malformed(format!("{full_name} holds a number that is not finite")));
        }
        Ok(numbers)
    }
}

fn numbers(bytes: &[u8], dtype: Dtype) -> Option<Vec<f32>> {
    let halves = |widen: fn([u8; 2]) -> f32| {
        bytes.as_chunks::<2>().0.iter().map(|&half| widen(half)).collect::<Vec<f32>>()
    };
    Some(match dtype {
        Dtype::F32 => bytes.as_chunks::<4>().0.iter().map(|&word| f32::from_le_bytes(word)).collect(),
        Dtype::BF16 => halves(|half| f32::from_bits(u32::from(u16::from_le_bytes(half)) << 16)),
        Dtype::F16 => halves(|half| widen_f16(u16::from_le_bytes(half))),
        _ => return None,
    })
}

/// An IEEE 754 half-precision number.
fn widen_f16(bits: u16) -> f32 {
    let sign = if bits & 0x8000 == 0 { 1.0 } else { -1.0 };
    let exponent = i32::from((bits >> 10) & 0x1f);
    let fraction = f32::from(bits & 0x3ff);
    sign * match exponent {
        0 => fraction * (-24.0_f32).exp2(),
        31 if fraction == 0.0 => f32::INFINITY,
        31 => f32::NAN,
        _ => (1024.0 + fraction) * ((exponent - 25) as f32).exp2(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_precision_is_widened() {
        let expected =
            [(0x3c00, 1.0), (0xc000, -2.0), (0x7bff, 65504.0), (0x0001, 5.9604645e-8), (0x3555, 0.33325195)];
        for (bits, value) in expected {
            assert_eq!(widen_f16(bits), value);
        }
        assert!(widen_f16(0x7c00).is_infinite() && widen_f16(0x7e00).is_nan());
        assert_eq!(numbers(&[0x80, 0x3f, 0x00, 0xc0], Dtype::BF16), Some(vec![1.0, -2.0]));
        assert_eq!(numbers(&[0, 0, 128, 63], Dtype::F32), Some(vec![1.0]));
        assert_eq!(numbers(&[0], Dtype::I8), None);
    }
}
