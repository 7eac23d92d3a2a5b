//! How many pairs, or non-paired samples.

use std::fmt;

use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// A number of samples, or all there are; in files a number or `"all"`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Amount {
    /// So many.
    Some(usize),
    /// All there are.
    All,
}

impl Amount {
    /// Of `available` samples, how many are taken; `None` where there are fewer than that.
    #[must_use]
    pub fn of(self, available: usize) -> Option<usize> {
        match self {
            Self::Some(amount) => (amount <= available).then_some(amount),
            Self::All => Some(available),
        }
    }
}

impl fmt::Display for Amount {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Some(amount) => amount.fmt(formatter),
            Self::All => formatter.write_str("all"),
        }
    }
}

impl Serialize for Amount {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Some(amount) => serializer.serialize_u64(*amount as u64),
            Self::All => serializer.serialize_str("all"),
        }
    }
}

#[derive(Deserialize)]
#[serde(untagged)]
enum Written {
    Number(usize),
    Word(String),
}

impl<'de> Deserialize<'de> for Amount {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        match Written::deserialize(deserializer) {
            Ok(Written::Number(amount)) => Ok(Self::Some(amount)),
            Ok(Written::Word(word)) if word == "all" => Ok(Self::All),
            _ => Err(serde::de::Error::custom("expected a number of samples or \"all\"")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn amounts_are_numbers_or_all() {
        #[derive(Serialize, Deserialize, PartialEq, Debug)]
        struct File {
            paired: Vec<Amount>,
        }
        let file: File = toml::from_str("paired = [100, \"all\"]").unwrap();
        assert_eq!(file.paired, [Amount::Some(100), Amount::All]);
        assert_eq!(toml::from_str::<File>(&toml::to_string(&file).unwrap()).unwrap(), file);
        assert!(toml::from_str::<File>("paired = [\"some\"]").unwrap_err().to_string().contains("\"all\""));
        assert_eq!(
            (Amount::Some(5).of(3), Amount::Some(2).of(3), Amount::All.of(3)),
            (None, Some(2), Some(3))
        );
    }
}
