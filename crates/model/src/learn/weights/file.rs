//! Safetensors files of weights, with a digest of their numbers.

use std::borrow::Cow;
use std::collections::HashMap;
use std::fs::File;
use std::io::{self, Write};
use std::path::Path;

use memmap2::Mmap;
use safetensors::tensor::{Dtype, SafeTensors, TensorView, View, serialize};

use crate::files::FileError;
use crate::files::atomic::write_whole;
use crate::learn::weights::{HostTensor, Source, Sources, Weights};

/// The note that tells whether the numbers are those that were written.
const DIGEST: &str = "digest";

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
    mut notes: HashMap<String, String>,
) -> Result<(), FileError> {
    let values = || sources.iter().map(|(name, source)| (name, source.values()));
    notes.insert(DIGEST.to_string(), digest(values()));
    let lengths = sources.iter().map(|(name, source)| (name, Length(source)));
    let head = serialize(lengths, Some(notes))
        .map_err(|error| FileError::write(path)(io::Error::other(error)))?;
    write_whole(path, |file| {
        file.write_all(&head)?;
        values().try_for_each(|(_, values)| file.write_all(bytemuck::cast_slice(&values)))
    })
}

/// A tensor of which the file's head tells, and whose numbers are written behind it: in the order of
/// names, as safetensors has those of one type.
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

/// Reads what [`save`] wrote.
///
/// # Errors
/// [`FileError::Read`] and [`FileError::Damaged`].
pub fn load(path: &Path) -> Result<(Weights, HashMap<String, String>), FileError> {
    let file = File::open(path).map_err(FileError::read(path))?;
    // SAFETY: such files are put in place by rename and never written again, so the mapped bytes do
    // not change while they are read.
    let bytes = unsafe { Mmap::map(&file) }.map_err(FileError::read(path))?;
    read(&bytes).map_err(|reason| FileError::damaged(path, reason))
}

fn read(bytes: &[u8]) -> Result<(Weights, HashMap<String, String>), String> {
    let (_, header) = SafeTensors::read_metadata(bytes).map_err(|error| error.to_string())?;
    let file = SafeTensors::deserialize(bytes).map_err(|error| error.to_string())?;
    let tensors = file.iter().map(|(name, view)| Ok((name.to_string(), host_tensor(name, &view)?)));
    let weights = tensors.collect::<Result<Weights, String>>()?;
    let mut notes = header.metadata().clone().unwrap_or_default();
    let numbers = weights.iter().map(|(name, tensor)| (name, Cow::Borrowed(&tensor.values[..])));
    // Files of other programs have no digest.
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
