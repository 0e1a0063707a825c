//! Which codes a run is trained on, in which order, and at which rate.

use std::collections::{HashMap, HashSet};

use isoflop::data::Split;
use isoflop::generator::autoregressive::{Batch, Part, TokenStream};
use isoflop::generator::learning_rate;
use isoflop::spec::{RunSpec, Share, ShownCaptions};

use super::corpus::{Corpus, small_run};
use super::numbered::{EPOCH_TOKENS, numbered_corpus};

const END: u32 = 40;

/// Each target of a batch with the code before it, or none after the text.
fn targets(batch: &Batch) -> Vec<(Option<u32>, u32)> {
    let n_text = batch.order.len() - batch.codes.len();
    let before = |&row: &u32| {
        let source = batch.order[row as usize] as usize;
        source.checked_sub(n_text).map(|code| batch.codes[code])
    };
    batch.target_rows.iter().map(before).zip(batch.targets.iter().copied()).collect()
}

/// How often each target is met in an epoch, counted in the corpus.
fn counts_of_corpus(corpus: &Corpus) -> HashMap<(Option<u32>, u32), usize> {
    let mut counts = HashMap::new();
    for clip in 0..8 {
        let codes = corpus.tokens.clip(Split::Train, clip);
        let before = std::iter::once(None).chain(codes.iter().copied().map(Some));
        let after = codes.iter().copied().chain([END]);
        before.zip(after).for_each(|pair| *counts.entry(pair).or_default() += 1);
    }
    counts
}

#[test]
fn an_epoch_supervises_every_target_once() {
    let corpus = numbered_corpus();
    let mut stream = TokenStream::new(&corpus.tokens, &corpus.text, 9);
    assert_eq!(stream.epoch_tokens(), EPOCH_TOKENS);
    // Seven does not divide the epoch: 48 batches of it are 7 epochs.
    let met: Vec<_> =
        (0..EPOCH_TOKENS).flat_map(|step| targets(&stream.batch(7 * step, 7))).collect();
    assert_eq!(met.len(), 7 * EPOCH_TOKENS);
    let expected = counts_of_corpus(&corpus);
    for epoch in met.chunks(EPOCH_TOKENS) {
        let mut counts = HashMap::new();
        epoch.iter().for_each(|target| *counts.entry(*target).or_default() += 1);
        assert_eq!(counts, expected);
    }
    assert_ne!(met[..EPOCH_TOKENS], met[EPOCH_TOKENS..2 * EPOCH_TOKENS], "epochs are shuffled");
}

#[test]
fn an_epoch_of_a_share_is_a_part_of_the_clips() {
    let clips = vec![vec![1, 2, 3]; 64];
    let captions = |clip| vec![format!("clip {clip}")];
    let corpus = Corpus::new(40, [clips.clone(), clips.clone(), clips], captions);
    let met = |share: f64| {
        let share = Share::new(share).expect("a share");
        let mut stream = TokenStream::new(&corpus.tokens, &corpus.text, 9).over(share);
        let n = stream.epoch_tokens();
        assert_eq!(n, corpus.tokens.training_targets(share));
        let mut clips = |from| stream.parts(from, n).into_iter().map(|part| part.clip);
        let [first, second]: [HashSet<usize>; 2] = [0, n].map(|from| clips(from).collect());
        assert_eq!(first, second, "each epoch has the same clips");
        first
    };
    let [quarter, half, all] = [0.25, 0.5, 1.0].map(met);
    assert_eq!([quarter.len(), half.len(), all.len()], [16, 32, 64]);
    assert!(quarter.is_subset(&half));
}

/// All that a batch says, as text.
fn written(batch: &Batch) -> String {
    format!("{batch:?}")
}

#[test]
fn a_batch_does_not_depend_on_what_was_asked_before() {
    let corpus = numbered_corpus();
    let stream = |seed| TokenStream::new(&corpus.tokens, &corpus.text, seed);
    let mut forwards = stream(9);
    let batches: Vec<_> = (0..30).map(|i| written(&forwards.batch(13 * i, 13))).collect();
    let mut backwards = stream(9);
    for i in (0..30).rev() {
        backwards.batch(1000 - i, 3);
        assert_eq!(written(&backwards.batch(13 * i, 13)), batches[i], "batch {i}");
    }
    let mut other = stream(10);
    let others: Vec<_> = (0..30).map(|i| written(&other.batch(13 * i, 13))).collect();
    assert_ne!(others, batches, "the seed shuffles");
}

#[test]
fn a_batch_longer_than_an_epoch_goes_on_into_the_next() {
    let corpus = numbered_corpus();
    let mut stream = TokenStream::new(&corpus.tokens, &corpus.text, 9);
    let long = targets(&stream.batch(11, 2 * EPOCH_TOKENS));
    let short = (0..2 * EPOCH_TOKENS).flat_map(|i| targets(&stream.batch(11 + i, 1)));
    assert_eq!(long, short.collect::<Vec<_>>());
}

