//! A module's parameters as named host tensors, and safetensors files of such tensors.

use std::collections::{BTreeMap, HashMap};
use std::io::Write;
use std::path::Path;

use burn::module::{Module, ModuleMapper, ModuleVisitor, Param};
use burn::tensor::{Tensor, TensorData};
use safetensors::tensor::{Dtype, SafeTensors, TensorView, serialize};

use crate::record::atomic::write_whole;

/// A tensor on the host, row-major.
#[derive(Clone, Debug, PartialEq)]
pub struct HostTensor {
    pub shape: Vec<usize>,
    pub values: Vec<f32>,
}

impl HostTensor {
    /// The values of a tensor of any device.
    pub fn from_tensor<const D: usize>(tensor: Tensor<D>) -> Self {
        let shape = tensor.dims().to_vec();
        let values = tensor.into_data().try_into_vec::<f32>().expect("parameters are f32");
        Self { shape, values }
    }
}

/// Host tensors by name.
pub type Weights = BTreeMap<String, HostTensor>;

/// Why weights could not be read or do not fit.
#[derive(Debug, thiserror::Error)]
pub enum WeightsError {
    /// The file is missing, unreadable or not safetensors.
    #[error("cannot read {path}: {reason}")]
    Read { path: String, reason: String },
    /// The file could not be written.
    #[error("{reason}")]
    Write { reason: String },
    /// The module has a parameter that the weights lack, or of another shape.
    #[error("parameter {name} of shape {expected:?} is {found} in the weights")]
    Mismatch { name: String, expected: Vec<usize>, found: String },
}

/// All float parameters of a module, named by their path of fields: `blocks.0.qkv`.
pub fn of_module<M: Module>(module: &M) -> Weights {
    let mut reader = Reader { path: Vec::new(), weights: Weights::new() };
    module.visit(&mut reader);
    reader.weights
}

/// Puts weights into a module of the same structure.
pub fn into_module<M: Module>(module: M, weights: &Weights) -> Result<M, WeightsError> {
    let mut writer = Writer { path: Vec::new(), weights, mismatch: None };
    let module = module.map(&mut writer);
    match writer.mismatch {
        None => Ok(module),
        Some(mismatch) => Err(mismatch),
    }
}

/// The note that tells whether the numbers are those that were written.
const DIGEST: &str = "digest";

fn digest(weights: &Weights) -> String {
    let mut hasher = blake3::Hasher::new();
    for (name, tensor) in weights {
        hasher.update(name.as_bytes()).update(bytemuck::cast_slice(&tensor.values));
    }
    hasher.finalize().to_hex().to_string()
}

/// Writes weights and text entries as one safetensors file, whole, by rename.
pub fn save(
    path: &Path,
    weights: &Weights,
    notes: HashMap<String, String>,
) -> Result<(), WeightsError> {
    let failed = |reason: String| WeightsError::Write { reason };
    let notes =
        HashMap::from_iter(notes.into_iter().chain([(DIGEST.to_string(), digest(weights))]));
    let views = weights.iter().map(|(name, tensor)| {
        let bytes = bytemuck::cast_slice(&tensor.values);
        let view = TensorView::new(Dtype::F32, tensor.shape.clone(), bytes);
        (name, view.expect("shape and length agree"))
    });
    let bytes = serialize(views, Some(notes)).map_err(|error| failed(error.to_string()))?;
    write_whole(path, |file| file.write_all(&bytes)).map_err(|error| failed(error.to_string()))
}

