//! Motions by rounds and layers.

use std::ops::Range;

use burn::tensor::Device;

use super::{LAYERS, V, logits, spec, stages, text};
use crate::corpus::D_TEXT;
use crate::no_scales::NoScales;
use isoflop::generator::masked::{Hidden, pack};
use isoflop::generator::{self, Draw, Network, Prompt, Sampled, Sampling};
use isoflop::learn::weights;
use isoflop::spec::RunSpec;

/// Motions of a model that was never trained: of several lengths, with texts of one word and of two.
fn sampled(spec: &RunSpec, sampling: &Sampling, seed: u64) -> Vec<Sampled> {
    let loaded = weights::on_host(&weights::of_module(stages(spec).weights()));
    let sampler = generator::of(spec).sampler(spec, loaded, &Device::flex()).unwrap();
    let long = text();
    let prompt = |(index, n_frames)| Prompt {
        text: &long[..D_TEXT * (1 + index as usize % 2)],
        n_frames: Some(n_frames),
        seed,
        index,
        edit: None,
    };
    let prompts: Vec<Prompt> = [(0, 20), (1, 8), (2, 4), (3, 22)].map(prompt).into();
    sampler.sample(&prompts, &NoScales, sampling).unwrap()
}

#[test]
fn layer_after_layer_the_likeliest_codes_are_those_of_a_whole_pass() {
    let spec = spec(0.1);
    let draw = Draw { temperature: 0.0, ..Draw::default() };
    let made = sampled(&spec, &Sampling { draw, rounds: 1, ..Sampling::default() }, 1);
    let stages = stages(&spec);
    let best = |row: &[f32]| (0..V).max_by(|&a, &b| row[a].total_cmp(&row[b])).unwrap() as u32;
    for (index, motion) in made.iter().enumerate() {
        let (text, codes) = (&text()[..D_TEXT * (1 + index % 2)], &motion.codes);
        let n = codes.len() / LAYERS;
        let of = |layer: usize| -> Range<usize> { layer * n..(layer + 1) * n };
        let all = (0..n).map(|place| (place, 0)).collect();
        let hidden = Hidden { text, shown: vec![V as u32; n], targets: all };
        let first = stages.base.logits(&pack(&[hidden], D_TEXT)).into_data();
        let first: Vec<f32> = first.try_into_vec().unwrap();
        let expected: Vec<u32> = first.chunks(V + 1).map(best).collect();
        assert_eq!(codes[of(0)], expected);
        for layer in 1..LAYERS {
            let rows = logits(&stages, text, codes, layer);
            let expected: Vec<u32> = rows.chunks(V).map(best).collect();
            assert_eq!(codes[of(layer)], expected, "layer {layer} of motion {index}");
        }
    }
}

#[test]
fn motions_have_the_length_that_was_asked_for_and_repeat() {
    let spec = spec(0.1);
    for rounds in [1, 3, 50] {
        let sampling = Sampling { rounds, guidance: 2.0, ..Sampling::default() };
        let made = sampled(&spec, &sampling, 1);
        let sizes: Vec<_> = made.iter().map(|one| (one.codes.len(), one.n_frames)).collect();
        assert_eq!(sizes, [(15, 20), (6, 8), (3, 4), (15, 20)]);
        assert!(made.iter().flat_map(|one| &one.codes).all(|&code| code < V as u32));
        assert_eq!(made, sampled(&spec, &sampling, 1));
        assert_ne!(made, sampled(&spec, &sampling, 2));
        assert_ne!(made, sampled(&spec, &Sampling { guidance: 0.0, ..sampling }, 1));
    }
}
