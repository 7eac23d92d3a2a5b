//! Everything that changes a number, beside the number.

use std::fmt;

use serde::{Serialize, Serializer};

/// `name:value` pairs in a fixed order, printed joined by `|`: `bleu-4|tok:13a|case:lc|smooth:exp|eff:no|nrefs:var|v:1`.
///
/// Two numbers may be compared when their signatures are equal.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Signature(String);

impl Signature {
    /// A signature that so far only names the score.
    #[must_use]
    pub fn new(score: &str) -> Self {
        Self(clean(score))
    }

    /// The signature with one more pair; the separators `|` and `:` inside a value become `_`.
    #[must_use]
    pub fn with(mut self, name: &str, value: impl fmt::Display) -> Self {
        self.0.push('|');
        self.0.push_str(&clean(name));
        self.0.push(':');
        self.0.push_str(&clean(&value.to_string()));
        self
    }

    /// The signature with another value for a name it has; unchanged where it does not have it.
    #[must_use]
    pub fn replaced(self, name: &str, value: impl fmt::Display) -> Self {
        let start = format!("{}:", clean(name));
        let pair = |part: &str| {
            if part.starts_with(&start) {
                format!("{start}{}", clean(&value.to_string()))
            } else {
                part.to_owned()
            }
        };
        Self(self.0.split('|').map(pair).collect::<Vec<_>>().join("|"))
    }

    /// The value of a name it has.
    #[must_use]
    pub fn value(&self, name: &str) -> Option<&str> {
        let mut pairs = self.0.split('|').filter_map(|part| part.split_once(':'));
        pairs.find_map(|(found, value)| (found == name).then_some(value))
    }

    /// The text.
    #[must_use]
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

fn clean(text: &str) -> String {
    text.chars()
        .map(|symbol| if matches!(symbol, '|' | ':') || symbol.is_control() { '_' } else { symbol })
        .collect()
}

impl fmt::Display for Signature {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(&self.0)
    }
}

impl Serialize for Signature {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(&self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pairs_keep_their_order_and_cannot_be_forged() {
        let signature = Signature::new("bleu-4").with("tok", "13a").with("model", "a|v:2\n").with("v", 1);
        assert_eq!(signature.to_string(), "bleu-4|tok:13a|model:a_v_2_|v:1");
        assert_eq!(signature.clone().replaced("beam", 5), signature);
        assert_eq!(signature.replaced("model", "x|y").to_string(), "bleu-4|tok:13a|model:x_y|v:1");
    }
}
