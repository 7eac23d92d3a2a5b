//! What `config.json` says about a model.

use std::path::Path;

use serde::Deserialize;

use super::error::EncoderError;
use super::files::read_bounded;

const MAX_CONFIG_BYTES: u64 = 1 << 20;

/// The two families, which differ in tokeniser, names of weights, and where positions start.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Family {
    /// BERT: word pieces, positions from 0.
    Bert,
    /// RoBERTa: byte pairs, positions from one after the padding id.
    Roberta,
}

impl Family {
    /// Name as in `model_type`.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Bert => "bert",
            Self::Roberta => "roberta",
        }
    }
}

/// Shape of an encoder.
#[derive(Debug, Clone, PartialEq)]
pub struct EncoderConfig {
    /// Which family.
    pub family: Family,
    /// Number of token ids.
    pub vocab_size: usize,
    /// Width of token vectors.
    pub width: usize,
    /// Number of transformer layers.
    pub num_layers: usize,
    /// Attention heads; they share the width equally.
    pub num_heads: usize,
    /// Width inside the feed-forward blocks.
    pub inner_width: usize,
    /// Rows of the position table.
    pub num_positions: usize,
    /// Rows of the segment table.
    pub num_types: usize,
    /// Position of the first token in the position table.
    pub first_position: usize,
    /// Added to variances in layer normalisation.
    pub norm_epsilon: f64,
}

#[derive(Debug, Deserialize)]
struct RawConfig {
    model_type: String,
    vocab_size: usize,
    hidden_size: usize,
    num_hidden_layers: usize,
    num_attention_heads: usize,
    intermediate_size: usize,
    max_position_embeddings: usize,
    #[serde(default = "one")]
    type_vocab_size: usize,
    #[serde(default = "default_epsilon")]
    layer_norm_eps: f64,
    #[serde(default = "default_activation")]
    hidden_act: String,
    position_embedding_type: Option<String>,
    pad_token_id: Option<usize>,
    is_decoder: Option<bool>,
}

fn one() -> usize {
    1
}

fn default_epsilon() -> f64 {
    1e-12
}

fn default_activation() -> String {
    "gelu".to_owned()
}

impl EncoderConfig {
    /// Reads and checks `config.json`.
    pub(super) fn read(path: &Path) -> Result<Self, EncoderError> {
        let malformed = |reason: String| EncoderError::Malformed { path: path.to_owned(), reason };
        let unsupported = |reason: String| EncoderError::Unsupported { path: path.to_owned(), reason };
        let bytes = read_bounded(path, MAX_CONFIG_BYTES)?;
        let raw: RawConfig = serde_json::from_slice(&bytes).map_err(|error| malformed(error.to_string()))?;
        let family = match raw.model_type.as_str() {
            "bert" => Family::Bert,
            "roberta" => Family::Roberta,
            other => return Err(unsupported(format!("model_type is {other:?}"))),
        };
        if raw.hidden_act != "gelu" {
            return Err(unsupported(format!(
                "hidden_act is {:?} and only \"gelu\" is known",
                raw.hidden_act
            )));
        }
        if let Some(kind) = raw.position_embedding_type.filter(|kind| kind != "absolute") {
            return Err(unsupported(format!("position_embedding_type is {kind:?}")));
        }
        if raw.is_decoder == Some(true) {
            return Err(unsupported("is_decoder is true".to_owned()));
        }
        for (name, value, most) in [
            ("vocab_size", raw.vocab_size, 2_000_000),
            ("hidden_size", raw.hidden_size, 16_384),
            ("num_hidden_layers", raw.num_hidden_layers, 256),
            ("num_attention_heads", raw.num_attention_heads, 256),
            ("intermediate_size", raw.intermediate_size, 65_536),
            ("max_position_embeddings", raw.max_position_embeddings, 65_536),
            ("type_vocab_size", raw.type_vocab_size, 64),
        ] {
            if !(1..=most).contains(&value) {
                return Err(malformed(format!("{name} is {value}, not within 1..={most}")));
            }
        }
        if !raw.hidden_size.is_multiple_of(raw.num_attention_heads) {
            return Err(malformed(format!(
                "hidden_size {} is no multiple of num_attention_heads {}",
                raw.hidden_size, raw.num_attention_heads
            )));
        }
        if !(raw.layer_norm_eps > 0.0 && raw.layer_norm_eps < 1.0) {
            return Err(malformed(format!("layer_norm_eps is {}", raw.layer_norm_eps)));
        }
        let first_position = match family {
            Family::Bert => 0,
            Family::Roberta => raw.pad_token_id.unwrap_or(1).saturating_add(1),
        };
        // Start token, end token and one more must fit.
        if raw.max_position_embeddings < first_position.saturating_add(3) {
            return Err(malformed(format!(
                "max_position_embeddings {} leaves no room after position {first_position}",
                raw.max_position_embeddings
            )));
        }
        Ok(Self {
            family,
            vocab_size: raw.vocab_size,
            width: raw.hidden_size,
            num_layers: raw.num_hidden_layers,
            num_heads: raw.num_attention_heads,
            inner_width: raw.intermediate_size,
            num_positions: raw.max_position_embeddings,
            num_types: raw.type_vocab_size,
            first_position,
            norm_epsilon: raw.layer_norm_eps,
        })
    }

    /// Longest sentence in tokens, start and end included.
    #[must_use]
    pub fn max_tokens(&self) -> usize {
        self.num_positions - self.first_position
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(changes: &[(&str, serde_json::Value)]) -> Result<EncoderConfig, EncoderError> {
        let mut config = serde_json::json!({
            "model_type": "roberta", "vocab_size": 100, "hidden_size": 24, "num_hidden_layers": 2,
            "num_attention_heads": 3, "intermediate_size": 48, "max_position_embeddings": 66,
            "layer_norm_eps": 1e-5, "hidden_act": "gelu", "pad_token_id": 1,
        });
        for (name, value) in changes {
            config[*name] = value.clone();
        }
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("config.json");
        std::fs::write(&path, config.to_string()).unwrap();
        EncoderConfig::read(&path)
    }

    #[test]
    fn positions_of_roberta_start_after_the_padding() {
        let config = read(&[]).unwrap();
        assert_eq!((config.first_position, config.max_tokens()), (2, 64));
        let bert = read(&[("model_type", "bert".into())]).unwrap();
        assert_eq!((bert.first_position, bert.max_tokens()), (0, 66));
    }

    #[test]
    fn what_is_not_known_is_refused_by_name() {
        for (name, value) in [
            ("model_type", serde_json::json!("mpnet")),
            ("hidden_act", "relu".into()),
            ("position_embedding_type", "relative_key".into()),
            ("is_decoder", true.into()),
            ("num_attention_heads", 5.into()),
            ("hidden_size", 0.into()),
            ("num_hidden_layers", 1_000_000.into()),
            ("max_position_embeddings", 3.into()),
            ("pad_token_id", u64::MAX.into()),
            ("layer_norm_eps", (-1.0).into()),
        ] {
            let error = read(&[(name, value)]).unwrap_err().to_string();
            assert!(error.contains(name) || error.contains("max_position"), "{name}: {error}");
        }
    }
}
