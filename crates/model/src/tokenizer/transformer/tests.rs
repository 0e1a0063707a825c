//! Both halves: their shapes, and what reaches them of a caption.

use std::ops::Range;

use super::*;
use rand_chacha::rand_core::SeedableRng;

use crate::learn::params::normal;
use crate::spec::{ArchitectureSpec, LanguagePlace, QuantizerSpec};
use crate::tokenizer::halves::{Captions, host};
use crate::tokenizer::module::{AnyDecoder, AnyEncoder};
use crate::tokenizer::testing::{D_TEXT, transformer_spec};

const BOTH: [LanguagePlace; 2] = [LanguagePlace::Tokenizer, LanguagePlace::Detokenizer];
const N_FEATURES: usize = 70;

fn sizes(at: &[LanguagePlace]) -> TransformerSpec {
    let quantizer = QuantizerSpec::Fsq { levels: vec![5, 3] };
    match transformer_spec(at, quantizer, 1).architecture {
        ArchitectureSpec::Transformer(sizes) => sizes,
        _ => unreachable!("the spec of a transformer"),
    }
}

fn halves_of(sizes: TransformerSpec, n_features: usize) -> (AnyEncoder, AnyDecoder) {
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    let (device, spec) = (Device::flex(), ArchitectureSpec::Transformer(sizes));
    let encoder = AnyEncoder::new(&spec, n_features, &mut rng, &device);
    (encoder, AnyDecoder::new(&spec, n_features, &mut rng, &device))
}

fn halves(sizes: TransformerSpec) -> (AnyEncoder, AnyDecoder) {
    halves_of(sizes, N_FEATURES)
}

fn random(shape: [usize; 3], seed: u64) -> Tensor<3> {
    normal(shape, 1.0, &mut ChaCha8Rng::seed_from_u64(seed), &Device::flex()).val()
}

/// Captions of so many words each.
fn captions(words: &[usize], seed: u64) -> Captions {
    let of = |(i, &n): (usize, &usize)| {
        host(random([1, n.max(1), D_TEXT], seed + i as u64))[..n * D_TEXT].to_vec()
    };
    let all: Vec<Vec<f32>> = words.iter().enumerate().map(of).collect();
    Captions::of(all.iter().map(Vec::as_slice), D_TEXT)
}

fn encoded(encoder: &AnyEncoder, clips: &Tensor<3>, captions: &Captions) -> Vec<Vec<f32>> {
    let latents = encoder.forward(clips.clone(), &mut Pass::reading(Some(captions)));
    let size = latents.dims()[1] * latents.dims()[2];
    host(latents).chunks(size).map(<[f32]>::to_vec).collect()
}

#[test]
fn clips_of_any_length_become_a_latent_for_four_frames_and_come_back() {
    for positions in [Positions::Learned, Positions::Rotary] {
        for detokenizer in [Detokenizer::Cross, Detokenizer::Context] {
            let (encoder, decoder) =
                halves(TransformerSpec { positions, detokenizer, ..sizes(&[]) });
            for latents in [1, 3, 4, 5, 11] {
                let clips = random([2, 4 * latents, N_FEATURES], 1);
                let made = encoder.forward(clips, &mut Pass::default());
                assert_eq!(made.dims(), [2, latents, 4]);
                let frames = decoder.forward(made, 4 * latents, &mut Pass::default());
                assert_eq!(frames.dims(), [2, 4 * latents, N_FEATURES]);
            }
        }
    }
}

#[test]
fn clips_of_any_length_become_a_fixed_number_of_latents_and_come_back() {
    for positions in [Positions::Learned, Positions::Rotary] {
        for detokenizer in [Detokenizer::Cross, Detokenizer::Context] {
            let own = TransformerSpec { positions, detokenizer, ..sizes(&[]) };
            let (encoder, decoder) = halves(TransformerSpec { latents: Some(6), ..own });
            // The span has 16 frames.
            for (n_frames, latents) in [(4, 6), (8, 6), (12, 6), (16, 6), (20, 12), (44, 18)] {
                let clips = random([2, n_frames, N_FEATURES], 1);
                let made = encoder.forward(clips, &mut Pass::default());
                assert_eq!(made.dims(), [2, latents, 4]);
                let frames = decoder.forward(made, n_frames, &mut Pass::default());
                assert_eq!(frames.dims(), [2, n_frames, N_FEATURES]);
            }
        }
    }
}

/// A piece of latents of their own frames, where their number is fixed, is the piece where it is not.
#[test]
fn as_many_fixed_latents_as_there_would_be_are_those() {
    let both = [None, Some(4)].map(|latents| halves(TransformerSpec { latents, ..sizes(&[]) }));
    let clips = random([2, 16, N_FEATURES], 1);
    let made = both.map(|(encoder, decoder)| {
        let latents = encoder.forward(clips.clone(), &mut Pass::default());
        [host(latents.clone()), host(decoder.forward(latents, 16, &mut Pass::default()))]
    });
    assert_eq!(made[0], made[1]);
}

#[test]
fn a_dropped_caption_cannot_influence_latents() {
    let (encoder, _) = halves(sizes(&BOTH));
    let clips = random([2, 12, N_FEATURES], 2);
    let with = encoded(&encoder, &clips, &captions(&[3, 5], 7));
    let dropped = encoded(&encoder, &clips, &captions(&[3, 0], 7));
    let others = encoded(&encoder, &clips, &captions(&[2, 0], 30));
    let none = encoded(&encoder, &clips, &Captions::none(2));
    assert_eq!(with[0], dropped[0], "a clip sees its own caption alone");
    assert_ne!(with[1], dropped[1], "a caption is seen");
    assert_eq!((&dropped[1], &others[1]), (&none[1], &none[1]));
    // What takes the caption's place is the detokenizer's alone.
    let (other, _) = halves(sizes(&BOTH[..1]));
    assert_eq!(encoded(&other, &clips, &captions(&[3, 0], 7)), dropped);
}

