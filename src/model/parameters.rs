//! The weights of a model, by name.

use std::collections::BTreeMap;

use burn::module::{Module, ModuleMapper, ModuleVisitor, Param};
use burn::tensor::{Gradients, Tensor, TensorData};

use super::Rprae;

/// Which update a weight belongs to (Algorithm 1).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Part {
    /// `theta_ret`: the retrofit layer, with the vectors of words that come without one.
    Retrofit,
    /// `theta_rae`: both autoencoders.
    Rae,
    /// The length head, which the paper does not have.
    Length,
}

impl Part {
    /// The part a weight belongs to, by its name.
    #[must_use]
    pub fn of(name: &str) -> Self {
        match name.split('.').next() {
            Some("retrofit") => Self::Retrofit,
            Some("length") => Self::Length,
            _ => Self::Rae,
        }
    }
}

/// Numbers and shape of a weight.
#[derive(Debug, Clone, PartialEq)]
pub struct NamedTensor {
    /// Length along each axis.
    pub shape: Vec<usize>,
    /// The numbers, last axis fastest.
    pub values: Vec<f32>,
}

/// Why weights do not fit a model.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum WeightsError {
    /// The model has a weight the file does not have.
    #[error("find the weight {0}")]
    Missing(String),
    /// The file has a weight the model does not have.
    #[error("place the weight {0}: the model has none of this name")]
    Unknown(String),
    /// The shapes differ.
    #[error("place the weight {name}: its shape is {found:?}, expected {expected:?}")]
    Shape {
        /// Name of the weight.
        name: String,
        /// Shape in the file.
        found: Vec<usize>,
        /// Shape in the model.
        expected: Vec<usize>,
    },
    /// A number is not finite.
    #[error("place the weight {0}: some of its numbers are not finite")]
    NotFinite(String),
}

/// All weights by name, sorted.
#[must_use]
pub fn weights(model: &Rprae) -> BTreeMap<String, NamedTensor> {
    struct Collect {
        path: Vec<String>,
        found: BTreeMap<String, NamedTensor>,
    }
    impl ModuleVisitor for Collect {
        fn enter_module(&mut self, name: &str, _: &str) {
            self.path.push(name.to_owned());
        }
        fn exit_module(&mut self, _: &str, _: &str) {
            self.path.pop();
        }
        fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
            let tensor = param.val();
            let shape = tensor.dims().to_vec();
            let values = tensor.into_data().iter().collect();
            self.found.insert(self.path.join("."), NamedTensor { shape, values });
        }
    }
    let mut collect = Collect { path: Vec::new(), found: BTreeMap::new() };
    model.visit(&mut collect);
    collect.found
}

/// Gradients of all weights that have one, by name, sorted.
#[must_use]
pub fn gradients(model: &Rprae, gradients: &Gradients) -> BTreeMap<String, NamedTensor> {
    struct Collect<'a> {
        path: Vec<String>,
        gradients: &'a Gradients,
        found: BTreeMap<String, NamedTensor>,
    }
    impl ModuleVisitor for Collect<'_> {
        fn enter_module(&mut self, name: &str, _: &str) {
            self.path.push(name.to_owned());
        }
        fn exit_module(&mut self, _: &str, _: &str) {
            self.path.pop();
        }
        fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
            if let Some(gradient) = param.val().grad(self.gradients) {
                let shape = gradient.dims().to_vec();
                let values = gradient.into_data().iter().collect();
                self.found.insert(self.path.join("."), NamedTensor { shape, values });
            }
        }
    }
    let mut collect = Collect { path: Vec::new(), gradients, found: BTreeMap::new() };
    model.visit(&mut collect);
    collect.found
}

/// The model with all its weights replaced.
///
/// # Errors
/// [`WeightsError`] names the first weight that does not fit.
pub fn load_weights(model: Rprae, weights: BTreeMap<String, NamedTensor>) -> Result<Rprae, WeightsError> {
    struct Place {
        path: Vec<String>,
        weights: BTreeMap<String, NamedTensor>,
        error: Option<WeightsError>,
    }
    impl Place {
        fn fitting(&mut self, expected: &[usize]) -> Result<NamedTensor, WeightsError> {
            let name = self.path.join(".");
            let Some(found) = self.weights.remove(&name) else { return Err(WeightsError::Missing(name)) };
            if found.shape != expected || found.values.len() != expected.iter().product::<usize>() {
                return Err(WeightsError::Shape { name, found: found.shape, expected: expected.to_vec() });
            }
            if !found.values.iter().all(|value| value.is_finite()) {
                return Err(WeightsError::NotFinite(name));
            }
            Ok(found)
        }
    }
    impl ModuleMapper for Place {
        fn enter_module(&mut self, name: &str, _: &str) {
            self.path.push(name.to_owned());
        }
        fn exit_module(&mut self, _: &str, _: &str) {
            self.path.pop();
        }
        fn map_float<const D: usize>(&mut self, param: Param<Tensor<D>>) -> Param<Tensor<D>> {
            match self.fitting(&param.lazy_shape()) {
                Ok(found) => {
                    let (id, tensor, mapper) = param.consume();
                    let data = TensorData::new(found.values, found.shape);
                    let loaded = Tensor::from_data(data, &tensor.device());
                    Param::from_mapped_value(id, loaded.set_require_grad(tensor.is_require_grad()), mapper)
                }
                Err(error) => {
                    self.error.get_or_insert(error);
                    param
                }
            }
        }
    }
    let mut place = Place { path: Vec::new(), weights, error: None };
    let model = model.map(&mut place);
    match (place.error, place.weights.pop_first()) {
        (Some(error), _) => Err(error),
        (None, Some((name, _))) => Err(WeightsError::Unknown(name)),
        (None, None) => Ok(model),
    }
}

/// Trained numbers of each part: retrofit layer, description and action autoencoder, length head, and trained vectors.
#[must_use]
pub fn num_parameters(model: &Rprae) -> Vec<(&'static str, usize)> {
    let all = model.retrofit.num_params();
    let layers = model.retrofit.num_layer_params();
    vec![
        ("retrofit layer", layers),
        ("description autoencoder", model.description.num_params()),
        ("action autoencoder", model.action.num_params()),
        ("word vectors", all - layers),
        ("length head", model.length.num_params()),
    ]
}
