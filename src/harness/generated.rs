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
        let acting = Acting { length_secs: settings.length_secs, settle_secs: settings.settle_secs, body };
        let seed = self.settings.seed;
        let made = translator
            .act_often(&latent, &acting, settings.n_best, settings.noise, seed)
            .map_err(|error| error.to_string())?;
        let mut left_out: Vec<String> = made.left_out.iter().map(|(_, error)| error.to_string()).collect();
        let mut motions: Vec<Motion> = Vec::new();
        for (number, acted) in made.motions {
            match upsampled(&acted.motion, RATE_HZ) {
                Ok(motion) => motions.push(motion),
                // The first is what the sentence says.
                Err(error) if number == 0 => return Err(error.to_string()),
                Err(error) => left_out.push(error.to_string()),
            }
        }
        let (motion, candidates) = if settings.n_best > 1 {
            choose(motions, &self.settings.simulation, &mut left_out)?
        } else {
            (motions.swap_remove(0), Vec::new())
        };
        let mut warnings: Vec<String> = reading.notes.iter().map(ToString::to_string).collect();
        warnings.extend(left_out_note(&left_out, settings.n_best));
        let sample = Sample {
            id: id.clone(),
            motion,
            captions: vec![sentence.clone()],
            warnings,
            source: PathBuf::from("made of its caption"),
        };
        Ok((sample, candidates))
    }
}

/// How many of the motions of a sentence were no choice, and why not.
fn left_out_note(reasons: &[String], n_best: usize) -> Option<String> {
    let first = reasons.first()?;
    Some(format!(
        "{} of {n_best} motions made of it are left out, the first since it failed to {first}",
        reasons.len()
    ))
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dataset::{CaptionRecord, Dataset};
    use crate::model::tests::tiny;
    use crate::model::{Bundle, Rprae};
    use crate::training::tests::four_pairs;
    use crate::translation::Translator;

    fn language() -> Language {
        let mut set = four_pairs();
        set.normalizer.minimum.fill(-0.2);
        set.normalizer.maximum.fill(0.2);
        // Above the floor.
        (set.normalizer.minimum[46], set.normalizer.maximum[46]) = (0.9, 1.0);
        let model = Rprae::new(&tiny(), &set.vocabulary, 1, &crate::model::cpu().device);
        Language::new(Translator::new(Bundle::new(&model, &tiny(), &set)), "0123456789abcdef", None)
    }

    fn sentences(texts: &[&str]) -> CaptionFile {
        let texts = texts.iter().map(|&text| text.to_owned()).collect();
        CaptionFile {
            records: vec![CaptionRecord { texts, ..CaptionRecord::default() }],
            ..CaptionFile::default()
        }
    }

    fn settings(n_best: usize) -> RunSettings {
        let language = LanguageSettings { n_best, height_m: 1.6, ..LanguageSettings::default() };
        RunSettings { language: Some(language), ..RunSettings::default() }
    }

    #[test]
    fn motions_made_stand_beside_those_that_are_there() {
        let (language, settings, dataset) = (language(), settings(1), Dataset::bundled());
        let references = ("bundled", &dataset);
        let file = sentences(&["word0004 word0005", "nothing known"]);
        let source = Generated::new(Some(&references), file, "both".to_owned(), &language, &settings);
        let ids = source.ids();
        assert_eq!(ids.len(), dataset.entries().len() + 2);
        assert!(ids.is_sorted() && ids.contains(&"caption-001".to_owned()));
        let at = |id: &str| ids.iter().position(|known| known == id).unwrap();
        assert_eq!(source.load(at("90007")), references.load(6));
        let (made, candidates) = source.load_chosen(at("caption-001")).unwrap();
        assert_eq!((made.captions, candidates.len()), (vec!["word0004 word0005".to_owned()], 0));
        assert_eq!((made.motion.rate_hz(), made.motion.body().height_m), (100.0, 1.6));
        let skipped = source.load(at("caption-002")).unwrap_err();
        assert!(skipped.reason.contains("none of its words"), "{}", skipped.reason);
    }

    #[test]
    fn the_kept_one_of_several_is_the_one_that_runs() {
        let (language, settings) = (language(), settings(3));
        let file = || sentences(&["word0004 word0005"]);
        let load = || {
            let source = Generated::new(None, file(), "made".to_owned(), &language, &settings);
            source.load_chosen(0).unwrap()
        };
        let (sample, candidates) = load();
        assert_eq!(load(), (sample.clone(), candidates.clone()));
        let kept: Vec<&Candidate> = candidates.iter().filter(|candidate| candidate.kept).collect();
        assert_eq!((candidates.len(), kept.len()), (3, 1));
        assert!(candidates.iter().all(|candidate| candidate.badness >= kept[0].badness));
        let humanoid = crate::humanoid::Humanoid::new(sample.motion.body()).unwrap();
        for score in crate::plausibility::kinematic_scores(&humanoid, &sample.motion) {
            if let Some(value) = kept[0].scores.get(score.metric.key) {
                assert_eq!(*value, score.value, "{}", score.metric.key);
            }
        }
    }

    #[test]
    fn marks_that_the_model_cannot_write_do_not_count_against_it() {
        let (language, settings) = (language(), settings(1));
        let source = Generated::new(None, sentences(&["word0004"]), "made".to_owned(), &language, &settings);
        let (sample, _) = source.load_chosen(0).unwrap();
        let read =
            |caption: &str| language.read_back(&sample.motion, &[caption.to_owned()]).unwrap().unwrap();
        let plain = read("word0004 word0005 word0006");
        assert_eq!(read("Word0004, word0005 word0006."), plain);
        assert!(plain.bleu.is_finite());
        assert_eq!(plain.doubts, Vec::<String>::new());
        let frames = vec![crate::motion::Frame::ZERO; 500];
        let long = crate::motion::Motion::new(sample.motion.body(), 100.0, frames).unwrap();
        let read = language.read_back(&long, &["word0004".to_owned()]).unwrap().unwrap();
        assert!(read.doubts[0].contains("longer than any"), "{:?}", read.doubts);
    }

    #[test]
    fn what_was_left_out_is_told() {
        let reasons = ["judge it".to_owned(), "make it".to_owned()];
        let note = left_out_note(&reasons, 5).unwrap();
        assert_eq!(note, "2 of 5 motions made of it are left out, the first since it failed to judge it");
        assert_eq!(left_out_note(&[], 5), None);
    }

    #[test]
    fn metrics_name_the_model_and_come_with_their_level() {
        let language = language();
        let metrics = language.metrics(&[crate::simulation::Level::L0], 1);
        let keys: Vec<&str> = metrics.iter().map(|metric| metric.key.as_str()).collect();
        // No encoder, no cosine; no choice, no gain.
        assert_eq!(keys, ["l0/caption_bleu", "l0/caption_latent"]);
        assert!(metrics[0].signature.starts_with("bundle:0123456789ab|beam:5"), "{}", metrics[0].signature);
    }
}