#[test]
fn the_detokenizer_sees_a_caption_and_that_it_is_missing() {
    for detokenizer in [Detokenizer::Cross, Detokenizer::Context] {
        let (_, decoder) = halves(TransformerSpec { detokenizer, ..sizes(&BOTH) });
        let latents = random([2, 3, 4], 3);
        let made = |captions: &Captions| {
            host(decoder.forward(latents.clone(), 12, &mut Pass::reading(Some(captions))))
        };
        let size = 12 * N_FEATURES;
        let with = made(&captions(&[3, 5], 7));
        let dropped = made(&captions(&[3, 0], 7));
        let close = |a: &[f32], b: &[f32]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-6);
        assert!(close(&with[..size], &dropped[..size]));
        assert!(!close(&with[size..], &dropped[size..]));
        let AnyDecoder::Transformer(mut moved) = decoder.clone() else { unreachable!() };
        moved.shift_mask();
        let pass = &mut Pass::reading(None);
        let without = captions(&[0, 0], 7);
        pass.captions = Some(&without);
        let before = made(&without);
        let after = host(AnyDecoder::Transformer(moved).forward(latents.clone(), 12, pass));
        assert!(!close(&after, &before));
    }
}

/// LG-Tok's Eq. 7.
#[test]
fn frames_that_do_not_read_the_caption_have_the_vector_of_a_dropped_one() {
    let (_, decoder) = halves(sizes(&BOTH));
    // Three pieces, and the part lies in two of them.
    let latents = random([1, 11, 4], 3);
    let made = |captions: Captions| {
        host(decoder.forward(latents.clone(), 44, &mut Pass::reading(Some(&captions))))
    };
    let (caption, other) = (captions(&[3], 7), captions(&[5], 30));
    let (none, all) = (made(Captions::none(1)), made(caption.clone()));
    let close = |a: &[f32], b: &[f32]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-5);
    assert!(close(&made(caption.clone().read_by(&[false; 11])), &none));
    assert!(close(&made(caption.clone().read_by(&[true; 11])), &all));
    let part: [bool; 11] = std::array::from_fn(|latent| (2..5).contains(&latent));
    let [own, others] = [caption, other].map(|captions| made(captions.read_by(&part)));
    let frames =
        |latents: Range<usize>| latents.start * 4 * N_FEATURES..latents.end * 4 * N_FEATURES;
    assert!(!close(&own[frames(2..5)], &none[frames(2..5)]), "the part reads");
    assert!(!close(&own[frames(2..5)], &others[frames(2..5)]), "and its own caption");
    // Frames of one piece look at one another; those of the last piece at none that reads.
    assert!(close(&own[frames(7..11)], &none[frames(7..11)]));
    assert!(!close(&own[frames(7..11)], &all[frames(7..11)]));
}

#[test]
fn of_a_fixed_number_of_latents_the_frames_in_their_spans_read() {
    let (_, decoder) = halves(TransformerSpec { latents: Some(6), ..sizes(&BOTH) });
    // Two pieces of 12 frames, and two frames a latent.
    let latents = random([1, 12, 4], 3);
    let made = |captions: Captions| {
        host(decoder.forward(latents.clone(), 24, &mut Pass::reading(Some(&captions))))
    };
    let caption = captions(&[3], 7);
    let (none, all) = (made(Captions::none(1)), made(caption.clone()));
    let part: [bool; 12] = std::array::from_fn(|latent| latent < 6);
    let own = made(caption.clone().read_by(&part));
    let close = |a: &[f32], b: &[f32]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-5);
    let (first, last) = own.split_at(12 * N_FEATURES);
    assert!(close(first, &all[..first.len()]) && !close(first, &none[..first.len()]));
    assert!(close(last, &none[first.len()..]) && !close(last, &all[first.len()..]));
}

#[test]
fn dropout_follows_from_its_stream() {
    let (encoder, _) = halves(sizes(&[]));
    let clips = random([1, 8, N_FEATURES], 2);
    let made = |seed: Option<u64>| {
        let noise = seed.map(ChaCha8Rng::seed_from_u64);
        host(encoder.forward(clips.clone(), &mut Pass { captions: None, noise }))
    };
    assert_eq!(made(Some(1)), made(Some(1)));
    assert_ne!(made(Some(1)), made(Some(2)));
    assert_ne!(made(Some(1)), made(None));
}

#[test]
fn at_the_sizes_of_the_paper_the_halves_have_about_its_parameters() {
    let mut sizes = sizes(&BOTH);
    (sizes.width, sizes.layers, sizes.heads, sizes.latent, sizes.span) = (256, 9, 4, 512, 196);
    sizes.language.as_mut().unwrap().dim = 2048;
    let text = (2048 + 1) * 256;
    let (encoder, decoder) = halves_of(sizes, 67);
    let [encoder, decoder] = [encoder.num_params() - text, decoder.num_params() - text];
    // 10.4 and 15.2 million, to which the latents' learned positions add 49 x 256.
    assert!((10_350_000..10_450_000).contains(&encoder), "{encoder}");
    assert!((15_150_000..15_265_000).contains(&decoder), "{decoder}");
}
