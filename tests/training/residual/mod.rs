//! The masked transformer's second stage: what it sees.

pub mod learning;
mod sampling;

use burn::module::Module;
use burn::tensor::Device;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use crate::corpus::{D_TEXT, small_run};
use isoflop::codes::{Grid, Length, Scale};
use isoflop::generator::Network;
use isoflop::generator::masked::residual::{Asked, LayerBatch, Stages};
use isoflop::spec::RunSpec;
use isoflop::spec::{GeneratorSpec, MaskedSpec, Precision};

/// Codes of each layer, and layers.
const V: usize = 4;
const LAYERS: usize = 3;

/// A code for four frames in each layer.
fn grid() -> Grid {
    let scale = Scale { n_vocab: V, length: Length::FramesPerCode(4) };
    Grid { scales: vec![scale; LAYERS], end_token: false }
}

pub fn spec(text_drop: f64) -> RunSpec {
    let mut spec = small_run(V);
    let shape = spec.shape().clone();
    spec.generator = GeneratorSpec::Masked(MaskedSpec { shape, corruption: 0.0, text_drop });
    spec.codes = grid();
    spec
}

fn stages(spec: &RunSpec) -> Stages {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    Stages::init(spec.shape(), &spec.codes, Precision::F32, &mut rng, &Device::flex())
}

/// Two words.
fn text() -> Vec<f32> {
    (0..2 * D_TEXT).map(|i| (i as f32).sin()).collect()
}

/// Logits of the codes of a layer at every place of a clip.
fn logits(stages: &Stages, text: &[f32], codes: &[u32], layer: usize) -> Vec<f32> {
    let asked = Asked::of_clip(text, codes, LAYERS, layer, 0..codes.len() / LAYERS);
    let batch = LayerBatch::pack(&[asked], &grid(), D_TEXT);
    stages.residual.logits(&batch, layer).into_data().try_into_vec().expect("logits are f32")
}

#[test]
fn a_code_is_seen_by_later_layers_alone_and_there_by_every_place() {
    for tie_embeddings in [false, true] {
        let mut spec = spec(0.0);
        spec.generator.shape_mut().tie_embeddings = tie_embeddings;
        let stages = stages(&spec);
        let codes: Vec<u32> = (0..15).map(|i| (i * 7 % V) as u32).collect();
        for (place, layer) in (0..15).flat_map(|place| (1..LAYERS).map(move |l| (place, l))) {
            let mut other = codes.clone();
            other[place] = (other[place] + 1) % V as u32;
            let [before, after] = [&codes, &other].map(|c| logits(&stages, &text(), c, layer));
            let changed = before.chunks(V).zip(after.chunks(V)).filter(|(a, b)| a != b).count();
            let expected = if place / 5 < layer { 5 } else { 0 };
            assert_eq!(changed, expected, "code {place}, layer {layer}");
        }
    }
}

#[test]
fn what_stands_beside_a_clip_changes_nothing() {
    let (stages, text) = (stages(&spec(0.0)), text());
    let codes: Vec<u32> = (0..15).map(|i| (i * 5 % V) as u32).collect();
    let alone = logits(&stages, &text, &codes, 2);
    let one = Asked::of_clip(&text, &codes, LAYERS, 2, 0..5);
    let beside = Asked::of_clip(&text[..D_TEXT], &codes[..6], LAYERS, 1, 0..2);
    let batch = LayerBatch::pack(&[beside, one], &grid(), D_TEXT);
    let together = stages.residual.logits(&batch, 2).into_data();
    let together: Vec<f32> = together.try_into_vec().expect("logits are f32");
    let off = alone.iter().zip(&together).map(|(a, b)| (a - b).abs());
    assert!(off.fold(0.0, f32::max) < 1e-6);
}

#[test]
fn text_and_the_layer_that_is_asked_for_reach_every_place() {
    let stages = stages(&spec(0.0));
    let codes = vec![1; 15];
    let before = logits(&stages, &text(), &codes, 1);
    let other: Vec<f32> = text().iter().map(|x| -x).collect();
    let after = logits(&stages, &other, &codes, 1);
    assert!(before.iter().zip(&after).all(|(a, b)| a != b));
}

#[test]
fn the_parameters_that_are_planned_are_built() {
    for tie_embeddings in [false, true] {
        let mut spec = spec(0.0);
        spec.generator.shape_mut().tie_embeddings = tie_embeddings;
        spec.codes.scales.push(Scale { n_vocab: 7, length: Length::FramesPerCode(4) });
        assert_eq!(stages(&spec).weights().num_params(), spec.params().total());
    }
}
