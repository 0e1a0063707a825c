//! Safetensors files that are nearly as they should be: their tensors change, and their heads tell the truth of it.

use std::collections::{HashMap, HashSet};

use isoflop::draws::{below, unit};
use rand_chacha::ChaCha8Rng;
use safetensors::tensor::{Dtype, SafeTensors, TensorView, serialize};

use crate::mutate;

/// A tensor by name.
struct Tensor {
    name: String,
    dtype: Dtype,
    shape: Vec<usize>,
    bytes: Vec<u8>,
}

/// What tells that a file was changed, in columns and in weights.
const DIGEST: &str = "digest";

/// A file made of accepted ones: of changed tensors, or, one of four, of changed bytes.
pub fn tensors(seeds: &[Vec<u8>], rng: &mut ChaCha8Rng) -> Vec<u8> {
    if below(rng, 4) == 0 {
        return mutate::binary(seeds, rng);
    }
    let seed = &seeds[below(rng, seeds.len())];
    let (_, head) = SafeTensors::read_metadata(seed).expect("a seed is sound");
    let mut notes = head.metadata().clone().unwrap_or_default();
    let mut all = read(seed);
    // Without a digest a file is another program's, and what it says is looked at.
    all.retain(|tensor| tensor.name != DIGEST);
    notes.remove(DIGEST);
    for _ in 0..mutate::changes(rng) {
        change(&mut all, &mut notes, rng);
    }
    written(&all, notes).unwrap_or_else(|| mutate::binary(seeds, rng))
}

fn read(bytes: &[u8]) -> Vec<Tensor> {
    let file = SafeTensors::deserialize(bytes).expect("a seed is sound");
    let mut all: Vec<Tensor> = (file.iter())
        .map(|(name, view)| Tensor {
            name: name.to_string(),
            dtype: view.dtype(),
            shape: view.shape().to_vec(),
            bytes: view.data().to_vec(),
        })
        .collect();
    all.sort_by(|a, b| a.name.cmp(&b.name));
    all
}

fn written(all: &[Tensor], notes: HashMap<String, String>) -> Option<Vec<u8>> {
    let names: HashSet<&String> = all.iter().map(|tensor| &tensor.name).collect();
    if names.len() < all.len() {
        return None;
    }
    let views = all.iter().map(|tensor| {
        let view = TensorView::new(tensor.dtype, tensor.shape.clone(), &tensor.bytes);
        view.ok().map(|view| (tensor.name.clone(), view))
    });
    serialize(views.collect::<Option<Vec<_>>>()?, Some(notes)).ok()
}

fn change(all: &mut Vec<Tensor>, notes: &mut HashMap<String, String>, rng: &mut ChaCha8Rng) {
    let mut names: Vec<String> = notes.keys().cloned().collect();
    names.sort();
    let kind = below(rng, 12);
    if all.is_empty() || (kind < 3 && !names.is_empty()) {
        let Some(name) = names.get(below(rng, names.len().max(1))) else { return };
        let text = mutate::text(&[notes[name].clone().into_bytes()], rng);
        notes.insert(name.clone(), String::from_utf8_lossy(&text).into_owned());
        return;
    }
    let (one, other) = (below(rng, all.len()), below(rng, all.len()));
    let tensor = &mut all[one];
    match kind {
        0..=6 => numbers(tensor, rng),
        7 => resize(tensor, rng),
        8 => reshape(tensor, rng),
        9 => tensor.dtype = of_width(tensor.dtype.bitsize(), rng),
        10 => drop(all.remove(one)),
        _ => {
            let name = std::mem::replace(&mut all[other].name, "a".to_string());
            let name = std::mem::replace(&mut all[one].name, name);
            all[other].name = if one == other { "b".to_string() } else { name };
        }
    }
}

/// Whole numbers, and the bits of numbers, that readers may stumble over.
const ODD: [u64; 14] = [
    0,
    1,
    2,
    3,
    4,
    255,
    1 << 31,
    u32::MAX as u64,
    1 << 32,
    1 << 62,
    u64::MAX - 1,
    u64::MAX,
    f32::NAN.to_bits() as u64,
    f32::INFINITY.to_bits() as u64,
];

/// Changes a number, or swaps two.
fn numbers(tensor: &mut Tensor, rng: &mut ChaCha8Rng) {
    let width = tensor.dtype.bitsize().div_ceil(8);
    let n = tensor.bytes.len() / width.max(1);
    if n == 0 {
        return;
    }
    let (one, other) = (below(rng, n) * width, below(rng, n) * width);
    let mut eight = [0u8; 8];
    let used = width.min(8);
    eight[..used].copy_from_slice(&tensor.bytes[one..one + used]);
    let before = u64::from_le_bytes(eight);
    let number = match below(rng, 5) {
        0 => before.wrapping_add(1),
        1 => before.wrapping_sub(1),
        2 => ODD[below(rng, ODD.len())],
        3 => u64::from((10f64.powf(80.0 * unit(rng) - 40.0) as f32).to_bits()),
        _ => {
            (0..width).for_each(|byte| tensor.bytes.swap(one + byte, other + byte));
            return;
        }
    };
    tensor.bytes[one..one + used].copy_from_slice(&number.to_le_bytes()[..used]);
}

/// More or fewer numbers along the first axis.
fn resize(tensor: &mut Tensor, rng: &mut ChaCha8Rng) {
    let Some(first) = tensor.shape.first().copied().filter(|n| *n > 0) else { return };
    let row = tensor.bytes.len() / first;
    let rows = match below(rng, 4) {
        0 => 0,
        1 => first - 1,
        2 => first + 1,
        _ => below(rng, 2 * first + 1),
    };
    tensor.shape[0] = rows;
    tensor.bytes.resize(rows * row, 0);
}

/// The same numbers along other axes.
fn reshape(tensor: &mut Tensor, rng: &mut ChaCha8Rng) {
    let n: usize = tensor.shape.iter().product();
    tensor.shape = match below(rng, 4) {
        0 => vec![n],
        1 => vec![n, 1],
        2 => vec![1, n],
        _ => tensor.shape.iter().rev().copied().collect(),
    };
}

/// A type of as many bits.
fn of_width(bits: usize, rng: &mut ChaCha8Rng) -> Dtype {
    let all = match bits {
        64 => [Dtype::F64, Dtype::I64, Dtype::U64],
        _ => [Dtype::F32, Dtype::I32, Dtype::U32],
    };
    all[below(rng, all.len())]
}
