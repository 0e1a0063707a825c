//! Losses, bits, resumed trainings, and refused trainings.

use std::ops::ControlFlow;

use super::*;
use crate::data::Split;
use crate::motion::N_FEATURES;
use crate::progress::Step;
use crate::spec::{
    CodebookKind, LanguagePlace, Plateau, QuantizerKind, QuantizerSection, QuantizerSpec, ScaleSpec,
};
use crate::tokenizer::reconstruct;
use crate::tokenizer::testing::{
    D_TEXT, Waves, fixed_spec, patch_spec, small_spec, spec_of, text_of, transformer_spec,
};

/// Patches use the places of joints among the features, convolutions do not.
fn source_of(spec: &TokenizerSpec) -> Waves {
    let n_features = if spec.architecture.has_relative_heights() { N_FEATURES } else { 9 };
    Waves::new(&[40, 24, 32, 16], n_features)
}

/// Every kind; scales use one convolution with this mix, or two with ReLU.
fn quantizers(mix: f64) -> Vec<QuantizerSpec> {
    let single = [QuantizerSpec::Fsq { levels: vec![5, 3] }, QuantizerSpec::Vq { n_vocab: 64 }];
    let kinds = [QuantizerKind::Residual, QuantizerKind::Multiscale];
    let several = kinds.into_iter().flat_map(|kind| {
        [CodebookKind::Vq, CodebookKind::Fsq].map(|inner| {
            let mut section = QuantizerSection { inner: Some(inner), ..kind.section() };
            match kind {
                QuantizerKind::Residual => section.layers = Some(2),
                _ => {
                    section.scales = Some(ScaleSpec::List(vec![1, 2, 4]));
                    section.mix = Some(mix);
                }
            }
            section.of_size(16).expect("a size that both have")
        })
    });
    single.into_iter().chain(several).collect()
}

/// As architectures have it by default.
const CONVOLUTIONAL_MIX: f64 = 0.0;
const PATCH_MIX: f64 = 0.5;

/// Every architecture with every quantizer.
fn specs(steps: usize) -> impl Iterator<Item = TokenizerSpec> {
    let convolutional =
        quantizers(CONVOLUTIONAL_MIX).into_iter().map(move |quantizer| spec_of(quantizer, steps));
    let patches =
        quantizers(PATCH_MIX).into_iter().map(move |quantizer| patch_spec(quantizer, steps));
    convolutional.chain(patches).chain(transformers(steps)).chain([fixed_spec(64, steps)])
}

/// Transformers that see captions nowhere, at both halves, and with several scales at one.
fn transformers(steps: usize) -> [TokenizerSpec; 3] {
    let all = quantizers(CONVOLUTIONAL_MIX);
    let places: [&[LanguagePlace]; 3] = [&[], &BOTH, &BOTH[1..]];
    let chosen = [&all[0], &all[1], &all[4]];
    std::array::from_fn(|i| transformer_spec(places[i], chosen[i].clone(), steps))
}

const BOTH: [LanguagePlace; 2] = [LanguagePlace::Tokenizer, LanguagePlace::Detokenizer];

fn losses(spec: &TokenizerSpec) -> (Tokenizer, Vec<f64>) {
    let mut losses = Vec::new();
    let source = source_of(spec);
    let mut progress = |done: Step| {
        losses.push(done.loss);
        ControlFlow::Continue(())
    };
    let text = text_of(&source, D_TEXT);
    let corpus = Corpus { source: &source, text: Some(&text) };
    let tokenizer = train(spec, &corpus, &Device::flex(), None, &mut progress).unwrap();
    (tokenizer, losses)
}

