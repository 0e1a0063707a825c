//! A module's parameters as named tensors, and safetensors files of such tensors.

use std::borrow::Cow;
use std::collections::{BTreeMap, HashMap};
use std::io::{self, Write};
use std::path::Path;

use burn::module::{Module, ModuleMapper, ModuleVisitor, Param};
use burn::tensor::{Tensor, TensorData};
use safetensors::tensor::{Dtype, SafeTensors, TensorView, View, serialize};

use crate::data::FeatureStats;
use crate::failure::FailureKind;
use crate::files::atomic::write_whole;
use crate::files::{ANY, FileError, read_regular};
use crate::motion::N_FEATURES;

/// A tensor on the host, row-major.
#[derive(Clone, Debug, PartialEq)]
pub struct HostTensor {
    pub shape: Vec<usize>,
    pub values: Vec<f32>,
}

/// Host tensors by name.
pub type Weights = BTreeMap<String, HostTensor>;

/// A tensor to be written, which comes to the host when its turn comes: a checkpoint takes the memory
/// of one tensor, not of all.
#[derive(Clone, Debug)]
pub enum Source {
    Host(HostTensor),
    Device { shape: Vec<usize>, flat: Box<Tensor<1>> },
}

/// Tensors to be written, by name.
pub type Sources = BTreeMap<String, Source>;

impl Source {
    /// A tensor of any device and number of dimensions.
    pub fn of<const D: usize>(tensor: Tensor<D>) -> Self {
        let shape = tensor.dims().to_vec();
        let n = shape.iter().product::<usize>();
        Self::Device { shape, flat: Box::new(tensor.reshape([n])) }
    }

    /// The tensor on the host.
    pub fn on_host(&self) -> HostTensor {
        HostTensor { shape: self.shape().to_vec(), values: self.values().into_owned() }
    }

    fn shape(&self) -> &[usize] {
        match self {
            Self::Host(HostTensor { shape, .. }) | Self::Device { shape, .. } => shape,
        }
    }

    fn values(&self) -> Cow<'_, [f32]> {
        match self {
            Self::Host(tensor) => Cow::Borrowed(&tensor.values),
            Self::Device { flat, .. } => {
                let values = Tensor::clone(flat).into_data().try_into_vec::<f32>();
                Cow::Owned(values.expect("parameters are f32"))
            }
        }
    }
}

/// Brings tensors to the host, all at once.
pub fn on_host(sources: &Sources) -> Weights {
    sources.iter().map(|(name, source)| (name.clone(), source.on_host())).collect()
}

/// Why weights could not be read or do not fit.
#[derive(Debug, thiserror::Error)]
pub enum WeightsError {
    /// Their file.
    #[error(transparent)]
    File(#[from] FileError),
    /// The module has a parameter that the weights lack, or of another shape.
    #[error("parameter {name} of shape {expected:?} is {found} in the weights")]
    Mismatch { name: String, expected: Vec<usize>, found: String },
}

impl WeightsError {
    /// The failure of a job that ends with it.
    pub fn failure_kind(&self) -> FailureKind {
        match self {
            Self::File(error) => error.failure_kind(),
            Self::Mismatch { .. } => FailureKind::Damaged,
        }
    }
}

// Parameters out of a module, and into one of the same structure.

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
    /// Tensors not yet assigned.
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
        let shape = tensor.dims();
        let tensor = match self.find(&shape) {
            None => tensor,
            Some(host) => {
                let new = Tensor::from_data(TensorData::new(host.values, shape), &tensor.device());
                if tensor.is_require_grad() { new.require_grad() } else { new }
            }
        };
        Param::from_mapped_value(id, tensor, mapper)
    }
}

// Safetensors files of weights, with a digest of their numbers.

/// The one metadata entry: the digest of the notes, then the notes in JSON. One, since the library writes several in
/// any order, and the same weights are the same file.
pub(super) const NOTES: &str = "notes";
/// The note with the digest of the numbers.
const DIGEST: &str = "digest";

fn signed(notes: &BTreeMap<String, String>) -> String {
    let text = serde_json::to_string(notes).expect("strings are JSON");
    blake3::hash(text.as_bytes()).to_hex().to_string() + &text
}

