//! What both stages learn, on which bits, and at what price.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

use super::{LAYERS, V, grid, spec};
use crate::corpus::{Clips, Corpus};
use crate::trained::train;
use isoflop::codes::CodeHistogram;
use isoflop::data::Split;
use isoflop::learn::weights;
use isoflop::spec::RunSpec;

/// A source of three layers: of the first a code mostly repeats the one before it, of the second mostly
/// the first layer's next, and of the third the sum of both layers below. With each clip −ln p of the
/// codes of each layer, in nats.
fn source(n_clips: usize, seed: u64) -> (Clips, [f64; LAYERS]) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut nats = [0.0; LAYERS];
    let mut clip = |n: usize| {
        let mut codes: Vec<u32> = Vec::new();
        for (layer, place) in (0..LAYERS).flat_map(|layer| (0..n).map(move |place| (layer, place)))
        {
            let likely = match (layer, place) {
                (0, 0) => None,
                (0, _) => Some(codes[place - 1]),
                (1, _) => Some(codes[(place + 1) % n]),
                _ => Some((codes[place] + codes[n + place]) % V as u32),
            };
            let other = rng.next_u32() % V as u32;
            let code = likely.filter(|_| rng.next_u32() % 4 != 0).unwrap_or(other);
            nats[layer] -= match likely {
                None => f64::ln(0.25),
                Some(likely) if likely == code => f64::ln(0.75 + 0.0625),
                Some(_) => f64::ln(0.0625),
            };
            codes.push(code);
        }
        codes
    };
    let clips = (0..n_clips).map(|index| clip(4 + index % 3)).collect();
    (clips, nats)
}

/// Captions of two words.
fn captions(clip: usize) -> Vec<String> {
    vec![format!("caption {}", clip % 2)]
}

/// A corpus of the source, and what the source itself has on the test split.
pub fn corpus(n_train: usize) -> (Corpus, [f64; LAYERS]) {
    let [(train, _), (val, _), (test, nats)] =
        [(n_train, 1), (10, 2), (400, 3)].map(|(n, seed)| source(n, seed));
    (Corpus::of_grid(&grid(), [train, val, test], captions), nats)
}

/// L_u of the source itself on the test split, by layer.
fn normalised(corpus: &Corpus, nats: [f64; LAYERS]) -> [f64; LAYERS] {
    let tokens = &corpus.tokens;
    std::array::from_fn(|layer| {
        let unigram = tokens.unigram_log_probs(layer);
        let clips = (0..tokens.n_clips(Split::Test)).map(|i| tokens.scale(Split::Test, i, layer));
        let codes: Vec<u32> = clips.flatten().copied().collect();
        let of_unigram: f64 = codes.iter().map(|&code| unigram[code as usize]).sum();
        (nats[layer] + of_unigram) / codes.len() as f64
    })
}

/// Exponential entropy of the likeliest codes of the third layer by the source itself.
fn of_sums(corpus: &Corpus) -> f64 {
    let of = |clip, layer| corpus.tokens.scale(Split::Test, clip, layer).iter();
    let sums = |clip| of(clip, 0).zip(of(clip, 1)).map(|(a, b)| (a + b) % V as u32);
    let likeliest: Vec<u32> = (0..corpus.tokens.n_clips(Split::Test)).flat_map(sums).collect();
    CodeHistogram::new(V, &likeliest).exponential_entropy()
}

#[test]
fn later_layers_reach_the_source_and_the_first_is_bounded() {
    let (corpus, nats) = corpus(4000);
    let mut spec = spec(0.0);
    (spec.steps, spec.batch_tokens, spec.lr, spec.warmup_steps) = (500, 800, 0.01, 20);
    let test = train(&spec, &corpus.inputs()).unwrap().test;
    let expected = normalised(&corpus, nats);
    let found = &test.normalised_by_scale;
    let off: Vec<f64> = found.iter().zip(expected).map(|(a, b)| a - b).collect();
    assert!(expected[1..].iter().all(|nats| *nats < -0.4), "layers tell of others: {expected:?}");
    assert!((0.0..0.08).contains(&off[0]), "{off:?}");
    let [_, _, last] = test.likeliest_exponential_entropy[..] else { panic!("three layers") };
    assert!((last - of_sums(&corpus)).abs() < 0.02, "{last} for {}", of_sums(&corpus));
    assert!(off[1..].iter().all(|off| (-0.01..0.05).contains(off)), "{off:?}");
    let n = corpus.tokens.n_tokens(Split::Test);
    let whole = test.loss_nats - nats.iter().sum::<f64>() / n as f64;
    assert!((0.0..0.05).contains(&whole), "{whole} above the source");
    assert_eq!(test.targets, n);
    assert!((whole - off.iter().sum::<f64>() / LAYERS as f64).abs() < 1e-9, "layers are alike");
}

#[test]
fn training_again_gives_the_same_bits() {
    let (corpus, _) = corpus(40);
    let [a, b] =
        [(); 2].map(|()| weights::on_host(&train(&spec(0.1), &corpus.inputs()).unwrap().weights));
    assert_eq!(a, b);
}

/// A step of one token has one stage alone.
#[test]
fn steps_of_any_size_train() {
    let (corpus, _) = corpus(6);
    for batch_tokens in [1, 2, 3] {
        let spec = RunSpec { batch_tokens, steps: 40, ..spec(0.1) };
        let trained = train(&spec, &corpus.inputs()).unwrap();
        assert!(trained.test.loss_nats < 2.0 * (V as f64).ln(), "{:?}", trained.test);
    }
}

/// Clips of the longest length, four a step, after the longest text: two words and the end.
#[test]
fn the_flops_that_are_planned_are_done() {
    let (n_places, n_text) = (6, 3);
    let clip = |i: usize| (0..LAYERS * n_places).map(|j| ((i + j * j) % V) as u32).collect();
    let clips: Clips = (0..12).map(clip).collect();
    let corpus = Corpus::of_grid(&grid(), [clips.clone(), clips.clone(), clips], captions);
    let mut spec = RunSpec { batch_tokens: 2 * 4 * n_places, steps: 5, ..spec(0.0) };
    spec.generator.shape_mut().n_ctx = n_text + n_places;
    let done = train(&spec, &corpus.inputs()).unwrap().flops_exact;
    let tokens = spec.tokens() as f64;
    let planned = 3.0 * tokens * spec.generator.flops_per_token(&spec.codes, n_text).exact;
    // The plan has a head for every code of the first layer, of which training hides a part.
    let heads = 3.0 * tokens / 2.0 * 2.0 * (spec.shape().d_model * (V + 1)) as f64;
    let shown = (planned - done) / heads;
    assert!((0.1..0.6).contains(&shown), "{done} of {planned}: {shown} of the heads");
    let rows = shown * tokens / 2.0;
    assert!((rows - rows.round()).abs() < 1e-6, "nothing else differs: {rows} heads");
}

#[test]
fn a_clip_takes_a_position_a_place() {
    let (corpus, _) = corpus(40);
    let fits = |n_ctx: usize| {
        let mut spec = RunSpec { steps: 1, ..spec(0.1) };
        spec.generator.shape_mut().n_ctx = n_ctx;
        train(&spec, &corpus.inputs()).map(|_| ()).map_err(|error| error.to_string())
    };
    // Two words, the end, and six places.
    assert_eq!(fits(9), Ok(()));
    let error = fits(8).unwrap_err();
    assert!(error.contains("takes 9 positions") && error.contains("by 1"), "{error}");
}
