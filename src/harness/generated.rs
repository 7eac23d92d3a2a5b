//! Motions made of sentences, beside motions that are there.

use std::path::PathBuf;

use super::n_best::choose;
use super::{Language, LanguageSettings, RunSettings, Source};
use crate::dataset::{CaptionFile, Sample};
use crate::manifest::SkippedInput;
use crate::motion::{Body, Motion};
use crate::report::Candidate;
use crate::translation::{Acting, upsampled};

/// Frames a second of the motions handed to the simulator.
const RATE_HZ: f64 = 100.0;
/// What the ids of motions made begin with.
const PREFIX: &str = "caption";

/// A source of motions made of sentences, each with the sentence as its caption; perhaps after those of another source.
pub struct Generated<'a> {
    references: Option<&'a dyn Source>,
    language: &'a Language,
    settings: &'a RunSettings,
    name: String,
    /// Id and sentence, in the order of the file.
    sentences: Vec<(String, String)>,
    skipped: Vec<SkippedInput>,
    /// Sorted ids, each with its place in `references` or `sentences`.
    order: Vec<(String, Origin)>,
}

#[derive(Clone, Copy)]
enum Origin {
    Reference(usize),
    Sentence(usize),
}

impl<'a> Generated<'a> {
    /// Motions of `references`, if any, and of the sentences of a file.
    ///
    /// Ids are `caption-001` and so on, in the order of the file; several captions of one record are several sentences.
    #[must_use]
    pub fn new(
        references: Option<&'a dyn Source>,
        file: CaptionFile,
        name: String,
        language: &'a Language,
        settings: &'a RunSettings,
    ) -> Self {
        let reference_ids = references.map(Source::ids).unwrap_or_default();
        // No reference may have the id of a sentence.
        let mut prefix = PREFIX.to_owned();
        while reference_ids.iter().any(|id| id.starts_with(&format!("{prefix}-"))) {
            prefix.push_str("-made");
        }
        let digits = file.num_captions().to_string().len().max(3);
        let texts = file.records.into_iter().flat_map(|record| record.texts);
        let sentences: Vec<(String, String)> = texts
            .enumerate()
            .map(|(number, text)| (format!("{prefix}-{:0digits$}", number + 1), text))
            .collect();
        let mut order: Vec<(String, Origin)> = reference_ids
            .into_iter()
            .enumerate()
            .map(|(place, id)| (id, Origin::Reference(place)))
            .chain(sentences.iter().enumerate().map(|(place, (id, _))| (id.clone(), Origin::Sentence(place))))
            .collect();
        order.sort_by(|a, b| a.0.cmp(&b.0));
        let mut skipped = references.map(Source::skipped).unwrap_or_default();
        skipped.extend(file.skipped.into_iter().map(SkippedInput::from));
        Self { references, language, settings, name, sentences, skipped, order }
    }

    fn act(&self, place: usize) -> Result<(Sample, Vec<Candidate>), String> {
        let (id, sentence) = &self.sentences[place];
        let defaults = LanguageSettings::default();
        let settings = self.settings.language.as_ref().unwrap_or(&defaults);
        let translator = self.language.translator();
        let reading = translator.read(sentence).map_err(|error| error.to_string())?;
        let latent = translator.latent_of(&reading);
        let mut body = Body::with_default_mass(settings.height_m);
        body.mass_kg = self.settings.mass_kg.unwrap_or(body.mass_kg);
        let acting = Acting { length_secs: settings.length_secs, body };
        let seed = self.settings.seed;
        let made = translator.act_often(&latent, &acting, settings.n_best, settings.noise, seed);
        let mut motions: Vec<Motion> = made
            .map_err(|error| error.to_string())?
            .iter()
            .map(|made| upsampled(&made.motion, RATE_HZ).map_err(|error| error.to_string()))
            .collect::<Result<_, _>>()?;
        let (kept, candidates) =
            if motions.len() > 1 { choose(&motions, &self.settings.simulation)? } else { (0, Vec::new()) };
        let sample = Sample {
            id: id.clone(),
            motion: motions.swap_remove(kept),
            captions: vec![sentence.clone()],
            warnings: reading.notes.iter().map(ToString::to_string).collect(),
            source: PathBuf::from("made of its caption"),
        };
        Ok((sample, candidates))
    }
}

impl Source for Generated<'_> {
    fn name(&self) -> String {
        self.name.clone()
    }

    fn ids(&self) -> Vec<String> {
        self.order.iter().map(|(id, _)| id.clone()).collect()
    }

    fn skipped(&self) -> Vec<SkippedInput> {
        self.skipped.clone()
    }

    fn load(&self, index: usize) -> Result<Sample, SkippedInput> {
        Ok(self.load_chosen(index)?.0)
    }

    fn load_chosen(&self, index: usize) -> Result<(Sample, Vec<Candidate>), SkippedInput> {
        let (id, origin) = &self.order[index];
        let skipped = |reason| SkippedInput { id: id.clone(), source: self.name.clone(), reason };
        match (origin, self.references) {
            (Origin::Reference(place), Some(references)) => references.load_chosen(*place),
            (Origin::Reference(_), None) => Err(skipped("there are no references".to_owned())),
            (Origin::Sentence(place), _) => self.act(*place).map_err(skipped),
        }
    }
}
