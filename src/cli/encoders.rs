//! `rprae encoders`: where sentence encoders come from, and whether a folder holds a usable one.

use std::fmt::Write as _;
use std::path::PathBuf;

use clap::Args;

use super::exit::{Exit, Failure, OrExit, message};
use super::output;
use crate::evaluation::encoder::{Encoder, KNOWN_ENCODERS};

#[derive(Debug, Args)]
pub(super) struct EncodersArgs {
    /// Folders to check; without one, says how to get the encoders
    #[arg(value_name = "DIR")]
    pub folders: Vec<PathBuf>,
}

/// A sentence any encoder should know.
const PROBE: &str = "a person walks forward slowly.";
/// The same meaning, and another, in other words.
const NEAR: &str = "someone is slowly walking ahead.";
const FAR: &str = "the committee approved the annual budget.";

pub(super) fn run(args: &EncodersArgs) -> Result<Exit, Failure> {
    if args.folders.is_empty() {
        output::print(&guide()).or_failed()?;
        return Ok(Exit::Clean);
    }
    let mut exit = Exit::Clean;
    for folder in &args.folders {
        match check(folder) {
            Ok(text) => output::print(&format!("{}\n{text}", folder.display())).or_failed()?,
            Err(error) => {
                eprintln!("{}: failed to {}", folder.display(), message(&error.into()));
                exit = exit.or_worse(Exit::Usage);
            }
        }
    }
    Ok(exit)
}

fn guide() -> String {
    let mut text = "\
BERTScore and the sentence cosine need a pretrained encoder in a local folder: config.json, model.safetensors, and
tokenizer.json, or vocab.txt (BERT), or vocab.json with merges.txt (RoBERTa). Nothing is downloaded by rprae itself.
"
    .to_owned();
    for known in KNOWN_ENCODERS {
        let folder = known.name.rsplit('/').next().unwrap_or(known.name);
        let _ = write!(
            text,
            "\n{}, about {} MB: {}\n  pip install huggingface_hub\n  hf download {} --include '*.json' '*.txt' model.safetensors --local-dir {folder}\n",
            known.name, known.megabytes, known.purpose, known.name
        );
        let flag = if known.layer.is_some() { "--encoder" } else { "--sentence-encoder" };
        let _ = writeln!(text, "  rprae evaluate {flag} {folder} ...");
    }
    text.push_str("\n`rprae encoders DIR` checks a folder.\n");
    text
}

/// Loads an encoder, runs it, and tells what it is.
fn check(folder: &std::path::Path) -> Result<String, crate::evaluation::encoder::EncoderError> {
    let encoder = Encoder::open(folder, None)?;
    let config = encoder.config();
    let pooling = encoder.pooling();
    let vectors = encoder.sentence_vectors(&[PROBE, NEAR, FAR], pooling)?;
    let cosine = |index: usize| crate::evaluation::cosine(&vectors[0], &vectors[index]);
    Ok(format!(
        "  {}: {} layers, width {}, {} heads, vocabulary {}, up to {} tokens, pooler: {}\n  sha256 of model.safetensors {}\n  \
         tokens of {PROBE:?}: {:?}\n  cosine ({}) {:.3} to {NEAR:?}, {:.3} to {FAR:?}\n",
        encoder.name(),
        config.num_layers,
        config.width,
        config.num_heads,
        config.vocab_size,
        config.max_tokens(),
        if encoder.has_pooler() { "yes" } else { "no" },
        encoder.weights_sha256(),
        encoder.token_ids(PROBE, true)?,
        pooling.name(),
        cosine(1),
        cosine(2),
    ))
}
