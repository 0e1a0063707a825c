//! Saved tokenizers, and what is no code.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::*;
use crate::motion::N_FEATURES;
use crate::spec::{CodebookKind, QuantizerKind, QuantizerSection, QuantizerSpec, ScaleSpec};
use crate::spec::{LanguagePlace, Representation};
use crate::tokenizer::testing::{D_TEXT, Waves, patch_spec, small_spec, transformer_spec};
use crate::tokenizer::{Corpus, train};

fn untrained(kind: QuantizerSpec) -> Tokenizer {
    let (device, mut rng) = (Device::flex(), ChaCha8Rng::seed_from_u64(3));
    let spec = TokenizerSpec { quantizer: kind, ..small_spec() };
    let stats = Waves::new(&[8], 5).metadata.stats;
    let module = TokenizerModule::new(&spec, 5, &mut rng, &device);
    Tokenizer::new(module, spec, stats, 29.97, device)
}

/// A quantizer of each kind, with scales of three codes in all.
fn kinds() -> Vec<QuantizerSpec> {
    let (fsq, vq) = (CodebookKind::Fsq, CodebookKind::Vq);
    let section = |kind: QuantizerKind, inner| {
        let mut section = QuantizerSection { inner: Some(inner), ..kind.section() };
        match kind {
            QuantizerKind::Residual => section.layers = Some(2),
            _ => section.scales = Some(ScaleSpec::List(vec![1, 2])),
        }
        section.of_size(16).unwrap()
    };
    let kinds = [QuantizerKind::Residual, QuantizerKind::Multiscale];
    let several = kinds.into_iter().flat_map(|kind| [fsq, vq].map(|inner| section(kind, inner)));
    let single = [QuantizerSpec::Fsq { levels: vec![5, 3] }, QuantizerSpec::Vq { n_vocab: 6 }];
    single.into_iter().chain(several).collect()
}

#[test]
fn a_saved_tokenizer_loads_with_the_same_codes_and_features() {
    for kind in kinds() {
        let folder = tempfile::tempdir().unwrap();
        let tokenizer = untrained(kind);
        tokenizer.save(folder.path()).unwrap();
        let loaded = Tokenizer::load(folder.path(), &Device::flex()).unwrap();
        assert_eq!(loaded.fps(), tokenizer.fps());
        let features = Waves::new(&[40], 5).clip(0, 0);
        let ids = tokenizer.encode(&features, None).unwrap();
        assert_eq!((loaded.spec(), loaded.stats()), (tokenizer.spec(), tokenizer.stats()));
        let wanted = tokenizer.spec().grid().n_codes(40);
        assert_eq!((ids.len(), loaded.encode(&features, None).unwrap()), (wanted, ids.clone()));
        let decoded = |tokenizer: &Tokenizer| tokenizer.decode(&ids, 40, None, 0.0).unwrap();
        assert_eq!(decoded(&loaded), decoded(&tokenizer));
    }
}

#[test]
fn frames_after_the_last_whole_latent_are_left_out() {
    for kind in kinds() {
        let tokenizer = untrained(kind);
        let features = Waves::new(&[24], 5).clip(0, 0);
        let codes = |frames: usize| tokenizer.encode(&features[..frames * 5], None).unwrap();
        let decode = |ids: &[u32], frames| tokenizer.decode(ids, frames, None, 0.0).unwrap();
        let ids = codes(23);
        assert_eq!(ids, codes(20));
        assert_eq!(decode(&ids, 23).len(), 20 * 5);
        assert!(codes(3).is_empty() && decode(&[], 3).is_empty());
    }
}

#[test]
fn an_id_that_is_no_code_is_an_error() {
    let tokenizer = untrained(QuantizerSpec::Fsq { levels: vec![5, 3] });
    let decode = |ids: &[u32], frames| tokenizer.decode(ids, frames, None, 0.0);
    assert_eq!(decode(&[14, 0], 8).unwrap().len(), 8 * 5);
    let error = decode(&[3, 15], 8).unwrap_err().to_string();
    assert!(error.contains("15"), "{error}");
    let error = decode(&[3, 1], 12).unwrap_err().to_string();
    assert!(error.contains("2 codes") && error.contains("12 frames have 3"), "{error}");
}

#[test]
fn an_id_is_held_against_the_codebook_of_its_own_scale() {
    let mut section = QuantizerKind::Multiscale.section();
    section.scales = Some(ScaleSpec::List(vec![1, 2]));
    let tokenizer = untrained(section.of_size(16).unwrap());
    assert!(tokenizer.decode(&[7, 23, 23], 20, None, 0.0).is_ok());
    let error = tokenizer.decode(&[8, 23, 23], 20, None, 0.0).unwrap_err().to_string();
    assert!(error.contains("8 is no code") && error.contains("8 codes"), "{error}");
}