#[test]
fn the_rate_warms_up_in_equal_steps_and_decays_along_a_cosine() {
    let spec = RunSpec { steps: 110, warmup_steps: 10, lr: 0.02, final_share: 0.1, ..small_run(9) };
    let rates: Vec<f64> = (0..=spec.steps).map(|step| learning_rate(&spec, step)).collect();
    let close = |a: f64, b: f64| (a - b).abs() < 1e-15;
    assert!(rates.iter().all(|rate| (0.0..=spec.lr).contains(rate)));
    assert!(rates[0] > 0.0 && rates[10] == spec.lr, "the first step moves, the peak is reached");
    assert!(rates[..=10].windows(3).all(|r| close(r[1] - r[0], r[2] - r[1])), "{rates:?}");
    assert!(rates[10..].windows(2).all(|r| r[1] < r[0]), "{rates:?}");
    // Half a cosine is odd about its middle, and a third of the way it has lost a quarter.
    assert!((0..=100).all(|i| close(rates[10 + i] + rates[110 - i], 1.1 * spec.lr)), "{rates:?}");
    let thirds = RunSpec { steps: 100, ..spec };
    assert!(close(learning_rate(&thirds, 40), 0.02 * (0.1 + 0.9 * 0.75)));
}

#[test]
fn a_wsd_rate_stays_at_its_peak_until_it_decays() {
    let spec = RunSpec {
        steps: 110,
        warmup_steps: 10,
        lr: 0.02,
        final_share: 0.1,
        decay_steps: Some(25),
        ..small_run(9)
    };
    let rates: Vec<f64> = (0..=spec.steps).map(|step| learning_rate(&spec, step)).collect();
    let close = |a: f64, b: f64| (a - b).abs() < 1e-15;
    assert!(rates[..=10].windows(2).all(|r| r[1] > r[0]), "{rates:?}");
    assert!(rates[10..=85].iter().all(|rate| *rate == spec.lr), "{rates:?}");
    assert!(rates[85..].windows(2).all(|r| r[1] < r[0]), "{rates:?}");
    // 1 − √(1/25), 1 − √(9/25), and the final share.
    for (step, height) in [(86, 0.8), (94, 0.4), (110, 0.0)] {
        assert!(close(rates[step], 0.02 * (0.1 + 0.9 * height)), "{rates:?}");
    }
    let trunk = spec.trunk().expect("it decays");
    assert_eq!(trunk.steps, 85);
    assert!((0..85).all(|step| learning_rate(&trunk, step) == rates[step]));
}

#[test]
fn without_warm_up_the_rate_starts_at_its_peak() {
    let spec = RunSpec { warmup_steps: 0, ..small_run(9) };
    assert_eq!(learning_rate(&spec, 0), spec.lr);
    assert!(learning_rate(&spec, 1) < spec.lr);
}

/// Captions of each clip of the published batches.
const CAPTIONS: [usize; 8] = [1, 2, 3, 1, 2, 1, 3, 2];

/// `docs/custom-trainer.md` promises these batches to other trainers; the torch trainer is tested by the same.
#[test]
fn batches_are_those_that_are_published() {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("python/tests/batches.json");
    let text = std::fs::read_to_string(path).expect("the file is there");
    let published: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    let list = |value: &serde_json::Value| -> Vec<usize> {
        serde_json::from_value(value.clone()).expect("whole numbers")
    };
    assert_eq!(list(&published["captions"]), CAPTIONS);
    let clips: Vec<Vec<u32>> = list(&published["codes"]).into_iter().map(|n| vec![0; n]).collect();
    let captions = |clip| (0..CAPTIONS[clip]).map(|i| format!("{clip} {i}")).collect();
    let corpus = Corpus::new(40, [clips.clone(), clips.clone(), clips], captions);
    let seed = published["seed"].as_u64().expect("a seed");
    let mut stream = TokenStream::new(&corpus.tokens, &corpus.text, seed);
    let n = published["batch_tokens"].as_u64().expect("a number") as usize;
    for (step, parts) in published["steps"].as_array().expect("steps").iter().enumerate() {
        let found = stream.parts(step * n, n).into_iter();
        let found: Vec<Vec<usize>> = found
            .map(|part| {
                vec![part.clip, part.caption as usize, part.targets.start, part.targets.end]
            })
            .collect();
        assert_eq!(serde_json::json!(found), *parts, "step {step}");
    }
}

/// `tokenizer::encode` holds that codes are made with caption i mod n of clip i.
#[test]
fn matched_captions_are_those_that_codes_were_made_with_and_the_clips_are_the_same() {
    let clips = vec![vec![1, 2, 3]; 8];
    let captions = |clip| (0..CAPTIONS[clip]).map(|i| format!("{clip} {i}")).collect();
    let corpus = Corpus::new(40, [clips.clone(), clips.clone(), clips], captions);
    let text = &corpus.text;
    let parts = |captions| {
        let mut stream = TokenStream::new(&corpus.tokens, text, 9).showing(captions);
        stream.parts(0, 5 * stream.epoch_tokens())
    };
    let (drawn, matched) = (parts(ShownCaptions::Drawn), parts(ShownCaptions::Matched));
    let own = |clip: usize| text.captions(Split::Train, clip)[clip % CAPTIONS[clip]];
    assert!(matched.iter().all(|part| part.caption == own(part.clip)));
    assert!(drawn.iter().any(|part| part.caption != own(part.clip)));
    let place = |parts: &[Part]| -> Vec<_> {
        parts.iter().map(|part| (part.clip, part.targets.clone())).collect()
    };
    assert_eq!(place(&drawn), place(&matched));
    let written = serde_json::to_string(&small_run(9)).expect("plain values");
    assert!(!written.contains("captions"), "ids of runs that draw captions know no such field");
}
