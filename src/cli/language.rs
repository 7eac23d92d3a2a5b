//! The model in the loop of a run: which one, with which sentences.

use anyhow::{Context as _, anyhow};

use super::bundled;
use super::sim::SimArgs;
use crate::dataset::{CaptionFile, WordVectors};
use crate::evaluation::encoder::{Encoder, Pooling};
use crate::harness::{Language, LanguageSettings, RunSettings, bundle_sha256};
use crate::report::{KEY_METRICS, Results};

/// Shown per case when a model is in the loop, after the other key metrics.
const LANGUAGE_KEYS: [&str; 3] = ["l0/caption_latent", "l0/caption_bleu", "l2/caption_bleu_lost"];

/// Decides whether a model is in the loop: one is asked for, or nothing is said and one comes with the project.
///
/// A settings file says all there is to say; without a model in it there is none unless a flag asks for one.
pub(super) fn resolve(args: &SimArgs, settings: &mut RunSettings) -> anyhow::Result<()> {
    let is_asked = args.bundle.is_some()
        || args.captions.is_some()
        || args.n_best.is_some()
        || args.noise.is_some()
        || args.length.is_some()
        || args.settle.is_some()
        || args.vectors.is_some()
        || args.sentence_encoder.is_some();
    let is_plain = args.config.is_none() && settings.motions.is_none() && bundled::model_folder().is_some();
    if settings.language.is_none() && (is_asked || is_plain) {
        settings.language = Some(LanguageSettings::default());
    }
    if args.no_language {
        settings.language = None;
    }
    let Some(language) = &mut settings.language else { return Ok(()) };
    language.bundle = args.bundle.clone().or(language.bundle.take());
    language.captions = args.captions.clone().or(language.captions.take());
    language.n_best = args.n_best.unwrap_or(language.n_best);
    language.noise = args.noise.unwrap_or(language.noise);
    language.length_secs = args.length.or(language.length_secs);
    language.settle_secs = args.settle.unwrap_or(language.settle_secs);
    language.height_m = args.height.unwrap_or(language.height_m);
    language.vectors = args.vectors.clone().or(language.vectors.take());
    language.sentence_encoder = args.sentence_encoder.clone().or(language.sentence_encoder.take());

    let folder = bundled::model(language.bundle.as_deref())?;
    let found = bundle_sha256(&folder).with_context(|| format!("load the model {}", folder.display()))?;
    if !language.bundle_sha256.is_empty() && language.bundle_sha256 != found && args.bundle.is_none() {
        return Err(anyhow!(
            "repeat the run: the model {} is not the one of the settings; --bundle DIR takes it all the same",
            folder.display()
        ));
    }
    language.bundle_sha256 = found;
    settings.check()?;
    Ok(())
}

/// Loads the model in the loop, and the sentences to make motions of; nothing without a model.
pub(super) fn load(settings: &RunSettings) -> anyhow::Result<Option<(Language, Option<CaptionFile>)>> {
    let Some(language) = &settings.language else { return Ok(None) };
    let sentences = match &language.captions {
        _ if !settings.has_generated() => None,
        Some(path) => Some(CaptionFile::read(path)?),
        None => Some(bundled::captions()),
    };
    for warning in sentences.iter().flat_map(|file| &file.warnings) {
        eprintln!("captions: {warning}");
    }
    let mut translator = bundled::load(language.bundle.as_deref(), None)?;
    if let Some(path) = &language.vectors {
        let texts = sentences.iter().flat_map(|file| &file.records).flat_map(|record| &record.texts);
        let unknown = translator.unknown_words(texts.map(String::as_str));
        if !unknown.is_empty() {
            translator.add_vectors(WordVectors::read(path, &unknown, &|_| ())?)?;
        }
    }
    let encoder = match &language.sentence_encoder {
        None => None,
        Some(folder) => {
            let encoder = Encoder::open(folder, None)?;
            let pooling = if encoder.has_pooler() { Pooling::Pooler } else { Pooling::Cls };
            Some((encoder, pooling))
        }
    };
    Ok(Some((Language::new(translator, &language.bundle_sha256, encoder), sentences)))
}

/// The metrics that tables for people show.
pub(super) fn key_metrics(results: &Results) -> Vec<&'static str> {
    let told = LANGUAGE_KEYS.into_iter().filter(|key| results.metric(key).is_some());
    KEY_METRICS.iter().copied().chain(told).collect()
}
