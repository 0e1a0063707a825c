//! Parameters out of a module, and into one of the same structure.

use burn::module::{Module, ModuleMapper, ModuleVisitor, Param};
use burn::tensor::{Device, Tensor, TensorData};

use crate::learn::weights::{HostTensor, Source, Sources, Weights, WeightsError};

/// All float parameters of a module, named by their path of fields: `blocks.0.qkv`.
pub fn of_module<M: Module>(module: &M) -> Sources {
    let mut reader = Reader { path: Vec::new(), sources: Sources::new() };
    module.visit(&mut reader);
    reader.sources
}

/// Moves weights into a module of the same structure.
pub fn into_module<M: Module>(module: M, weights: Weights) -> Result<M, WeightsError> {
    let mut writer = Writer { path: Vec::new(), weights, mismatch: None };
    let module = module.map(&mut writer);
    writer.mismatch.map_or(Ok(module), Err)
}

struct Reader {
    path: Vec<String>,
    sources: Sources,
}

impl ModuleVisitor for Reader {
    fn enter_module(&mut self, name: &str, _: &str) {
        self.path.push(name.to_string());
    }

    fn exit_module(&mut self, _: &str, _: &str) {
        self.path.pop();
    }

    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
        self.sources.insert(self.path.join("."), Source::of(param.val()));
    }
}

struct Writer {
    path: Vec<String>,
    /// Those that have not found their place yet.
    weights: Weights,
    mismatch: Option<WeightsError>,
}

impl Writer {
    fn find(&mut self, expected: &[usize]) -> Option<HostTensor> {
        let name = self.path.join(".");
        match self.weights.remove(&name) {
            Some(tensor) if tensor.shape == expected => return Some(tensor),
            Some(tensor) => self.reject(name, expected, format!("of shape {:?}", tensor.shape)),
            None => self.reject(name, expected, "missing".to_string()),
        }
        None
    }

    fn reject(&mut self, name: String, expected: &[usize], found: String) {
        let mismatch = WeightsError::Mismatch { name, expected: expected.to_vec(), found };
        self.mismatch.get_or_insert(mismatch);
    }
}

impl ModuleMapper for Writer {
    fn enter_module(&mut self, name: &str, _: &str) {
        self.path.push(name.to_string());
    }

    fn exit_module(&mut self, _: &str, _: &str) {
        self.path.pop();
    }

    fn map_float<const D: usize>(&mut self, param: Param<Tensor<D>>) -> Param<Tensor<D>> {
        let (id, tensor, mapper) = param.consume();
        let (shape, device) = (tensor.dims(), tensor.device());
        let tensor = match self.find(&shape) {
            Some(host) => replace(&tensor, host, shape, &device),
            None => tensor,
        };
        Param::from_mapped_value(id, tensor, mapper)
    }
}

/// A tensor of `host`'s values on `device`, tracked for gradients where `old` was.
fn replace<const D: usize>(
    old: &Tensor<D>,
    host: HostTensor,
    shape: [usize; D],
    device: &Device,
) -> Tensor<D> {
    let new = Tensor::from_data(TensorData::new(host.values, shape), device);
    if old.is_require_grad() { new.require_grad() } else { new }
}
