//! Tensors and notes that another implementation wrote, and how far from them the library's own lie.

use std::path::Path;

use burn::module::{Module, ModuleVisitor, Param};
use burn::optim::GradientsParams;
use burn::tensor::Tensor;
use serde::de::DeserializeOwned;

use isoflop::learn::weights::{self, HostTensor, Source, Weights};

/// Largest difference of two tensors, as a share of the reference's norm.
pub const TOLERANCE: f64 = 1e-5;

/// A file of reference values.
pub struct Reference<N> {
    pub notes: N,
    pub tensors: Weights,
}

impl<N: DeserializeOwned> Reference<N> {
    /// The file `name` of a folder of fixtures.
    pub fn read(folder: &str, name: &str) -> Self {
        let fixtures = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/fixtures"));
        let path = fixtures.join(folder).join(format!("{name}.safetensors"));
        let (tensors, notes) = weights::load(&path).expect("make.py wrote it");
        let notes = serde_json::from_str(&notes["reference"]).expect("make.py wrote them");
        Self { notes, tensors }
    }

    /// The tensors whose names start with `prefix`, without it.
    pub fn part(&self, prefix: &str) -> Weights {
        let named = self.tensors.iter().filter_map(|(name, tensor)| {
            Some((name.strip_prefix(prefix)?.to_owned(), tensor.clone()))
        });
        named.collect()
    }

    /// A drawn module with the reference's parameters, which must be all that it has.
    pub fn parameters<M: Module>(&self, drawn: M) -> M {
        let parameters = self.part("param.");
        assert!(weights::of_module(&drawn).keys().eq(parameters.keys()), "names differ");
        weights::into_module(drawn, parameters).expect("the same shapes")
    }

    /// The largest relative error over the logits and every gradient, which must be small.
    pub fn compare(&self, logits: &HostTensor, gradients: &Weights, about: &str) {
        let expected = self.part("grad.");
        assert!(gradients.keys().eq(expected.keys()), "{:?}", gradients.keys());
        let mut errors = vec![("logits", relative_error(logits, &self.tensors["logits"]))];
        errors.extend(gradients.iter().map(|(n, g)| (n.as_str(), relative_error(g, &expected[n]))));
        let (name, worst) = errors.iter().max_by(|a, b| a.1.total_cmp(&b.1)).expect("not empty");
        eprintln!("{about}: {name} is off by {worst:.1e} of its norm");
        assert!(*worst < TOLERANCE, "{about}: {name} is off by {worst:.1e}");
    }
}

/// |found − expected| / |expected|, with L2 norms over all elements.
pub fn relative_error(found: &HostTensor, expected: &HostTensor) -> f64 {
    assert_eq!(found.shape, expected.shape);
    let norm = |values: &mut dyn Iterator<Item = f64>| values.map(|v| v * v).sum::<f64>().sqrt();
    let pairs = found.values.iter().zip(&expected.values);
    let difference = norm(&mut pairs.map(|(f, e)| f64::from(*f) - f64::from(*e)));
    difference / norm(&mut expected.values.iter().map(|e| f64::from(*e)))
}

/// The gradient by every parameter of a module, which all must have one.
pub fn gradients<M: Module>(loss: Tensor<1>, module: &M) -> Weights {
    let grads = GradientsParams::from_grads(loss.backward(), module);
    let mut visitor = Gradients { path: Vec::new(), grads: &grads, named: Weights::new() };
    module.visit(&mut visitor);
    visitor.named
}

/// Gradients under the names of their parameters.
struct Gradients<'a> {
    path: Vec<String>,
    grads: &'a GradientsParams,
    named: Weights,
}

impl ModuleVisitor for Gradients<'_> {
    fn enter_module(&mut self, name: &str, _: &str) {
        self.path.push(name.to_owned());
    }

    fn exit_module(&mut self, _: &str, _: &str) {
        self.path.pop();
    }

    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
        let name = self.path.join(".");
        let grad = self.grads.get::<D>(param.id);
        let grad = grad.unwrap_or_else(|| panic!("{name} has no gradient"));
        self.named.insert(name, Source::of(grad).on_host());
    }
}
