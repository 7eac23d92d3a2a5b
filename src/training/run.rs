//! The run itself.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::time::Instant;

use burn::module::Module;
use burn::tensor::{Device, Tensor};

use super::batches::{Batch, Batches};
use super::checkpoint::{self, Best, State};
use super::error::TrainingError;
use super::folder::{CHECKPOINTS, RunFolder};
use super::journal::Journal;
use super::optimizer::Optimizer;
use super::plan::{Phase, Plan, Stage};
use super::record::{Iteration, LossValues, Validation};
use super::settings::{Keep, RunSettings};
use super::validation::{CaptionScore, validate};
use crate::features::PreparedSet;
use crate::model::{Bundle, Feeds, Losses, Part, Rprae, load_weights, weights};

/// What happens during a run.
#[derive(Debug)]
pub enum Event<'a> {
    /// The run begins, or goes on after some iterations.
    Started {
        /// Iterations there will be.
        plan: Plan,
        /// Iterations behind it already.
        done: usize,
    },
    /// An iteration is over.
    Iterated(&'a Iteration),
    /// The validation pairs were looked at.
    Validated(&'a Validation),
    /// The validation stopped getting better, and the settings ask to stop then.
    StoppedEarly {
        /// Last iteration.
        iteration: usize,
    },
}

/// A model at the end of its run.
#[derive(Debug)]
pub struct Trained {
    /// The best model of the last stage, or the last one where nothing was validated or the settings keep that; without
    /// automatic differentiation.
    pub model: Rprae,
    /// Iteration it is from.
    pub iteration: usize,
    /// The lowest validation loss of the last stage.
    pub best: Option<Best>,
    /// Iterations behind the run.
    pub done: usize,
    /// What it learned from, where that is more than was prepared.
    mirrored: Option<PreparedSet>,
}

impl Trained {
    /// What it learned from, in its range, given the prepared set it was trained on.
    #[must_use]
    pub fn learned<'a>(&'a self, set: &'a PreparedSet) -> &'a PreparedSet {
        self.mirrored.as_ref().unwrap_or(set)
    }

    /// The model with everything it needs, first frames of motions too, given what it was trained with.
    #[must_use]
    pub fn bundle(&self, settings: &RunSettings, set: &PreparedSet) -> Bundle {
        Bundle::new(&self.model, &settings.model, self.learned(set)).with_starts(self.learned(set))
    }
}

/// Trains a model in a folder, from its last checkpoint if it has one; `score` judges captions at every validation.
///
/// The set is the prepared one: mirror images, where the settings ask for them, are made here.
///
/// # Errors
/// [`TrainingError`] says what stopped the run; it can be resumed from its last checkpoint.
pub fn train(
    set: &PreparedSet,
    settings: &RunSettings,
    device: &Device,
    folder: &RunFolder,
    score: Option<&CaptionScore<'_>>,
    observe: &mut dyn FnMut(Event<'_>),
) -> Result<Trained, TrainingError> {
    let plan = Plan::new(&settings.training, set);
    check(set, plan)?;
    let mirrored = settings.training.mirror.then(|| set.with_mirror_images());
    let learned = mirrored.as_ref().unwrap_or(set);
    let mut run = Run::open(learned, settings, plan, device, folder, score)?;
    observe(Event::Started { plan, done: run.state.iteration });
    while run.state.iteration < plan.total() {
        if run.is_patience_over() {
            observe(Event::StoppedEarly { iteration: run.state.iteration });
            break;
        }
        run.iterate(observe)?;
    }
    let trained = run.finish()?;
    Ok(Trained { mirrored, ..trained })
}

/// Says what the data lack for a plan.
///
/// # Errors
/// [`TrainingError::Data`].
pub fn check(set: &PreparedSet, plan: Plan) -> Result<(), TrainingError> {
    let lacking = |fault: &str| Err(TrainingError::Data { fault: fault.to_owned() });
    if plan.stage1 > 0 && (set.non_paired_captions.is_empty() || set.non_paired_motions.is_empty()) {
        return lacking("no captions or no motions for stage 1");
    }
    if plan.stage2 > 0 && set.paired.is_empty() {
        return lacking("no pairs for stage 2");
    }
    if let Some(motion) = set.motions.iter().find(|motion| motion.frames.len() < 2) {
        return lacking(&format!("a motion of fewer than 2 frames, {}", motion.id));
    }
    if let Some(caption) = set.captions.iter().position(|caption| caption.words.len() < 2) {
        return lacking(&format!("a caption of fewer than 2 words, number {caption}"));
    }
    Ok(())
}

struct Run<'a> {
    set: &'a PreparedSet,
    settings: &'a RunSettings,
    plan: Plan,
    device: Device,
    checkpoints: PathBuf,
    model: Rprae,
    /// What the model is set to learn.
    phase: Option<Phase>,
    optimizer: Optimizer,
    batches: Batches<'a>,
    journal: Journal,
    state: State,
    score: Option<&'a CaptionScore<'a>>,
}

impl<'a> Run<'a> {
    fn open(
        set: &'a PreparedSet,
        settings: &'a RunSettings,
        plan: Plan,
        device: &Device,
        folder: &RunFolder,
        score: Option<&'a CaptionScore<'a>>,
    ) -> Result<Self, TrainingError> {
        let device = device.clone().autodiff();
        let checkpoints = folder.path.join(CHECKPOINTS);
        let mut model = Rprae::new(&settings.model, &set.vocabulary, settings.seed, &device);
        let mut optimizer = Optimizer::new(&settings.training);
        let state = match checkpoint::list(&checkpoints)?.last() {
            Some(&iteration) => {
                let saved = checkpoint::read(&checkpoints, iteration)?;
                let sizes = saved.weights.iter().map(|(name, tensor)| (name.clone(), tensor.values.len()));
                let sizes: BTreeMap<String, usize> = sizes.collect();
                model = load_weights(model, saved.weights)?;
                optimizer
                    .restore(saved.moments, &saved.state.updates, &sizes, &device.clone().inner())
                    .map_err(|reason| TrainingError::Checkpoint { path: checkpoints.clone(), reason })?;
                checkpoint::tidy(&checkpoints, &saved.state)?;
                saved.state
            }
            None => State {
                iteration: 0,
                best: None,
                validations_since_best: 0,
                metrics_bytes: 0,
                events_bytes: 0,
                updates: BTreeMap::new(),
            },
        };
        let journal = Journal::open(&folder.path, state.metrics_bytes, state.events_bytes)?;
        let batches = Batches::new(set, settings.seed, settings.training.batch_size, device.clone());
        Ok(Self {
            set,
            settings,
            plan,
            device,
            checkpoints,
            model,
            phase: None,
            optimizer,
            batches,
            journal,
            state,
            score,
        })
    }

    /// One iteration of Algorithm 1, with what is due after it.
    fn iterate(&mut self, observe: &mut dyn FnMut(Event<'_>)) -> Result<(), TrainingError> {
        let iteration = self.state.iteration + 1;
        if self.plan.stage1 > 0 && iteration == self.plan.stage1 + 1 {
            // The losses of the two stages cannot be compared.
            self.state.best = None;
            self.state.validations_since_best = 0;
        }
        let record = self.learn(iteration)?;
        self.state.iteration = iteration;
        self.journal.iteration(&record)?;
        observe(Event::Iterated(&record));

        let training = &self.settings.training;
        let ends_stage = iteration == self.plan.stage1 || iteration == self.plan.total();
        let is_validated =
            ends_stage || training.validate_every > 0 && iteration.is_multiple_of(training.validate_every);
        let is_better = is_validated && self.validate(iteration, observe)?;
        if is_better || ends_stage || iteration.is_multiple_of(training.checkpoint_every) {
            self.save()?;
        }
        Ok(())
    }

    /// Forward, backward, update.
    fn learn(&mut self, iteration: usize) -> Result<Iteration, TrainingError> {
        let started = Instant::now();
        let (stage, phase) = (self.plan.stage(iteration), self.plan.phase(iteration));
        let batch = match stage {
            Stage::One => self.batches.non_paired(iteration - 1),
            Stage::Two => self.batches.paired(iteration - 1 - self.plan.stage1),
        };
        self.choose(phase);
        let progress = self.plan.progress(iteration);
        let mut feeds = Feeds::of(&self.settings.model, self.settings.seed, iteration, progress);
        let losses = self.model.losses(
            &batch.captions,
            &batch.motions,
            batch.pairs.as_deref(),
            &self.settings.model,
            &self.settings.loss,
            &mut feeds,
        );
        let loss = values(&losses);
        if let Some((name, _)) = loss.named().into_iter().find(|(_, loss)| !loss.is_finite()) {
            return Err(self.not_finite(format!("the {name} loss"), iteration, &batch));
        }
        let share = self.settings.training.learning_rate_decay.factor(&self.plan, iteration);
        let gradients = (losses.total() + losses.length.clone()).backward();
        let (model, norms) = self.optimizer.step(self.model.clone(), gradients, share);
        self.model = model;
        let norms = norms.map_err(|found| {
            let part = match found.part {
                Part::Retrofit => "retrofit layer",
                Part::Rae => "autoencoders",
                Part::Length => "length head",
            };
            self.not_finite(format!("the gradient of the {part}"), iteration, &batch)
        })?;
        let learned = norms.iter().filter(|(part, _)| **part != Part::Length).map(|(_, norm)| *norm);
        let gradient_norm = learned.fold(0.0, f64::max);
        Ok(Iteration { iteration, stage, phase, loss, gradient_norm, secs: started.elapsed().as_secs_f64() })
    }

    /// Lets exactly the part of a phase learn, so that nothing is computed for the one that rests.
    fn choose(&mut self, phase: Phase) {
        if self.phase == Some(phase) {
            return;
        }
        let Rprae { retrofit, description, action, length } = self.model.clone();
        let learns = |part| phase == Phase::Both || phase == part;
        self.model = Rprae {
            retrofit: retrofit.set_require_grad(learns(Phase::Retrofit)),
            description: description.set_require_grad(learns(Phase::Rae)),
            action: action.set_require_grad(learns(Phase::Rae)),
            length,
        };
        self.phase = Some(phase);
    }

    /// Looks at the validation pairs; whether this is the best model of its stage so far.
    fn validate(
        &mut self,
        iteration: usize,
        observe: &mut dyn FnMut(Event<'_>),
    ) -> Result<bool, TrainingError> {
        let (stage, device) = (self.plan.stage(iteration), self.device.clone().inner());
        let found = validate(&self.model, self.set, self.settings, &device, (iteration, stage), self.score);
        let Some(found) = found else { return Ok(false) };
        self.journal.validation(&found)?;
        observe(Event::Validated(&found));
        let loss = found.validation.total;
        let is_better = loss.is_finite() && self.state.best.is_none_or(|best| loss < best.loss);
        if is_better {
            self.state.best = Some(Best { iteration, loss });
            self.state.validations_since_best = 0;
        } else {
            self.state.validations_since_best += 1;
        }
        Ok(is_better)
    }

    /// Whether stage 2 has waited long enough for a better validation.
    fn is_patience_over(&self) -> bool {
        self.state.iteration > self.plan.stage1
            && self.settings.training.early_stop.is_some_and(|most| self.state.validations_since_best >= most)
    }

    fn save(&mut self) -> Result<(), TrainingError> {
        (self.state.metrics_bytes, self.state.events_bytes) = self.journal.sync()?;
        let (moments, updates) = self.optimizer.state();
        self.state.updates = updates;
        checkpoint::write(&self.checkpoints, &self.state, &weights(&self.model), &moments)
    }

    /// The model to keep.
    fn finish(mut self) -> Result<Trained, TrainingError> {
        let done = self.state.iteration;
        let is_saved = checkpoint::list(&self.checkpoints)?.last() == Some(&done);
        if !is_saved {
            self.save()?;
        }
        let iteration = match (self.settings.training.keep, self.state.best) {
            (Keep::Best, Some(best)) => best.iteration,
            _ => done,
        };
        let mut model = self.model.valid();
        if iteration != done {
            model = load_weights(model, checkpoint::read_weights(&self.checkpoints, iteration)?)?;
        }
        Ok(Trained { model, iteration, best: self.state.best, done, mirrored: None })
    }

    fn not_finite(&self, what: String, iteration: usize, batch: &Batch) -> TrainingError {
        let kept = match checkpoint::list(&self.checkpoints) {
            Ok(kept) if !kept.is_empty() => {
                format!("the checkpoint of iteration {} is kept", kept[kept.len() - 1])
            }
            _ => "there is no checkpoint yet".to_owned(),
        };
        TrainingError::NotFinite { what, iteration, kept, batch: batch.ids(self.set) }
    }
}

/// Losses as numbers, in one read from the device.
fn values(losses: &Losses) -> LossValues {
    let mut parts = vec![losses.description.clone(), losses.action.clone(), losses.length.clone()];
    parts.extend(losses.binding.clone());
    let parts = parts.into_iter().map(Tensor::without_autodiff).collect();
    let values: Vec<f64> = Tensor::cat(parts, 0).into_data().iter().collect();
    let binding = values.get(3).copied();
    LossValues {
        total: values[0] + values[1] + binding.unwrap_or(0.0),
        description: values[0],
        action: values[1],
        binding,
        length: values[2],
    }
}
