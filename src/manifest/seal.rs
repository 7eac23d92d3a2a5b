//! JSON that carries the checksum of its own content.
//!
//! A sealed text is one line: `{"sha256":"...","content":...}`. It stays readable by any JSON reader, and a file
//! that was cut off or edited is noticed before its numbers are trusted.

use serde::Serialize;
use serde::de::DeserializeOwned;

use super::sha256_hex;

const OPEN: &str = "{\"sha256\":\"";
const MIDDLE: &str = "\",\"content\":";
const CLOSE: &str = "}\n";
const DIGEST_LENGTH: usize = 64;

/// Why a sealed text cannot be trusted.
#[derive(Debug, thiserror::Error)]
pub enum SealError {
    /// The text does not have the form of a sealed text: cut off, or something else.
    #[error("the file is not a whole sealed result (was it cut off?)")]
    Form,
    /// The content is not what was sealed.
    #[error("the content has the checksum {found}, but {expected} was written with it")]
    Checksum {
        /// Checksum in the text.
        expected: String,
        /// Checksum of the content.
        found: String,
    },
    /// The content is intact, but not of the expected kind.
    #[error("the content is of another kind: {0}")]
    Content(#[from] serde_json::Error),
}

/// Seals a value as one line of JSON.
///
/// # Errors
/// When the value has no JSON form.
pub fn seal<T: Serialize>(content: &T) -> Result<String, serde_json::Error> {
    let content = serde_json::to_string(content)?;
    let digest = sha256_hex(content.as_bytes());
    Ok(format!("{OPEN}{digest}{MIDDLE}{content}{CLOSE}"))
}

/// Opens a sealed text after checking its content.
///
/// # Errors
/// [`SealError`] tells a cut-off file, an edited one and one of another kind apart.
pub fn unseal<T: DeserializeOwned>(text: &str) -> Result<T, SealError> {
    let (expected, content) = text
        .strip_prefix(OPEN)
        .and_then(|rest| rest.split_at_checked(DIGEST_LENGTH))
        .and_then(|(digest, rest)| Some((digest, rest.strip_prefix(MIDDLE)?.strip_suffix(CLOSE)?)))
        .ok_or(SealError::Form)?;
    let found = sha256_hex(content.as_bytes());
    if found != expected {
        return Err(SealError::Checksum { expected: expected.to_owned(), found });
    }
    Ok(serde_json::from_str(content)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn returns_what_was_sealed_bit_for_bit() {
        let numbers = vec![0.1, -0.0, 1.0e-300, 5e-324, f64::MAX, 1.0 / 3.0];
        let opened: Vec<f64> = unseal(&seal(&numbers).unwrap()).unwrap();
        let bits = |values: &[f64]| values.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
        assert_eq!(bits(&opened), bits(&numbers));
    }

    #[test]
    fn any_change_is_noticed() {
        let text = seal(&"walk").unwrap();
        for cut in 0..text.len() {
            assert!(unseal::<String>(&text[..cut]).is_err(), "cut at {cut}");
        }
        let edited = text.replace("walk", "wall");
        assert!(matches!(unseal::<String>(&edited), Err(SealError::Checksum { .. })));
        assert!(matches!(unseal::<u32>(&text), Err(SealError::Content(_))));
    }
}
