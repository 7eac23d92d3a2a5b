//! How good a model is on pairs it does not learn from.

use std::collections::BTreeSet;

use burn::module::Module;
use burn::tensor::Device;

use super::batches::Batch;
use super::plan::Stage;
use super::record::{LossValues, Validation, peak_memory_mib};
use super::settings::RunSettings;
use crate::features::PreparedSet;
use crate::model::{Bundle, Feeds, Frames, LossSettings, Reduction, Rprae};
use crate::motion::NUM_CHANNELS;

/// A caption written from a motion, beside the captions the motion has.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Written {
    /// Identity of the motion.
    pub id: String,
    /// The words that were written, one space between.
    pub hypothesis: String,
    /// What people wrote.
    pub references: Vec<String>,
}

/// Scores captions written from all validation motions, higher is better; `None` where it has nothing to say.
pub type CaptionScore<'a> = dyn Fn(Vec<Written>) -> Option<f64> + 'a;

/// Captions of all validation motions, sorted by id, always the most probable next word.
fn write(model: &Rprae, set: &PreparedSet, settings: &RunSettings) -> Vec<Written> {
    let bundle = Bundle::new(model, &settings.model, set);
    let motions: BTreeSet<usize> = set.validation.iter().map(|pair| pair.motion).collect();
    let motions: Vec<usize> = motions.into_iter().collect();
    let mut written = Vec::new();
    for places in motions.chunks(settings.training.batch_size) {
        let frames: Vec<Frames<'_>> =
            places.iter().map(|&place| set.motions[place].frames.as_slice()).collect();
        let latent = bundle.encode_motions(&frames);
        let captions = bundle.decode_captions(&latent, bundle.config.longest_caption);
        for (&place, words) in places.iter().zip(captions) {
            let words = words.iter().map(|&word| set.vocabulary.words[word as usize].as_str());
            let pairs = set.validation.iter().filter(|pair| pair.motion == place);
            written.push(Written {
                id: set.motions[place].id.clone(),
                hypothesis: words.collect::<Vec<_>>().join(" "),
                references: pairs.map(|pair| set.captions[pair.caption].text.clone()).collect(),
            });
        }
    }
    written
}

/// Means over the validation pairs; `None` when there are none.
pub(super) fn validate(
    model: &Rprae,
    set: &PreparedSet,
    settings: &RunSettings,
    device: &Device,
    (iteration, stage): (usize, Stage),
    score: Option<&CaptionScore<'_>>,
) -> Option<Validation> {
    if set.validation.is_empty() {
        return None;
    }
    let model = model.valid();
    let loss = LossSettings { reduction: Reduction::Mean, ..settings.loss.clone() };
    let mut sums = Sums::default();
    for pairs in set.validation.chunks(settings.training.batch_size) {
        let batch = Batch::of_pairs(set, pairs, device);
        let found = model.losses(
            &batch.captions,
            &batch.motions,
            batch.pairs.as_deref(),
            &settings.model,
            &loss,
            &mut Feeds::closed_loop(),
        );
        let (words, frames) = (batch.captions.num_targets(), batch.motions.num_targets());
        let value = |loss: burn::tensor::Tensor<1>| loss.into_scalar::<f64>();
        sums.description += value(found.description) * words as f64;
        sums.action += value(found.action) * frames as f64;
        sums.binding += found.binding.map_or(0.0, value) * pairs.len() as f64;
        sums.length += value(found.length) * pairs.len() as f64;
        let crossed = model.crossed(&batch.captions, &batch.motions, &settings.model);
        sums.words_right += crossed.words_right;
        sums.squared_error += crossed.squared_error;
        sums.words += words;
        sums.frames += frames;
        sums.pairs += pairs.len();
    }
    let (words, frames, pairs) = (sums.words as f64, sums.frames as f64, sums.pairs as f64);
    let (description, action) = (sums.description / words, sums.action / frames);
    let binding = (stage == Stage::Two).then_some(sums.binding / pairs);
    Some(Validation {
        iteration,
        stage,
        validation: LossValues {
            total: description + action + binding.unwrap_or(0.0),
            description,
            action,
            binding,
            length: sums.length / pairs,
        },
        m2t_word_accuracy: sums.words_right as f64 / words,
        t2m_error: (sums.squared_error / (frames * NUM_CHANNELS as f64)).sqrt(),
        m2t_score: score.and_then(|score| score(write(&model, set, settings))),
        peak_memory_mib: peak_memory_mib(),
    })
}

#[derive(Default)]
struct Sums {
    description: f64,
    action: f64,
    binding: f64,
    length: f64,
    words_right: usize,
    squared_error: f64,
    words: usize,
    frames: usize,
    pairs: usize,
}