/// The notes of a file's entry [`NOTES`]; `None` if they are not those that were written.
pub(super) fn verified(text: &str) -> Option<BTreeMap<String, String>> {
    let (digest, notes) = text.split_at_checked(2 * blake3::OUT_LEN)?;
    let is_whole = blake3::hash(notes.as_bytes()).to_hex().as_str() == digest;
    is_whole.then(|| serde_json::from_str(notes).ok())?
}

fn digest<'a>(tensors: impl Iterator<Item = (&'a String, Cow<'a, [f32]>)>) -> String {
    let mut hasher = blake3::Hasher::new();
    for (name, values) in tensors {
        hasher.update(name.as_bytes()).update(bytemuck::cast_slice(&values));
    }
    hasher.finalize().to_hex().to_string()
}

/// Writes weights and text entries as one safetensors file, whole, by rename.
///
/// # Errors
/// [`FileError::Write`].
pub fn save(
    path: &Path,
    sources: &Sources,
    mut notes: BTreeMap<String, String>,
) -> Result<(), FileError> {
    let values = || sources.iter().map(|(name, source)| (name, source.values()));
    notes.insert(DIGEST.to_string(), digest(values()));
    let notes = HashMap::from([(NOTES.to_string(), signed(&notes))]);
    let lengths = sources.iter().map(|(name, source)| (name, Length(source)));
    let head = serialize(lengths, Some(notes))
        .map_err(|error| FileError::write(path)(io::Error::other(error)))?;
    write_whole(path, |file| {
        file.write_all(&head)?;
        values().try_for_each(|(_, values)| file.write_all(bytemuck::cast_slice(&values)))
    })
}

/// A tensor in the file's head, with its numbers after it: in the order of names, as safetensors stores tensors of one
/// type.
struct Length<'a>(&'a Source);

impl View for Length<'_> {
    fn dtype(&self) -> Dtype {
        Dtype::F32
    }

    fn shape(&self) -> &[usize] {
        self.0.shape()
    }

    fn data(&self) -> Cow<'_, [u8]> {
        Cow::Borrowed(&[])
    }

    fn data_len(&self) -> usize {
        size_of::<f32>() * self.shape().iter().product::<usize>()
    }
}

/// Reads a file of [`save`].
///
/// # Errors
/// [`FileError::Read`] and [`FileError::Damaged`].
pub fn load(path: &Path) -> Result<(Weights, BTreeMap<String, String>), FileError> {
    let bytes = read_regular(path, ANY).map_err(FileError::read(path))?;
    read(&bytes).map_err(|reason| FileError::damaged(path, reason))
}

