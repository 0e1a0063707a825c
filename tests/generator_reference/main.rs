//! Logits, loss and gradients of the scale-by-scale and the masked transformer, and the codes that
//! rounds of unmasking leave, against implementations in JAX and float64.
//!
//! `fixtures/generators/make.py` writes the numbers. It takes one clip at a time and masks densely where
//! the library packs clips and works by blocks. Parameters are exact in `f32`; what is left is the
//! library's rounding.

mod masked;
mod scalewise;

use std::path::PathBuf;

use burn::module::{Module, ModuleVisitor, Param};
use burn::optim::GradientsParams;
use burn::tensor::Tensor;
use serde::de::DeserializeOwned;

use isoflop::learn::weights::{self, HostTensor, Source, Weights};

/// Largest difference of two tensors, as a share of the reference's norm.
const TOLERANCE: f64 = 1e-5;

struct Reference<N> {
    notes: N,
    tensors: Weights,
}

impl<N: DeserializeOwned> Reference<N> {
    fn read(name: &str) -> Self {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/fixtures/generators");
        let path = PathBuf::from(folder).join(format!("{name}.safetensors"));
        let (tensors, notes) = weights::load(&path).expect("make.py wrote it");
        let notes = serde_json::from_str(&notes["reference"]).expect("make.py wrote them");
        Self { notes, tensors }
    }

    /// The tensors whose names start with `prefix`, without it.
    fn part(&self, prefix: &str) -> Weights {
        let named = self.tensors.iter().filter_map(|(name, tensor)| {
            Some((name.strip_prefix(prefix)?.to_owned(), tensor.clone()))
        });
        named.collect()
    }

    /// A drawn module with the reference's parameters, which must be all that it has.
    fn parameters<M: Module>(&self, drawn: M) -> M {
        let parameters = self.part("param.");
        assert!(weights::of_module(&drawn).keys().eq(parameters.keys()), "names differ");
        weights::into_module(drawn, parameters).expect("the same shapes")
    }

    /// The largest relative error over the logits and every gradient, which must be small.
    fn compare(&self, logits: HostTensor, gradients: &Weights, about: &str) {
        let expected = self.part("grad.");
        assert!(gradients.keys().eq(expected.keys()), "{:?}", gradients.keys());
        let mut errors = vec![("logits", relative_error(&logits, &self.tensors["logits"]))];
        errors.extend(gradients.iter().map(|(n, g)| (n.as_str(), relative_error(g, &expected[n]))));
        let (name, worst) = errors.iter().max_by(|a, b| a.1.total_cmp(&b.1)).expect("not empty");
        eprintln!("{about}: {name} is off by {worst:.1e} of its norm");
        assert!(*worst < TOLERANCE, "{about}: {name} is off by {worst:.1e}");
    }
}

/// |found − expected| / |expected|, with L2 norms over all elements.
fn relative_error(found: &HostTensor, expected: &HostTensor) -> f64 {
    assert_eq!(found.values.len(), expected.values.len());
    let norm = |values: &mut dyn Iterator<Item = f64>| values.map(|v| v * v).sum::<f64>().sqrt();
    let pairs = found.values.iter().zip(&expected.values);
    let difference = norm(&mut pairs.map(|(f, e)| f64::from(*f) - f64::from(*e)));
    difference / norm(&mut expected.values.iter().map(|e| f64::from(*e)))
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

fn gradients<M: Module>(loss: Tensor<1>, module: &M) -> Weights {
    let grads = GradientsParams::from_grads(loss.backward(), module);
    let mut visitor = Gradients { path: Vec::new(), grads: &grads, named: Weights::new() };
    module.visit(&mut visitor);
    visitor.named
}

fn close(found: f64, expected: f64) {
    assert!((found / expected - 1.0).abs() < TOLERANCE, "{found} against {expected}");
}

/// The values of matrices after one another.
fn concat(rows: impl IntoIterator<Item = Tensor<2>>) -> HostTensor {
    let values: Vec<f32> = rows.into_iter().flat_map(|x| Source::of(x).on_host().values).collect();
    HostTensor { shape: vec![values.len()], values }
}