#[test]
fn training_lowers_the_loss_with_every_quantizer() {
    let several = |quantizer: &QuantizerSpec| quantizer.codebooks().len() > 1;
    let of = |mix: f64, wanted: bool| {
        quantizers(mix).into_iter().filter(move |quantizer| several(quantizer) == wanted)
    };
    let convolutional =
        [QuantizerSpec::Fsq { levels: vec![5, 5] }, QuantizerSpec::Vq { n_vocab: 16 }];
    let convolutional = convolutional.into_iter().chain(of(CONVOLUTIONAL_MIX, true));
    let convolutional = convolutional.map(|quantizer| (spec_of(quantizer, 80), 0.7));
    // Patches start close to their optimum.
    let patches = of(PATCH_MIX, false).map(|quantizer| (patch_spec(quantizer, 80), 0.95));
    // The output of a scale's FSQ starts far from the latents, and the decoder is untrained.
    let scales = of(PATCH_MIX, true).map(|quantizer| (patch_spec(quantizer, 240), 0.85));
    let transformers = transformers(80).into_iter().map(|spec| (spec, 0.85));
    for (spec, share) in convolutional.chain(patches).chain(scales).chain(transformers) {
        let (_, losses) = losses(&spec);
        let mean = |part: &[f64]| part.iter().sum::<f64>() / part.len() as f64;
        let (first, last) = (mean(&losses[..10]), mean(&losses[losses.len() - 10..]));
        assert!(last < share * first, "{first} to {last}: {spec:?}");
    }
}

#[test]
fn the_same_seed_gives_the_same_bits_and_another_seed_others() {
    for spec in specs(6) {
        let bits = |spec: &TokenizerSpec| {
            let folder = tempfile::tempdir().unwrap();
            losses(spec).0.save(folder.path()).unwrap();
            std::fs::read(folder.path().join("weights.safetensors")).unwrap()
        };
        let mut other = spec.clone();
        other.training.seed = 1;
        assert_eq!(bits(&spec), bits(&spec));
        assert_ne!(bits(&spec), bits(&other));
    }
}

#[test]
fn fixed_codes_stay_and_learned_ones_move_while_both_decoders_learn() {
    let of = |spec: TokenizerSpec| {
        let (tokenizer, losses) = losses(&spec);
        let clip = source_of(&spec).clip(0, 0);
        let ids = tokenizer.encode(&clip, None).unwrap();
        (ids, losses[losses.len() - 10..].iter().sum::<f64>() / 10.0)
    };
    let learned = |steps| of(patch_spec(QuantizerSpec::Vq { n_vocab: 64 }, steps));
    let fixed = |steps| of(fixed_spec(64, steps));
    let ((begun, first), (trained, last)) = (fixed(10), fixed(160));
    assert_eq!(begun, trained);
    assert!(last < 0.95 * first, "{first} to {last}");
    let ((begun, first), (trained, last)) = (learned(10), learned(160));
    assert_ne!(begun, trained);
    assert!(last < 0.95 * first, "{first} to {last}");
}

#[test]
fn training_stops_when_it_is_told_to() {
    let source = Waves::new(&[40], 3);
    let mut progress = |done: Step| match done.step {
        2 => ControlFlow::Break(()),
        _ => ControlFlow::Continue(()),
    };
    let result =
        train(&small_spec(), &Corpus::wordless(&source), &Device::flex(), None, &mut progress);
    assert!(matches!(result, Err(TokenizerError::Learn(LearnError::Stopped { step: 2, .. }))));
}

