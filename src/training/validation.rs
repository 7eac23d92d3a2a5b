//! How good a model is on pairs it does not learn from.

use burn::module::Module;
use burn::tensor::Device;

use super::batches::Batch;
use super::plan::Stage;
use super::record::{LossValues, Validation, peak_memory_mib};
use super::settings::RunSettings;
use crate::features::PreparedSet;
use crate::model::{Feed, LossSettings, Reduction, Rprae};
use crate::motion::NUM_CHANNELS;

/// Means over the validation pairs; `None` when there are none.
pub(super) fn validate(
    model: &Rprae,
    set: &PreparedSet,
    settings: &RunSettings,
    device: &Device,
    iteration: usize,
    stage: Stage,
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
            &mut Feed::ClosedLoop,
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
