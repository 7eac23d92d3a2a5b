//! Sentences into token ids, by the tokeniser an encoder was trained with.

use std::path::{Path, PathBuf};

use serde::Deserialize;
use tokenizers::models::bpe::BPE;
use tokenizers::models::wordpiece::WordPiece;
use tokenizers::normalizers::BertNormalizer;
use tokenizers::pre_tokenizers::bert::BertPreTokenizer;
use tokenizers::pre_tokenizers::byte_level::ByteLevel;
use tokenizers::{AddedToken, Tokenizer};

use super::config::{EncoderConfig, Family};
use super::error::EncoderError;
use super::files::read_bounded;

/// Largest tokeniser file; that of a large vocabulary has some megabytes.
const MAX_TOKENIZER_BYTES: u64 = 128 << 20;

/// The tokeniser of an encoder.
#[derive(Debug)]
pub(super) struct SentenceTokenizer {
    tokenizer: Tokenizer,
    family: Family,
    start_id: u32,
    end_id: u32,
    max_tokens: usize,
    vocab_size: usize,
    /// The files it was made from.
    pub files: Vec<PathBuf>,
}

/// What `tokenizer_config.json` may say, where it is there.
#[derive(Debug, Default, Deserialize)]
struct RawTokenizerConfig {
    do_lower_case: Option<bool>,
    /// Often an absurdly large number that means none.
    model_max_length: Option<f64>,
}

impl SentenceTokenizer {
    pub fn open(folder: &Path, config: &EncoderConfig) -> Result<Self, EncoderError> {
        let settings_path = folder.join("tokenizer_config.json");
        let settings: RawTokenizerConfig = if settings_path.exists() {
            let bytes = read_bounded(&settings_path, MAX_TOKENIZER_BYTES)?;
            serde_json::from_slice(&bytes).map_err(|error| EncoderError::Malformed {
                path: settings_path.clone(),
                reason: error.to_string(),
            })?
        } else {
            RawTokenizerConfig::default()
        };
        let whole = folder.join("tokenizer.json");
        let (tokenizer, files) = if whole.exists() {
            (from_whole(&whole)?, vec![whole])
        } else {
            match config.family {
                Family::Bert => {
                    let vocabulary = folder.join("vocab.txt");
                    (word_pieces(&vocabulary, settings.do_lower_case.unwrap_or(true))?, vec![vocabulary])
                }
                Family::Roberta => {
                    let (vocabulary, merges) = (folder.join("vocab.json"), folder.join("merges.txt"));
                    (byte_pairs(&vocabulary, &merges)?, vec![vocabulary, merges])
                }
            }
        };
        let id = |token: &str| {
            tokenizer.token_to_id(token).ok_or_else(|| EncoderError::Malformed {
                path: files[0].clone(),
                reason: format!("the vocabulary has no {token}"),
            })
        };
        let (start_id, end_id) = match config.family {
            Family::Bert => (id("[CLS]")?, id("[SEP]")?),
            Family::Roberta => (id("<s>")?, id("</s>")?),
        };
        let told = settings.model_max_length.filter(|&length| (3.0..1e9).contains(&length));
        let max_tokens = told.map_or(config.max_tokens(), |length| config.max_tokens().min(length as usize));
        let vocab_size = config.vocab_size;
        Ok(Self { tokenizer, family: config.family, start_id, end_id, max_tokens, vocab_size, files })
    }

    /// Ids with start and end tokens; words beyond the longest sentence the encoder takes are cut off.
    ///
    /// `prefix_space` gives byte pairs the first word as they give the others, with a space before it.
    pub fn encode(&self, sentence: &str, prefix_space: bool) -> Result<Vec<u32>, EncoderError> {
        let failed = |reason: String| EncoderError::Tokenise { sentence: sentence.to_owned(), reason };
        let trimmed = sentence.trim();
        let text = match self.family {
            Family::Roberta if prefix_space && !trimmed.is_empty() => format!(" {trimmed}"),
            _ => trimmed.to_owned(),
        };
        let encoding = self.tokenizer.encode_fast(text, false).map_err(|error| failed(error.to_string()))?;
        let words = encoding.get_ids().iter().copied().take(self.max_tokens - 2);
        let ids: Vec<u32> = std::iter::once(self.start_id).chain(words).chain([self.end_id]).collect();
        match ids.iter().find(|&&id| id as usize >= self.vocab_size) {
            Some(id) => {
                Err(failed(format!("it has the token {id}, and the model knows {}", self.vocab_size)))
            }
            None => Ok(ids),
        }
    }
}

fn malformed(path: &Path) -> impl Fn(tokenizers::Error) -> EncoderError {
    move |error| EncoderError::Malformed { path: path.to_owned(), reason: error.to_string() }
}

/// The tokeniser of a `tokenizer.json`, without the padding and truncation it may come with.
fn from_whole(path: &Path) -> Result<Tokenizer, EncoderError> {
    let bytes = read_bounded(path, MAX_TOKENIZER_BYTES)?;
    let mut tokenizer = Tokenizer::from_bytes(bytes).map_err(malformed(path))?;
    tokenizer.with_padding(None);
    tokenizer.with_truncation(None).map_err(malformed(path))?;
    Ok(tokenizer)
}

fn word_pieces(path: &Path, lowercase: bool) -> Result<Tokenizer, EncoderError> {
    let bytes = read_bounded(path, MAX_TOKENIZER_BYTES)?;
    let vocabulary = WordPiece::read_bytes(&bytes).map_err(malformed(path))?;
    let model = WordPiece::builder()
        .vocab(vocabulary)
        .unk_token("[UNK]".to_owned())
        .build()
        .map_err(malformed(path))?;
    let mut tokenizer = Tokenizer::new(model);
    tokenizer
        .with_normalizer(Some(BertNormalizer::new(true, true, None, lowercase)))
        .map_err(malformed(path))?;
    tokenizer.with_pre_tokenizer(Some(BertPreTokenizer));
    mark_special(&mut tokenizer, &["[PAD]", "[UNK]", "[CLS]", "[SEP]", "[MASK]"], path)?;
    Ok(tokenizer)
}

fn byte_pairs(vocabulary: &Path, merges: &Path) -> Result<Tokenizer, EncoderError> {
    // Their sizes are checked here, and the library reads them by name.
    read_bounded(vocabulary, MAX_TOKENIZER_BYTES)?;
    read_bounded(merges, MAX_TOKENIZER_BYTES)?;
    let name = |path: &Path| path.to_string_lossy().into_owned();
    let model = BPE::from_file(&name(vocabulary), &name(merges)).build().map_err(malformed(merges))?;
    let mut tokenizer = Tokenizer::new(model);
    tokenizer.with_pre_tokenizer(Some(ByteLevel::new(false, true, true)));
    mark_special(&mut tokenizer, &["<s>", "<pad>", "</s>", "<unk>", "<mask>"], vocabulary)?;
    Ok(tokenizer)
}

/// Keeps special tokens whole where a sentence spells them.
fn mark_special(tokenizer: &mut Tokenizer, names: &[&str], path: &Path) -> Result<(), EncoderError> {
    let known: Vec<AddedToken> = names
        .iter()
        .filter(|name| tokenizer.token_to_id(name).is_some())
        .map(|&name| AddedToken::from(name, true))
        .collect();
    tokenizer.add_special_tokens(known).map_err(malformed(path))?;
    Ok(())
}
