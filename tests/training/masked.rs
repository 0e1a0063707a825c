//! The masked transformer: what it sees, what it learns, and that it makes motions of a length.

use burn::tensor::Device;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

use crate::corpus::{Clips, Corpus, D_TEXT, small_run};
use crate::no_scales::NoScales;
use crate::trained::train;
use isoflop::codes::Grid;
use isoflop::generator::masked::Hidden;
use isoflop::generator::{self, Edit, GeneratorError, Prompt, Sampled, Sampling};
use isoflop::learn::weights;
use isoflop::spec::RunSpec;
use isoflop::spec::{GeneratorSpec, MaskedSpec};

/// Codes.
const V: usize = 4;

pub fn spec(text_drop: f64) -> RunSpec {
    let mut spec = small_run(V);
    let shape = spec.shape().clone();
    spec.generator = GeneratorSpec::Masked(MaskedSpec { shape, corruption: 0.0, text_drop });
    spec
}

/// A chain in which a code mostly repeats the one before it; and −ln p of a code, in nats.
fn source(n_clips: usize, seed: u64) -> (Clips, f64) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut nats = 0.0;
    let clips = (0..n_clips).map(|clip| {
        let mut codes: Vec<u32> = Vec::new();
        for place in 0..4 + clip % 3 {
            let other = rng.next_u32() % V as u32;
            let repeats = place > 0 && rng.next_u32() % 4 != 0;
            let code = if repeats { codes[place - 1] } else { other };
            let p = match place {
                0 => 0.25,
                _ if codes[place - 1] == code => 0.75 + 0.0625,
                _ => 0.0625,
            };
            nats -= f64::ln(p);
            codes.push(code);
        }
        codes
    });
    let clips: Clips = clips.collect();
    let n = clips.iter().map(Vec::len).sum::<usize>();
    (clips, nats / n as f64)
}

fn captions(clip: usize) -> Vec<String> {
    vec![format!("caption {}", clip % 2)]
}

/// A corpus of the source, and what the source itself has on the test split.
pub fn corpus(n_train: usize) -> (Corpus, f64) {
    let [(train, _), (val, _), (test, nats)] =
        [(n_train, 1), (10, 2), (400, 3)].map(|(n, seed)| source(n, seed));
    (Corpus::of_grid(&Grid::stream(V, 4), [train, val, test], captions), nats)
}

#[test]
fn a_hidden_code_is_not_shown() {
    let hide = |codes: &[u32]| Hidden::some(&[], codes, 3, V, &mut ChaCha8Rng::seed_from_u64(2));
    let one = hide(&[0, 1, 2, 3, 0, 1]);
    let hidden: Vec<usize> = one.targets.iter().map(|(place, _)| *place).collect();
    assert_eq!(hidden.len(), 3);
    let mut other = [0, 1, 2, 3, 0, 1];
    hidden.iter().for_each(|&place| other[place] = (other[place] + 1) % V as u32);
    let other = hide(&other);
    assert_eq!(one.shown, other.shown);
    assert!(one.targets.iter().zip(&other.targets).all(|(a, b)| a.0 == b.0 && a.1 != b.1));
}

#[test]
fn the_bound_lies_above_the_loss_of_the_source_and_near_it() {
    let (corpus, nats) = corpus(4000);
    let mut spec = spec(0.0);
    (spec.steps, spec.batch_tokens, spec.lr, spec.warmup_steps) = (400, 400, 0.01, 20);
    let test = train(&spec, &corpus.inputs()).unwrap().test;
    let off = test.loss_nats - nats;
    assert!((0.0..0.08).contains(&off), "{} of the source {nats}", test.loss_nats);
    assert_eq!(test.targets, corpus.tokens.n_tokens(isoflop::data::Split::Test));
}

#[test]
fn training_again_gives_the_same_bits() {
    let (corpus, _) = corpus(40);
    let [a, b] =
        [(); 2].map(|()| weights::on_host(&train(&spec(0.1), &corpus.inputs()).unwrap().weights));
    assert_eq!(a, b);
}

fn sampled(spec: &RunSpec, sampling: &Sampling) -> Result<Vec<Sampled>, GeneratorError> {
    let (corpus, _) = corpus(400);
    let trained = train(spec, &corpus.inputs()).unwrap();
    let loaded = weights::on_host(&trained.weights);
    let sampler = generator::of(spec).sampler(spec, loaded, &Device::flex())?;
    let text = [0.5; 2 * D_TEXT];
    let prompt = |(index, n_frames)| Prompt {
        text: &text[..D_TEXT * (1 + index as usize % 2)],
        n_frames: Some(n_frames),
        seed: 1,
        index,
        edit: None,
    };
    let prompts: Vec<Prompt> = [(0, 20), (1, 8), (2, 4), (3, 22)].map(prompt).into();
    sampler.sample(&prompts, &NoScales, sampling)
}

#[test]
fn motions_have_the_length_that_was_asked_for_and_repeat() {
    let spec = spec(0.1);
    for rounds in [1, 3, 50] {
        let sampling = Sampling { rounds, guidance: 2.0, ..Sampling::default() };
        let made = sampled(&spec, &sampling).unwrap();
        let sizes: Vec<_> = made.iter().map(|one| (one.codes.len(), one.n_frames)).collect();
        assert_eq!(sizes, [(5, 20), (2, 8), (1, 4), (5, 20)]);
        assert!(made.iter().flat_map(|one| &one.codes).all(|&code| code < V as u32));
        assert_eq!(made, sampled(&spec, &sampling).unwrap());
    }
}

#[test]
fn guidance_without_dropped_captions_is_refused() {
    let sampling = Sampling { guidance: 1.0, ..Sampling::default() };
    let error = sampled(&spec(0.0), &sampling).unwrap_err().to_string();
    assert!(error.contains("every caption") && error.contains("model.text_drop"), "{error}");
}

/// Guidance of strength s gives c + s (c − u); where s is next to nothing, that is the pass with text.
#[test]
fn guidance_0_is_the_pass_with_text() {
    let spec = spec(0.1);
    let with = |guidance| sampled(&spec, &Sampling { guidance, ..Sampling::default() }).unwrap();
    assert_eq!(with(1e-12), with(0.0));
}

/// A clip of six codes, made anew in its third and fourth.
#[test]
fn an_edit_keeps_what_lies_outside_of_it() {
    let spec = spec(0.1);
    let (corpus, _) = corpus(40);
    let loaded = weights::on_host(&train(&spec, &corpus.inputs()).unwrap().weights);
    let sampler = generator::of(&spec).sampler(&spec, loaded, &Device::flex()).unwrap();
    let (codes, text) = ([3, 0, 3, 2, 1, 1], [0.5; 2 * D_TEXT]);
    let made = |anew: [bool; 6], index, rounds| {
        let edit = Some(Edit { codes: &codes, anew: &anew });
        let prompt = Prompt { text: &text, n_frames: Some(24), seed: 1, index, edit };
        let whole = Prompt { edit: None, ..prompt };
        let sampling = Sampling { rounds, ..Sampling::default() };
        let made = sampler.sample(&[prompt, whole], &NoScales, &sampling).unwrap();
        [0, 1].map(|i| made[i].codes.clone())
    };
    let anew = [false, false, true, true, false, false];
    let mut differs = [false; 6];
    for index in 0..40 {
        let [edited, _] = made(anew, index, 1 + index as usize % 3);
        differs.iter_mut().zip(edited.iter().zip(&codes)).for_each(|(d, (a, b))| *d |= a != b);
        let [all, whole] = made([true; 6], index, 3);
        assert_eq!(all, whole);
    }
    assert_eq!(differs, anew);
}