/// A transformer that sees captions at both halves.
fn with_language() -> Tokenizer {
    let (device, mut rng) = (Device::flex(), ChaCha8Rng::seed_from_u64(3));
    let places = [LanguagePlace::Tokenizer, LanguagePlace::Detokenizer];
    let spec = transformer_spec(&places, QuantizerSpec::Fsq { levels: vec![5, 5, 5] }, 1);
    let stats = Waves::new(&[8], N_FEATURES).metadata.stats;
    let module = TokenizerModule::new(&spec, N_FEATURES, &mut rng, &device);
    Tokenizer::new(module, spec, stats, 29.97, device)
}

fn caption() -> Vec<f32> {
    (0..3 * D_TEXT).map(|i| (i as f32 * 0.9).sin()).collect()
}

#[test]
fn a_saved_tokenizer_with_language_loads_with_the_same_codes_and_features() {
    let folder = tempfile::tempdir().unwrap();
    let tokenizer = with_language();
    tokenizer.save(folder.path()).unwrap();
    let loaded = Tokenizer::load(folder.path(), &Device::flex()).unwrap();
    let (features, caption) = (Waves::new(&[40], N_FEATURES).clip(0, 0), caption());
    let ids = tokenizer.encode(&features, Some(&caption)).unwrap();
    assert_eq!(loaded.encode(&features, Some(&caption)).unwrap(), ids);
    let decoded = |tokenizer: &Tokenizer| tokenizer.decode(&ids, 40, Some(&caption), 1.5).unwrap();
    assert_eq!(decoded(&loaded), decoded(&tokenizer));
}

#[test]
fn a_tokenizer_with_language_wants_a_caption() {
    let (tokenizer, features) = (with_language(), Waves::new(&[8], N_FEATURES).clip(0, 0));
    let error = tokenizer.encode(&features, None).unwrap_err().to_string();
    assert!(error.contains("was given none"), "{error}");
    assert!(tokenizer.decode(&[0, 1], 8, None, 0.0).is_err());
    let error = tokenizer.encode(&features, Some(&[0.5; 7])).unwrap_err().to_string();
    assert!(error.contains("vectors of 6 numbers"), "{error}");
}

#[test]
fn guidance_goes_on_from_what_is_made_without_the_caption_to_what_is_made_with_it() {
    let (tokenizer, caption, ids) = (with_language(), caption(), [3, 9, 120]);
    let guided = |g: f64| tokenizer.decode(&ids, 12, Some(&caption), g).unwrap();
    let made = |captions: &Captions| {
        let extent = Extent { n_clips: 1, n_latents: 3 };
        tokenizer.decode_stack(&ids, extent, Some(captions), 0.0)
    };
    let with = made(&Captions::of([&caption[..]], D_TEXT));
    let without = made(&Captions::none(1));
    assert_eq!(guided(0.0), with);
    let close = |a: &[f32], b: &[f32]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-4);
    assert!(close(&guided(-1.0), &without) && !close(&with, &without));
    let expected: Vec<f32> = with.iter().zip(&without).map(|(c, u)| 3.0 * c - 2.0 * u).collect();
    assert!(close(&guided(2.0), &expected));
}

#[test]
fn a_tokenizer_of_67_features_looks_at_no_other_and_makes_all() {
    let vq = || QuantizerSpec::Vq { n_vocab: 6 };
    for spec in [small_spec(), patch_spec(vq(), 3), transformer_spec(&[], vq(), 3)] {
        let mut spec = TokenizerSpec { representation: Representation::Meng67, ..spec };
        if spec.architecture.name() == "patch" {
            (spec.training.mix_body, spec.training.mix_arm) = (0.5, 0.5);
        }
        let source = Waves::new(&[40, 36, 40], N_FEATURES);
        let keep_on = &mut |_| std::ops::ControlFlow::Continue(());
        let corpus = Corpus::wordless(&source);
        let tokenizer = train(&spec, &corpus, &Device::flex(), None, keep_on).unwrap();
        let mut features = source.clip(0, 0);
        let ids = tokenizer.encode(&features, None).unwrap();
        features.chunks_mut(N_FEATURES).for_each(|frame| frame[67..].fill(1e3));
        assert_eq!(tokenizer.encode(&features, None).unwrap(), ids);
        let made = tokenizer.decode(&ids, 40, None, 0.0).unwrap();
        assert_eq!(made.len(), 40 * N_FEATURES);
        assert!(made.iter().all(|x| x.is_finite()));
        let folder = tempfile::tempdir().unwrap();
        tokenizer.save(folder.path()).unwrap();
        let loaded = Tokenizer::load(folder.path(), &Device::flex()).unwrap();
        assert_eq!(loaded.decode(&ids, 40, None, 0.0).unwrap(), made);
    }
}
