//! The model in the loop of a run: which one, with which sentences.

use std::path::Path;

use anyhow::{Context as _, bail};

use super::bundled;
use super::sim::SimArgs;
use crate::dataset::{CaptionFile, Dataset, Entry, WordVectors};
use crate::evaluation::encoder::Encoder;
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
    confirm(&mut language.bundle_sha256, found, ("model", "--bundle DIR", args.bundle.is_some()), &folder)?;
    settings.check()?;
    check_effect(args, settings)
}

/// Refuses flags that would change nothing.
fn check_effect(args: &SimArgs, settings: &RunSettings) -> anyhow::Result<()> {
    let of_made = [
        ("--n-best", args.n_best.is_some()),
        ("--noise", args.noise.is_some()),
        ("--length", args.length.is_some()),
        ("--settle", args.settle.is_some()),
    ];
    if !settings.has_generated()
        && let Some((flag, _)) = of_made.into_iter().find(|(_, is_given)| *is_given)
    {
        bail!("use {flag}: this run makes no motions of sentences; give them with --captions FILE");
    }
    let n_best = settings.language.as_ref().map_or(1, |language| language.n_best);
    if args.noise.is_some() && n_best == 1 {
        bail!(
            "use --noise: it acts from the second motion of a sentence on; ask for several with --n-best N"
        );
    }
    Ok(())
}

/// Takes note of the checksum of what was found, unless the settings have that of something else and no flag asks for it.
fn confirm(
    known: &mut String,
    found: String,
    (what, flag, is_given): (&str, &str, bool),
    place: &Path,
) -> anyhow::Result<()> {
    if !known.is_empty() && *known != found && !is_given {
        bail!(
            "repeat the run: the {what} {} is not the one of the settings; {flag} takes it all the same",
            place.display()
        );
    }
    *known = found;
    Ok(())
}

/// Loads the model in the loop, and the sentences to make motions of; nothing without a model.
///
/// Word vectors are looked up for these sentences and for the captions of the references.
pub(super) fn load(
    args: &SimArgs,
    settings: &mut RunSettings,
    references: Option<&Dataset>,
) -> anyhow::Result<Option<(Language, Option<CaptionFile>)>> {
    let has_generated = settings.has_generated();
    let ids = &settings.ids;
    let Some(language) = &mut settings.language else { return Ok(None) };
    let sentences = match &language.captions {
        _ if !has_generated => None,
        Some(path) => Some(CaptionFile::read(path)?),
        None => Some(bundled::captions()),
    };
    for warning in sentences.iter().flat_map(|file| &file.warnings) {
        eprintln!("captions: {warning}");
    }
    let mut translator = bundled::load(language.bundle.as_deref(), None)?;
    if let Some(path) = &language.vectors {
        let made = sentences.iter().flat_map(|file| &file.records).flat_map(|record| record.texts.clone());
        let is_wanted = |entry: &&Entry| ids.is_empty() || ids.contains(&entry.id);
        let said = references.into_iter().flat_map(|dataset| {
            let wanted = dataset.entries().iter().filter(is_wanted);
            wanted.flat_map(move |entry| dataset.captions_of(entry))
        });
        let texts: Vec<String> = made.chain(said).collect();
        let unknown = translator.unknown_words(texts.iter().map(String::as_str));
        if !unknown.is_empty() {
            let vectors = WordVectors::read(path, &unknown, &|_| ())?;
            for warning in &vectors.warnings {
                eprintln!("{}: {warning}", path.display());
            }
            translator.add_vectors(vectors)?;
        }
        let found = translator.vectors_sha256().unwrap_or_default();
        let flag = ("word vectors", "--vectors FILE", args.vectors.is_some());
        confirm(&mut language.vectors_sha256, found, flag, path)?;
    } else {
        language.vectors_sha256.clear();
    }
    let encoder = language.sentence_encoder.as_ref().map(|folder| Encoder::open(folder, None)).transpose()?;
    if let Some((encoder, folder)) = encoder.as_ref().zip(language.sentence_encoder.as_ref()) {
        let flag = ("sentence encoder", "--sentence-encoder DIR", args.sentence_encoder.is_some());
        let found = encoder.weights_sha256().to_owned();
        confirm(&mut language.sentence_encoder_sha256, found, flag, folder)?;
    } else {
        language.sentence_encoder_sha256.clear();
    }
    Ok(Some((Language::new(translator, &language.bundle_sha256, encoder), sentences)))
}

/// The metrics that tables for people show.
pub(super) fn key_metrics(results: &Results) -> Vec<&'static str> {
    let told = LANGUAGE_KEYS.into_iter().filter(|key| results.metric(key).is_some());
    KEY_METRICS.iter().copied().chain(told).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flags_that_would_change_nothing_are_refused() {
        let refused = |args: &SimArgs, settings: &RunSettings| {
            check_effect(args, settings).map_err(|error| error.to_string())
        };
        let settings = |motions: bool, n_best: usize| RunSettings {
            motions: motions.then(|| "some/folder".into()),
            language: Some(LanguageSettings { n_best, ..LanguageSettings::default() }),
            ..RunSettings::default()
        };
        let args = SimArgs { n_best: Some(4), noise: Some(0.3), ..SimArgs::default() };
        assert_eq!(refused(&args, &settings(false, 4)), Ok(()));
        assert!(refused(&args, &settings(true, 4)).unwrap_err().contains("--n-best"));
        let args = SimArgs { noise: Some(0.3), ..SimArgs::default() };
        assert!(refused(&args, &settings(false, 1)).unwrap_err().contains("--noise"));
        let args = SimArgs { length: Some(3.0), ..SimArgs::default() };
        assert!(refused(&args, &settings(true, 1)).unwrap_err().contains("--captions"));
        assert_eq!(refused(&SimArgs::default(), &settings(true, 1)), Ok(()));
    }

    #[test]
    fn another_file_than_that_of_the_settings_is_refused_unless_asked_for() {
        let confirmed = |known: &str, is_given: bool| {
            let mut known = known.to_owned();
            let flag = ("word vectors", "--vectors FILE", is_given);
            confirm(&mut known, "new".to_owned(), flag, Path::new("v.bin")).map(|()| known)
        };
        assert_eq!(confirmed("", false).unwrap(), "new");
        assert_eq!(confirmed("new", false).unwrap(), "new");
        assert_eq!(confirmed("old", true).unwrap(), "new");
        let message = confirmed("old", false).unwrap_err().to_string();
        assert!(message.contains("v.bin") && message.contains("not the one of the settings"), "{message}");
    }
}