fn read(bytes: &[u8]) -> Result<(Weights, BTreeMap<String, String>), String> {
    let (_, header) = SafeTensors::read_metadata(bytes).map_err(|error| error.to_string())?;
    let file = SafeTensors::deserialize(bytes).map_err(|error| error.to_string())?;
    let tensors = file.iter().map(|(name, view)| Ok((name.to_string(), host_tensor(name, &view)?)));
    let weights = tensors.collect::<Result<Weights, String>>()?;
    let entries = header.metadata().clone().unwrap_or_default();
    // Files of other programs have notes of their own.
    let mut notes = match entries.get(NOTES) {
        Some(text) => verified(text).ok_or("its notes are not those that were written")?,
        None => entries.into_iter().collect(),
    };
    let numbers = weights.iter().map(|(name, tensor)| (name, Cow::Borrowed(&tensor.values[..])));
    if notes.remove(DIGEST).is_some_and(|written| written != digest(numbers)) {
        return Err("its numbers are not those that were written".to_string());
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

// Statistics of features, and numbers, stored with the weights of a module that normalises by them.

const MEAN: &str = "stats.mean";
const STD: &str = "stats.std";

/// Adds statistics to weights before writing.
pub fn insert_stats(tensors: &mut Sources, stats: &FeatureStats) {
    insert(tensors, MEAN, stats.mean.clone());
    insert(tensors, STD, stats.std.clone());
}

fn insert(tensors: &mut Sources, name: &str, values: Vec<f32>) {
    let tensor = HostTensor { shape: vec![values.len()], values };
    tensors.insert(name.to_string(), Source::Host(tensor));
}

/// Removes them from weights after reading.
///
/// # Errors
/// [`WeightsError::Mismatch`] if they are missing, or features cannot be normalised by them.
pub fn take_stats(tensors: &mut Weights) -> Result<FeatureStats, WeightsError> {
    let mismatch = |name: &str, found: &str| WeightsError::Mismatch {
        name: name.to_string(),
        expected: vec![N_FEATURES],
        found: found.to_string(),
    };
    let mut vector = |name: &str| {
        let tensor = tensors.remove(name).ok_or_else(|| mismatch(name, "missing"))?;
        let sound = !tensor.values.is_empty() && tensor.values.iter().all(|x| x.is_finite());
        sound.then_some(tensor.values).ok_or_else(|| mismatch(name, "not of finite numbers"))
    };
    let (mean, std) = (vector(MEAN)?, vector(STD)?);
    if mean.len() != std.len() || std.iter().any(|x| *x <= 0.0) {
        return Err(mismatch(STD, "not a number above 0 for each mean"));
    }
    Ok(FeatureStats { mean, std })
}

/// Puts a number among the tensors, in single precision.
pub fn insert_number(tensors: &mut Sources, name: &str, number: f64) {
    insert(tensors, name, vec![number as f32]);
}

/// Takes a number out of weights that were read, as short as single precision writes it: 29.97 is not
/// 29.969999; `None` if it is not there.
pub fn take_number(tensors: &mut Weights, name: &str) -> Option<f64> {
    let number = *tensors.remove(name)?.values.first()?;
    number.to_string().parse().ok()
}

#[cfg(test)]
mod tests {
    use burn::nn::LinearConfig;
    use burn::tensor::Device;

    use super::*;

    #[test]
    fn weights_survive_a_file_and_fit_only_their_shape() {
        let device = Device::flex();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("w.safetensors");
        let module = LinearConfig::new(3, 5).init(&device);
        let weights = on_host(&of_module(&module));
        assert_eq!(weights["weight"].shape, [3, 5]);
        save(&path, &of_module(&module), BTreeMap::from([("step".into(), "12".into())])).unwrap();
        let (read, notes) = load(&path).unwrap();
        assert_eq!((read.clone(), notes["step"].as_str()), (weights.clone(), "12"));
        let other = into_module(LinearConfig::new(3, 5).init(&device), read.clone()).unwrap();
        assert_eq!(on_host(&of_module(&other)), weights);
        let error = into_module(LinearConfig::new(3, 4).init(&device), read).unwrap_err();
        assert!(error.to_string().contains("weight"), "{error}");
    }

    #[test]
    fn a_flipped_bit_is_found() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("w.safetensors");
        let tensor = HostTensor { shape: vec![2], values: vec![1.0, 2.0] };
        let notes = BTreeMap::from([("step".into(), "12".into())]);
        save(&path, &Sources::from([("gain".into(), Source::Host(tensor))]), notes).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        let note = bytes.windows(3).position(|three| three == br"12\").unwrap();
        for (place, what) in [(bytes.len() - 1, "numbers"), (note, "notes")] {
            let mut flipped = bytes.clone();
            flipped[place] ^= 1;
            std::fs::write(&path, flipped).unwrap();
            let error = load(&path).unwrap_err().to_string();
            assert!(error.contains(&format!("(its {what} are not")), "{error}");
        }
    }

    #[test]
    fn numbers_of_another_type_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("w.safetensors");
        let view = TensorView::new(Dtype::F64, vec![2], &[0; 16]).unwrap();
        std::fs::write(&path, serialize([("gain", view)], None).unwrap()).unwrap();
        let error = load(&path).unwrap_err().to_string();
        assert!(error.contains("(gain is F64"), "{error}");
    }

    #[test]
    fn an_empty_file_is_damaged_and_not_just_out_of_reach() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("w.safetensors");
        std::fs::write(&path, []).unwrap();
        let error = load(&path).unwrap_err();
        assert!(error.is_damage(), "{error}");
    }
}
