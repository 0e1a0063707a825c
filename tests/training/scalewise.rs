//! The scale-by-scale transformer: what it sees, what it learns, and that it makes what it says.

use burn::tensor::Device;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

use crate::corpus::{Clips, Corpus, D_TEXT, small_run};
use crate::trained::train;
use isoflop::codes::{CodeHistogram, Grid, Length, Scale};
use isoflop::data::Split;
use isoflop::generator::scalewise::{Batch, Clip, Model};
use isoflop::generator::{self, Draw, Edit, Inputs, Prompt, Sampling, ScaleInputs};
use isoflop::learn::weights::{self, Weights};
use isoflop::spec::RunSpec;
use isoflop::spec::{GeneratorSpec, Precision, ScalewiseSpec};

/// Codes of each scale, and scales.
const V: usize = 4;
const SCALES: usize = 3;

/// A code for four frames on each scale.
fn grid() -> Grid {
    let scale = Scale { n_vocab: V, length: Length::FramesPerCode(4) };
    Grid { scales: vec![scale; SCALES], end_token: false }
}

/// Shows a scale which codes the scales before it have at its place, one by one.
struct OneHot;

impl ScaleInputs for OneHot {
    fn inputs(&self, codes: &[u32], n_clips: usize, n_frames: usize) -> Vec<Vec<f32>> {
        let (latents, of_clip) = (n_frames / 4, codes.len() / n_clips);
        let shown = (of_clip / latents).min(SCALES - 1);
        let mut inputs = vec![vec![0.0; n_clips * latents * V * SCALES]; shown];
        for (clip, codes) in codes.chunks_exact(of_clip).enumerate() {
            for (scale, input) in inputs.iter_mut().enumerate() {
                for (place, &code) in codes[..(scale + 1) * latents].iter().enumerate() {
                    let row = clip * latents + place % latents;
                    input[row * V * SCALES + place / latents * V + code as usize] = 1.0;
                }
            }
        }
        inputs
    }
}

pub fn spec(change: impl FnOnce(&mut ScalewiseSpec)) -> RunSpec {
    let mut spec = small_run(V);
    let mut own = ScalewiseSpec {
        shape: spec.shape().clone(),
        d_latent: V * SCALES,
        frames_per_latent: 4,
        most_latents: 6,
        corruption: 0.0,
        text_drop: 0.1,
    };
    own.shape.n_ctx = 6 + SCALES * 6;
    change(&mut own);
    spec.generator = GeneratorSpec::Scalewise(own);
    spec.codes = grid();
    spec
}

fn own(spec: &RunSpec) -> &ScalewiseSpec {
    let GeneratorSpec::Scalewise(own) = &spec.generator else { panic!("as made above") };
    own
}

fn model(spec: &RunSpec) -> Model {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    Model::init(own(spec), &spec.codes, Precision::F32, &mut rng, &Device::flex())
}

/// −ln p of `codes` by scale, where the scales are shown `shown`.
fn nll(model: &Model, text: &[f32], codes: &[u32], shown: &[u32]) -> Vec<Vec<f64>> {
    let latents = codes.len() / SCALES;
    let clip = Clip {
        text,
        codes,
        lengths: vec![latents; SCALES],
        inputs: OneHot.inputs(shown, 1, 4 * latents),
        length: latents,
        supervised: 0..codes.len(),
    };
    let losses = model.nll(&Batch::pack(&[clip], &grid(), D_TEXT, model.places()));
    losses.into_iter().map(|scale| scale.nats).collect()
}

fn text() -> Vec<f32> {
    (0..2 * D_TEXT).map(|i| (i as f32).sin()).collect()
}

#[test]
fn a_code_is_seen_by_later_scales_alone() {
    let model = model(&spec(|_| {}));
    let codes: Vec<u32> = (0..15).map(|i| (i * 7 % V) as u32).collect();
    let before = nll(&model, &text(), &codes, &codes);
    for place in 0..15 {
        let mut shown = codes.clone();
        shown[place] = (shown[place] + 1) % V as u32;
        let after = nll(&model, &text(), &codes, &shown);
        let changed: Vec<bool> = before.iter().zip(&after).map(|(a, b)| a != b).collect();
        let expected: Vec<bool> = (0..SCALES).map(|scale| scale > place / 5).collect();
        assert_eq!(changed, expected, "code {place}");
    }
}