#[test]
fn a_resumed_training_ends_on_the_same_bits() {
    let watched = TokenizerSpec {
        plateau: Some(Plateau { evaluations: 9, patience: 9 }),
        ..patch_spec(QuantizerSpec::Vq { n_vocab: 64 }, 9)
    };
    for spec in specs(9).chain([watched]) {
        let folder = tempfile::tempdir().unwrap();
        let bits = |tokenizer: Tokenizer| {
            tokenizer.save(folder.path()).unwrap();
            std::fs::read(folder.path().join("weights.safetensors")).unwrap()
        };
        let straight = bits(losses(&spec).0);
        let source = source_of(&spec);
        let text = text_of(&source, D_TEXT);
        let corpus = Corpus { source: &source, text: Some(&text) };
        let path = folder.path().join("checkpoint.safetensors");
        let every = std::time::Duration::from_secs(3600);
        let checkpoints = Some(&Checkpoints { path: &path, every, branch: None });
        let mut seen = Vec::new();
        for stop_at in [3, 4, 7] {
            let mut progress = |Step { step, .. }| {
                seen.push(step);
                if step == stop_at { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
            };
            let ended = train(&spec, &corpus, &Device::flex(), checkpoints, &mut progress);
            assert!(matches!(ended, Err(TokenizerError::Learn(LearnError::Stopped { .. }))));
        }
        let mut progress = |_| ControlFlow::Continue(());
        let resumed = train(&spec, &corpus, &Device::flex(), checkpoints, &mut progress);
        assert_eq!(seen, [1, 2, 3, 4, 5, 6, 7], "no step is done twice");
        assert!(bits(resumed.unwrap()) == straight, "{spec:?}");
    }
}

/// Steps taken, validation results, and the validation error of the kept weights.
fn watched(lr: f64, plateau: Plateau) -> (usize, Vec<Validated>, f64) {
    let mut spec = patch_spec(QuantizerSpec::Vq { n_vocab: 64 }, 60);
    spec.plateau = Some(plateau);
    spec.training.lr = lr;
    let source = source_of(&spec);
    let mut steps = 0;
    let mut progress = |done: Step| {
        steps = done.step;
        ControlFlow::Continue(())
    };
    let corpus = Corpus::wordless(&source);
    let (tokenizer, log) =
        train_watched(&spec, &corpus, &Device::flex(), None, &mut progress).unwrap();
    let kept = reconstruct(&tokenizer, &corpus, Split::Val, 0.0).unwrap();
    (steps, log, kept.mpjpe_mm)
}

#[test]
fn the_weights_that_are_kept_are_the_best_on_the_validation_split() {
    // Such a large rate destroys the patches' initial weights.
    let (steps, log, kept) = watched(0.3, Plateau { evaluations: 12, patience: 60 });
    assert_eq!((steps, log.len(), log[0].step), (60, 12, 5));
    let least = log.iter().map(|line| line.val_mpjpe_mm).fold(f64::INFINITY, f64::min);
    assert_eq!(kept, least);
    assert!(log[11].val_mpjpe_mm > least, "the last is not the best: {log:?}");
}

#[test]
fn training_ends_where_measurements_bring_nothing_new() {
    let (steps, log, kept) = watched(0.3, Plateau { evaluations: 12, patience: 2 });
    let best = log.iter().position(|line| line.val_mpjpe_mm == kept).unwrap();
    assert_eq!((log.len(), steps), (best + 3, 5 * (best + 3)), "{log:?}");
    assert!(steps < 60);
}

#[test]
fn a_tokenizer_with_language_is_not_trained_without_captions() {
    let spec = transformer_spec(&BOTH, QuantizerSpec::Vq { n_vocab: 8 }, 2);
    let source = source_of(&spec);
    let train = |text| {
        let corpus = Corpus { source: &source, text };
        let ended =
            train(&spec, &corpus, &Device::flex(), None, &mut |_| ControlFlow::Continue(()));
        ended.err().unwrap().to_string()
    };
    let none = train(None);
    assert!(none.contains("sees captions") && none.contains("was given none"), "{none}");
    let wide = train(Some(&text_of(&source, 7)));
    assert!(wide.contains("vectors of 6 numbers, the caption has 7"), "{wide}");
}

#[test]
fn a_damaged_checkpoint_is_an_error_that_names_it() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("checkpoint.safetensors");
    std::fs::write(&path, b"not a checkpoint").unwrap();
    let every = std::time::Duration::ZERO;
    let checkpoints = Some(&Checkpoints { path: &path, every, branch: None });
    let mut progress = |_| ControlFlow::Continue(());
    let source = Waves::new(&[40], 3);
    let corpus = Corpus::wordless(&source);
    let ended = train(&small_spec(), &corpus, &Device::flex(), checkpoints, &mut progress);
    let message = ended.err().unwrap().to_string();
    assert!(message.contains("checkpoint.safetensors") && message.contains("remove it"));
}

#[test]
fn features_that_are_not_finite_are_an_error() {
    let mut source = Waves::new(&[40], 3);
    source.spoiled = Some((Split::Train, 0));
    let keep_on = &mut |_| ControlFlow::Continue(());
    let result = train(&small_spec(), &Corpus::wordless(&source), &Device::flex(), None, keep_on);
    assert!(matches!(result, Err(TokenizerError::Learn(LearnError::NonFinite { step: 1, .. }))));
}
