//! Adam with clipping, separately for the parts that learn in turn.

use std::collections::BTreeMap;

use burn::module::{Module, ModuleMapper, ModuleVisitor, Param};
use burn::optim::{AdamState, AdaptiveMomentumState, Optimizer as _};
use burn::tensor::{Device, Gradients, Tensor, TensorData};

use super::adam::Adam;
use super::settings::TrainingSettings;
use crate::model::{NamedTensor, Part, Rprae};

/// Adam's memory of every weight that has learned.
///
/// A part that rests keeps its memory: its weights remember the slopes of their own iterations only.
pub(super) struct Optimizer {
    adam: Adam,
    learning_rate: f64,
    clip_norm: f64,
    states: BTreeMap<String, AdamState<1>>,
}

/// A gradient that is no number.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct NotFinite {
    /// The part it would have changed.
    pub(super) part: Part,
}

impl Optimizer {
    pub(super) fn new(settings: &TrainingSettings) -> Self {
        Self {
            adam: Adam::new(settings.beta_1, settings.beta_2, settings.epsilon),
            learning_rate: settings.learning_rate,
            clip_norm: settings.clip_norm,
            states: BTreeMap::new(),
        }
    }

    /// One update of every weight that has a gradient, with a share of the step size, and the norm of the gradient of each
    /// part before clipping.
    ///
    /// Nothing changes when a norm is not finite.
    pub(super) fn step(
        &mut self,
        model: Rprae,
        mut gradients: Gradients,
        share: f64,
    ) -> (Rprae, Result<BTreeMap<Part, f64>, NotFinite>) {
        let mut collect = Collect { path: Vec::new(), gradients: &mut gradients, found: BTreeMap::new() };
        model.visit(&mut collect);
        let mut found = collect.found;
        let norms = norms(&found);
        if let Some((&part, _)) = norms.iter().find(|(_, norm)| !norm.is_finite()) {
            return (model, Err(NotFinite { part }));
        }
        for (name, gradient) in &mut found {
            let norm = norms[&Part::of(name)];
            if norm > self.clip_norm {
                *gradient = gradient.clone().mul_scalar(self.clip_norm / norm);
            }
        }
        let mut update = Update {
            path: Vec::new(),
            gradients: found,
            states: &mut self.states,
            adam: &self.adam,
            learning_rate: self.learning_rate * share,
        };
        (model.map(&mut update), Ok(norms))
    }

    /// The memory as tensors, and for each weight the number of its updates.
    pub(super) fn state(&self) -> (BTreeMap<String, NamedTensor>, BTreeMap<String, usize>) {
        let named = |tensor: &Tensor<1>| NamedTensor {
            shape: tensor.dims().to_vec(),
            values: tensor.clone().into_data().iter().collect(),
        };
        let moments = self.states.iter().flat_map(|(name, state)| {
            let momentum = &state.momentum;
            [
                (format!("{name}.moment_1"), named(&momentum.moment_1)),
                (format!("{name}.moment_2"), named(&momentum.moment_2)),
            ]
        });
        let times = self.states.iter().map(|(name, state)| (name.clone(), state.momentum.time));
        (moments.collect(), times.collect())
    }

    /// Takes the memory back; `sizes` are the numbers of each weight. Says which tensor does not fit.
    pub(super) fn restore(
        &mut self,
        mut moments: BTreeMap<String, NamedTensor>,
        times: &BTreeMap<String, usize>,
        sizes: &BTreeMap<String, usize>,
        device: &Device,
    ) -> Result<(), String> {
        self.states.clear();
        for (name, &time) in times {
            let size = sizes.get(name).ok_or_else(|| format!("{name} is no weight"))?;
            let mut take = |which: &str| {
                let name = format!("{name}.{which}");
                match moments.remove(&name) {
                    Some(tensor) if tensor.values.len() == *size => {
                        Ok(Tensor::from_data(TensorData::new(tensor.values, [*size]), device))
                    }
                    _ => Err(format!("{name} does not fit")),
                }
            };
            let momentum = AdaptiveMomentumState::new(time, take("moment_1")?, take("moment_2")?);
            self.states.insert(name.clone(), AdamState::new(momentum));
        }
        Ok(())
    }
}

/// Norm of the gradient of each part; one read from the device for all.
fn norms(gradients: &BTreeMap<String, Tensor<1>>) -> BTreeMap<Part, f64> {
    if gradients.is_empty() {
        return BTreeMap::new();
    }
    let squares = gradients.values().map(|gradient| gradient.clone().square().sum()).collect();
    let squares: Vec<f64> = Tensor::cat(squares, 0).into_data().iter().collect();
    let mut norms = BTreeMap::new();
    for (name, square) in gradients.keys().zip(squares) {
        *norms.entry(Part::of(name)).or_insert(0.0) += square;
    }
    for norm in norms.values_mut() {
        *norm = f64::sqrt(*norm);
    }
    norms
}

struct Collect<'a> {
    path: Vec<String>,
    gradients: &'a mut Gradients,
    found: BTreeMap<String, Tensor<1>>,
}

impl ModuleVisitor for Collect<'_> {
    fn enter_module(&mut self, name: &str, _: &str) {
        self.path.push(name.to_owned());
    }

    fn exit_module(&mut self, _: &str, _: &str) {
        self.path.pop();
    }

    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
        if let Some(gradient) = param.val().grad_remove(self.gradients) {
            let size: usize = gradient.dims().iter().product();
            self.found.insert(self.path.join("."), gradient.reshape([size]));
        }
    }
}

struct Update<'a> {
    path: Vec<String>,
    gradients: BTreeMap<String, Tensor<1>>,
    states: &'a mut BTreeMap<String, AdamState<1>>,
    adam: &'a Adam,
    learning_rate: f64,
}

impl ModuleMapper for Update<'_> {
    fn enter_module(&mut self, name: &str, _: &str) {
        self.path.push(name.to_owned());
    }

    fn exit_module(&mut self, _: &str, _: &str) {
        self.path.pop();
    }

    fn map_float<const D: usize>(&mut self, param: Param<Tensor<D>>) -> Param<Tensor<D>> {
        let name = self.path.join(".");
        let Some(gradient) = self.gradients.remove(&name) else { return param };
        let (id, tensor, mapper) = param.consume();
        let shape = tensor.dims();
        let size = gradient.dims()[0];
        let flat = tensor.inner().reshape([size]);
        let (flat, state) = self.adam.step(self.learning_rate, flat, gradient, self.states.remove(&name));
        if let Some(state) = state {
            self.states.insert(name, state);
        }
        let tensor = Tensor::from_inner(flat.reshape(shape)).require_grad();
        Param::from_mapped_value(id, tensor, mapper)
    }
}