#[test]
fn text_and_length_reach_every_scale() {
    let model = model(&spec(|_| {}));
    let codes = vec![1; 15];
    let before = nll(&model, &text(), &codes, &codes);
    let other: Vec<f32> = text().iter().map(|x| -x).collect();
    let after = nll(&model, &other, &codes, &codes);
    assert!(before.iter().flatten().zip(after.iter().flatten()).all(|(a, b)| a != b));
}

/// Captions of two words.
fn captions(clip: usize) -> Vec<String> {
    vec![format!("caption {}", clip % 2)]
}

/// A source whose first codes are drawn at random, and each later one mostly repeats the one below it;
/// with each clip −ln p of its codes, in nats.
fn source(n_clips: usize, seed: u64) -> (Clips, f64) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut draw = |weights: [f64; V]| {
        let mut left = (rng.next_u32() as f64 + 0.5) / 2f64.powi(32);
        let code = weights.iter().position(|p| {
            left -= p;
            left < 0.0
        });
        let code = code.unwrap_or(V - 1);
        (code, -weights[code].ln())
    };
    let mut nats = 0.0;
    let clips = (0..n_clips).map(|clip| {
        let latents = 3 + clip % 4;
        let mut codes: Vec<u32> = Vec::new();
        for place in 0..SCALES * latents {
            let mut weights = [0.5, 0.25, 0.125, 0.125];
            if place >= latents {
                weights = [0.1; V];
                weights[codes[place - latents] as usize] = 0.7;
            }
            let (code, own) = draw(weights);
            codes.push(code as u32);
            nats += own;
        }
        codes
    });
    let clips: Clips = clips.collect();
    let n = clips.iter().map(Vec::len).sum::<usize>();
    (clips, nats / n as f64)
}

/// What a run over the corpus learns from.
pub fn inputs(corpus: &Corpus) -> Inputs<'_> {
    Inputs { scales: Some(&OneHot), ..corpus.inputs() }
}

/// A corpus of the source, and what the source itself has on the test split.
pub fn corpus(n_train: usize) -> (Corpus, f64) {
    let [(train, _), (val, _), (test, nats)] =
        [(n_train, 1), (10, 2), (200, 3)].map(|(n, seed)| source(n, seed));
    (Corpus::of_grid(&grid(), [train, val, test], captions), nats)
}

#[test]
fn the_loss_of_the_source_itself_is_reached() {
    let (corpus, nats) = corpus(3000);
    let mut spec = spec(|own| own.text_drop = 0.0);
    (spec.steps, spec.batch_tokens, spec.lr, spec.warmup_steps) = (250, 600, 0.01, 20);
    let test = train(&spec, &inputs(&corpus)).unwrap().test;
    let off = test.loss_nats - nats;
    assert!((-0.01..0.03).contains(&off), "{} of the source {nats}", test.loss_nats);
    assert_eq!(test.normalised_by_scale.len(), SCALES);
    // The first scale is drawn from its unigram; the others are told by the one below.
    let [first, second, _] = test.normalised_by_scale[..] else { panic!("three scales") };
    assert!(first.abs() < 0.03 && second < -0.2, "{:?}", test.normalised_by_scale);
    // The likeliest code of the first scale is always 0, and of the others the true one below.
    let tokens = &corpus.tokens;
    let used = |scale| {
        let clips =
            (0..tokens.n_clips(Split::Test)).flat_map(|i| tokens.scale(Split::Test, i, scale));
        CodeHistogram::new(V, clips).exponential_entropy()
    };
    let expected = [1.0, used(0), used(1)];
    let found = test.likeliest_exponential_entropy;
    let off = found.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(found.len() == SCALES && off < 0.02, "{found:?} for {expected:?}");
}

/// Clips of the longest length, four a step, after the longest text: two words and the end.
#[test]
fn the_flops_that_are_planned_are_done() {
    let (latents, n_text) = (6, 3);
    let clip = |i: usize| (0..SCALES * latents).map(|j| ((i + j * j) % V) as u32).collect();
    let clips: Clips = (0..12).map(clip).collect();
    let corpus = Corpus::of_grid(&grid(), [clips.clone(), clips.clone(), clips], captions);
    let mut spec = spec(|own| own.text_drop = 0.0);
    (spec.batch_tokens, spec.steps) = (4 * SCALES * latents, 5);
    let planned = spec.generator.flops_per_token(&spec.codes, n_text).exact;
    let done = train(&spec, &inputs(&corpus)).unwrap().flops_exact;
    let off = done / (3.0 * planned * spec.tokens() as f64) - 1.0;
    assert!(off.abs() < 1e-9, "{done}: off by {off}");
}