/// Reads what [`save`] wrote.
pub fn load(path: &Path) -> Result<(Weights, HashMap<String, String>), WeightsError> {
    let failed = |reason: String| WeightsError::Read { path: path.display().to_string(), reason };
    let bytes = std::fs::read(path).map_err(|error| failed(error.to_string()))?;
    let (_, header) =
        SafeTensors::read_metadata(&bytes).map_err(|error| failed(error.to_string()))?;
    let file = SafeTensors::deserialize(&bytes).map_err(|error| failed(error.to_string()))?;
    let tensors = file.iter().map(|(name, view)| Ok((name.to_string(), host_tensor(name, &view)?)));
    let weights = tensors.collect::<Result<_, _>>().map_err(failed)?;
    let mut notes = header.metadata().clone().unwrap_or_default();
    // Files of older builds have no digest.
    if notes.remove(DIGEST).is_some_and(|written| written != digest(&weights)) {
        return Err(failed("its numbers are not those that were written".to_string()));
    }
    Ok((weights, notes))
}

fn host_tensor(name: &str, view: &TensorView) -> Result<HostTensor, String> {
    if view.dtype() != Dtype::F32 {
        return Err(format!("{name} is {:?}, only F32 is read", view.dtype()));
    }
    let values = view.data().chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]));
    Ok(HostTensor { shape: view.shape().to_vec(), values: values.collect() })
}

struct Reader {
    path: Vec<String>,
    weights: Weights,
}

impl ModuleVisitor for Reader {
    fn enter_module(&mut self, name: &str, _: &str) {
        self.path.push(name.to_string());
    }

    fn exit_module(&mut self, _: &str, _: &str) {
        self.path.pop();
    }

    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
        let tensor = HostTensor::from_tensor(param.val());
        self.weights.insert(self.path.join("."), tensor);
    }
}

struct Writer<'a> {
    path: Vec<String>,
    weights: &'a Weights,
    mismatch: Option<WeightsError>,
}

impl Writer<'_> {
    fn find(&mut self, expected: &[usize]) -> Option<&HostTensor> {
        let name = self.path.join(".");
        let found = self.weights.get(&name);
        match found {
            Some(tensor) if tensor.shape == expected => return found,
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

impl ModuleMapper for Writer<'_> {
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
    host: &HostTensor,
    shape: [usize; D],
    device: &burn::tensor::Device,
) -> Tensor<D> {
    let new = Tensor::from_data(TensorData::new(host.values.clone(), shape), device);
    if old.is_require_grad() { new.require_grad() } else { new }
}

#[cfg(test)]
mod tests {
    use super::*;
    use burn::nn::LinearConfig;
    use burn::tensor::Device;

    #[test]
    fn weights_survive_a_file_and_fit_only_their_shape() {
        let device = Device::flex();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("w.safetensors");
        let module = LinearConfig::new(3, 5).init(&device);
        let weights = of_module(&module);
        assert_eq!(weights["weight"].shape, [3, 5]);
        save(&path, &weights, HashMap::from([("step".into(), "12".into())])).unwrap();
        let (read, notes) = load(&path).unwrap();
        assert_eq!((read.clone(), notes["step"].as_str()), (weights.clone(), "12"));
        let other = into_module(LinearConfig::new(3, 5).init(&device), &read).unwrap();
        assert_eq!(of_module(&other), weights);
        let error = into_module(LinearConfig::new(3, 4).init(&device), &read).unwrap_err();
        assert!(error.to_string().contains("weight"), "{error}");
    }

    #[test]
    fn a_flipped_bit_is_found() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("w.safetensors");
        let tensor = HostTensor { shape: vec![2], values: vec![1.0, 2.0] };
        save(&path, &Weights::from([("gain".into(), tensor)]), HashMap::new()).unwrap();
        let mut bytes = std::fs::read(&path).unwrap();
        *bytes.last_mut().unwrap() ^= 1;
        std::fs::write(&path, bytes).unwrap();
        let error = load(&path).unwrap_err().to_string();
        assert!(error.contains("w.safetensors: its numbers are not"), "{error}");
    }

    #[test]
    fn numbers_of_another_type_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("w.safetensors");
        let view = TensorView::new(Dtype::F64, vec![2], &[0; 16]).unwrap();
        std::fs::write(&path, serialize([("gain", view)], None).unwrap()).unwrap();
        let error = load(&path).unwrap_err().to_string();
        assert!(error.contains("w.safetensors: gain is F64"), "{error}");
    }
}