#[test]
fn training_again_gives_the_same_bits() {
    let (corpus, _) = corpus(40);
    let spec = spec(|own| own.corruption = 0.5);
    let [a, b] =
        [(); 2].map(|()| weights::on_host(&train(&spec, &inputs(&corpus)).unwrap().weights));
    assert_eq!(a, b);
}

fn weights_of(model: &Model) -> Weights {
    weights::on_host(&weights::of_module(&model.weights))
}

/// Motions of a model that was never trained: of two lengths, with captions of two.
fn sampled(spec: &RunSpec, sampling: &Sampling) -> Vec<Vec<u32>> {
    let model = model(spec);
    let sampler = generator::of(spec).sampler(spec, weights_of(&model), &Device::flex()).unwrap();
    let long = text();
    let orders = [(&long[..D_TEXT], 24), (&long[..], 16), (&long[..], 26)];
    let prompt = |(index, (text, frames))| Prompt {
        text,
        n_frames: Some(frames),
        seed: 1,
        index: index as u64,
        edit: None,
    };
    let prompts: Vec<Prompt> = orders.into_iter().enumerate().map(prompt).collect();
    let made = sampler.sample(&prompts, &OneHot, sampling).unwrap();
    assert_eq!(made.iter().map(|one| one.n_frames).collect::<Vec<_>>(), [24, 16, 24]);
    made.into_iter().map(|one| one.codes).collect()
}

#[test]
fn scale_after_scale_the_likeliest_codes_are_those_of_a_whole_pass() {
    let spec = spec(|_| {});
    let draw = Draw { temperature: 0.0, ..Draw::default() };
    let made = sampled(&spec, &Sampling { draw, ..Sampling::default() });
    let model = model(&spec);
    for (codes, text) in made.iter().zip([&text()[..D_TEXT], &text(), &text()]) {
        let likelihoods: Vec<Vec<f64>> = (0..V as u32)
            .map(|code| nll(&model, text, &vec![code; codes.len()], codes).concat())
            .collect();
        for (place, &code) in codes.iter().enumerate() {
            let best =
                (0..V).min_by(|&a, &b| likelihoods[a][place].total_cmp(&likelihoods[b][place]));
            assert_eq!(best, Some(code as usize), "code {place} of {codes:?}");
        }
    }
}

#[test]
fn motions_repeat_and_guidance_changes_them() {
    let spec = spec(|_| {});
    let free = Sampling::default();
    assert_eq!(sampled(&spec, &free), sampled(&spec, &free));
    assert_ne!(sampled(&spec, &free), sampled(&spec, &Sampling { guidance: 4.0, ..free }));
}

/// Guidance of strength s gives c + s (c − u); where s is next to nothing, that is the pass with text.
#[test]
fn guidance_0_is_the_pass_with_text() {
    let with = |guidance| sampled(&spec(|_| {}), &Sampling { guidance, ..Sampling::default() });
    assert_eq!(with(1e-12), with(0.0));
}

/// A clip of six latents, made anew in its third and fourth.
#[test]
fn an_edit_keeps_what_lies_outside_of_it() {
    let spec = spec(|_| {});
    let (model, text) = (model(&spec), text());
    let sampler = generator::of(&spec).sampler(&spec, weights_of(&model), &Device::flex()).unwrap();
    let codes: Vec<u32> = (0..18).map(|i| i * 5 % V as u32).collect();
    let made = |anew: [bool; 6], index, guidance| {
        let edit = Some(Edit { codes: &codes, anew: &anew });
        let prompt = Prompt { text: &text, n_frames: Some(24), seed: 1, index, edit };
        let whole = Prompt { edit: None, ..prompt };
        let sampling = Sampling { guidance, ..Sampling::default() };
        let made = sampler.sample(&[prompt, whole], &OneHot, &sampling).unwrap();
        [0, 1].map(|i| made[i].codes.clone())
    };
    let anew = [false, false, true, true, false, false];
    let mut differs = [false; 18];
    for index in 0..20 {
        let [edited, _] = made(anew, index, f64::from(index as u32 % 2));
        differs.iter_mut().zip(edited.iter().zip(&codes)).for_each(|(d, (a, b))| *d |= a != b);
        let [all, whole] = made([true; 6], index, 0.0);
        assert_eq!(all, whole);
        assert_eq!(made([false; 6], index, 0.0)[0], codes);
    }
    assert_eq!(differs[..], [anew; SCALES].concat()[..]);
}
