//! Shared tests of quantizers with several scales: training equals decoding, sums and inputs of scales, gradients,
//! resumed states, orders and lengths.

use burn::module::Module;
use burn::tensor::Device;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::*;
use crate::learn::params::normal;
use crate::learn::weights::on_host;
use crate::spec::{
    CodebookKind, QuantizerKind, QuantizerSection, QuantizerSpec, ScaleSpec, TokenizerSpec,
};
use crate::tokenizer::module::AnyQuantizer;
use crate::tokenizer::testing::spec_of;

const DIM: usize = 6;
const EXTENT: Extent = Extent { n_clips: 2, n_latents: 10 };

fn section(kind: QuantizerKind, inner: CodebookKind) -> QuantizerSection {
    let mut section = QuantizerSection { inner: Some(inner), ..kind.section() };
    match kind {
        QuantizerKind::Residual => section.layers = Some(3),
        _ => section.scales = Some(ScaleSpec::List(vec![1, 3, 10])),
    }
    section
}

/// Each kind of several scales with each kind of codebook, and VAR's mix.
fn specs() -> Vec<TokenizerSpec> {
    let kinds = [QuantizerKind::Residual, QuantizerKind::Multiscale];
    let inner = [CodebookKind::Vq, CodebookKind::Fsq];
    let mut sections: Vec<_> =
        kinds.into_iter().flat_map(|kind| inner.map(|inner| section(kind, inner))).collect();
    let mixed = section(QuantizerKind::Multiscale, CodebookKind::Vq);
    sections.push(QuantizerSection { mix: Some(0.5), ..mixed });
    sections.iter().map(|section| spec_of(section.of_size(16).unwrap(), 1)).collect()
}

fn quantizer(spec: &TokenizerSpec, device: &Device) -> AnyQuantizer {
    AnyQuantizer::new(spec, DIM, &mut ChaCha8Rng::seed_from_u64(0), device)
}

fn latents(seed: u64, device: &Device) -> Tensor<3> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    normal([EXTENT.n_clips, EXTENT.n_latents, DIM], 1.0, &mut rng, device).val()
}

/// A quantizer after some steps, without autodiff.
fn trained(spec: &TokenizerSpec) -> AnyQuantizer {
    let device = Device::flex().autodiff();
    let mut quantizer = quantizer(spec, &device);
    for seed in 0..5 {
        quantizer.quantize(latents(seed, &device));
    }
    quantizer.valid()
}

#[test]
fn training_sees_what_decoding_sees() {
    for mut spec in specs() {
        if let QuantizerSpec::Residual(own) = &mut spec.quantizer {
            own.dropout = 0.0;
        }
        // Codes move after a step, so that the next one is seen by a copy that has not moved yet.
        let plain = trained(&spec);
        let device = Device::flex();
        let seen = host(plain.clone().quantize(latents(9, &device)).quantized_btc);
        let ids = plain.ids(latents(9, &device));
        assert_eq!(host(plain.embed(&ids, EXTENT)), seen, "{spec:?}");
    }
}

#[test]
fn sums_of_the_first_scales_need_the_codes_of_the_first_scales_alone() {
    for spec in specs() {
        let plain = trained(&spec);
        let lengths = plain.lengths(EXTENT.n_latents);
        let frames = EXTENT.n_latents * spec.stride();
        assert!(spec.grid().lengths(frames).eq(lengths.iter().copied()));
        let ids = plain.ids(latents(9, &Device::flex()));
        let scales = by_scale(&ids, &lengths, EXTENT.n_clips);
        let sums = plain.sums(&ids, EXTENT);
        let inputs = plain.inputs(&ids, EXTENT);
        assert_eq!((sums.len(), inputs.len()), (3, 2));
        for n in 1..=3 {
            let first = by_clip(&scales[..n], EXTENT.n_clips);
            let own = plain.sums(&first, EXTENT);
            assert_eq!(own.len(), n);
            assert_eq!(host(own[n - 1].clone()), host(sums[n - 1].clone()));
            assert_eq!(plain.inputs(&first, EXTENT).len(), n.min(2));
        }
        for (input, s) in inputs.iter().zip(&lengths[1..]) {
            assert_eq!(input.dims(), [EXTENT.n_clips, *s, DIM]);
        }
        let second = area_down(sums[1].clone(), lengths[2]);
        assert_eq!(host(inputs[1].clone()), host(second));
    }
}

#[test]
fn codes_of_a_clip_do_not_depend_on_the_clip_beside_it() {
    for spec in specs() {
        let plain = trained(&spec);
        let both = latents(9, &Device::flex());
        let alone = |i: usize| plain.ids(both.clone().narrow(0, i, 1));
        assert_eq!(plain.ids(both.clone()), [alone(0), alone(1)].concat());
    }
}

#[test]
fn gradients_reach_the_latents_and_what_a_scale_learns() {
    for spec in specs() {
        let device = Device::flex().autodiff();
        let mut own = quantizer(&spec, &device);
        let latents_btc = latents(1, &device).detach().require_grad();
        let Quantized { quantized_btc, auxiliary_loss } = own.quantize(latents_btc.clone());
        let loss = quantized_btc.sum();
        let loss = auxiliary_loss.map_or(loss.clone(), |auxiliary| loss + auxiliary);
        let grads = loss.backward();
        let to_latents = host(latents_btc.grad(&grads).expect("a gradient"));
        assert!(to_latents.iter().any(|g| *g != 0.0), "{spec:?}");
        let learned = burn::optim::GradientsParams::from_grads(grads, &own);
        // φ has two convolutions, or one, of a weight and a bias; FSQ has two projections.
        let projections = if spec.quantizer.levels().is_some() { 4 } else { 0 };
        let parameters = match &spec.quantizer {
            QuantizerSpec::Multiscale(own) if own.mix.is_some() => 3 * (2 + projections),
            QuantizerSpec::Multiscale(_) => 3 * (4 + projections),
            _ => projections,
        };
        assert_eq!(learned.len(), parameters, "{spec:?}");
    }
}

#[test]
fn a_kept_state_goes_on_as_before() {
    for spec in specs() {
        let device = Device::flex().autodiff();
        let mut own = quantizer(&spec, &device);
        (0..3).for_each(|seed| drop(own.quantize(latents(seed, &device))));
        let LearnerState { note, tensors } = own.keep();
        let mut other = quantizer(&spec, &device).load_record(own.clone().into_record());
        other.resume(LoadedState { note, tensors: on_host(&tensors) }).expect("its own state");
        for seed in 3..12 {
            let go_on =
                |q: &mut AnyQuantizer| host(q.quantize(latents(seed, &device)).quantized_btc);
            assert_eq!(go_on(&mut own), go_on(&mut other), "{spec:?}");
        }
        assert!(other.resume(LoadedState::default()).is_none());
    }
}

#[test]
fn each_layer_of_digits_halves_what_is_left_by_its_levels() {
    let quantizer_spec = section(QuantizerKind::Residual, CodebookKind::Fsq).of_levels(&[5, 4]);
    let spec = spec_of(quantizer_spec.unwrap(), 1);
    let AnyQuantizer::ResidualFsq(mut own) =
        AnyQuantizer::new(&spec, 2, &mut ChaCha8Rng::seed_from_u64(0), &Device::flex())
    else {
        panic!("residual FSQ");
    };
    let values: Vec<f32> = (0..400).map(|i| ((i * i) as f32).sin()).collect();
    let latents_nc = Tensor::<2>::from_data(TensorData::new(values, [200, 2]), &Device::flex());
    own.begin(&latents_nc);
    let extent = Extent { n_clips: 1, n_latents: 200 };
    let bounded = host(latents_nc.clone()).into_iter().enumerate();
    let spread: Vec<f32> = {
        let squares = (latents_nc.clone() * latents_nc.clone()).mean_dim(0).sqrt() * 1.3;
        host(squares)
    };
    let bounded: Vec<f32> = bounded.map(|(i, x)| (x / spread[i % 2]).tanh()).collect();
    let sums = own.sums(&own.ids(latents_nc.reshape([1, 200, 2])), extent);
    for (i, sum) in sums.into_iter().enumerate() {
        let worst = |dim: usize, base: f32| {
            let off = host(sum.clone());
            let off = off.iter().zip(&bounded).skip(dim).step_by(2);
            let off = off.map(|(a, b)| (a / spread[dim] - b).abs()).fold(0.0, f32::max);
            (off, base.powi(-(i as i32) - 1))
        };
        for (off, most) in [worst(0, 5.0), worst(1, 4.0)] {
            assert!(off < most + 1e-5 && off > 0.8 * most, "{off} of {most}");
        }
    }
}

#[test]
fn codes_come_back_by_scale_all_of_them_and_the_first() {
    let scales = vec![vec![1, 2], vec![3, 4, 5, 6]];
    let ids = by_clip(&scales, 2);
    assert_eq!(ids, [1, 3, 4, 2, 5, 6]);
    assert_eq!(by_scale(&ids, &[1, 2], 2), scales);
    assert_eq!(by_scale(&[7, 8], &[1, 2], 2), [[7, 8]]);
}

/// One clip of one channel.
fn clip(values: &[f32]) -> Tensor<3> {
    let data = TensorData::new(values.to_vec(), [1, values.len(), 1]);
    Tensor::from_data(data, &Device::flex())
}

#[test]
fn three_bins_of_49_latents_overlap_by_one() {
    let weights = area_weights(3, 49);
    let bin = |row: &[f32]| {
        let first = row.iter().position(|w| *w > 0.0).unwrap();
        let last = row.iter().rposition(|w| *w > 0.0).unwrap();
        (first, last + 1)
    };
    let bins: Vec<_> = weights.chunks_exact(49).map(bin).collect();
    assert_eq!(bins, [(0, 17), (16, 33), (32, 49)]);
    assert!(weights.chunks_exact(49).all(|row| (row.iter().sum::<f32>() - 1.0).abs() < 1e-6));
}

#[test]
fn a_line_through_three_latents_is_met_at_seven_places() {
    let places: Vec<f32> = host(linear_up(clip(&[0.0, 1.0, 2.0]), 7));
    let expected = [0.0, 0.1429, 0.5714, 1.0, 1.4286, 1.8571, 2.0];
    assert!(places.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-4), "{places:?}");
}

#[test]
fn a_longer_length_repeats_and_the_same_length_changes_nothing() {
    assert_eq!(host(area_down(clip(&[1.0, 3.0]), 4)), [1.0, 1.0, 3.0, 3.0]);
    assert_eq!(host(area_down(clip(&[1.0, 3.0, 8.0]), 2)), [2.0, 5.5]);
    let same = clip(&[0.1, -0.7, f32::MIN_POSITIVE]);
    assert_eq!(host(linear_up(area_down(same.clone(), 3), 3)), host(same));
    assert_eq!(host(linear_up(clip(&[4.0]), 3)), [4.0; 3]);
}

#[test]
fn every_number_of_layers_is_drawn_and_all_of_them_most_often() {
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let mut dropout = Dropout::new(0.2, &mut rng);
    let mut drawn = [0; 7];
    (0..6000).for_each(|_| drawn[dropout.layers(6)] += 1);
    assert!(drawn[0] == 0 && drawn[1..6].iter().all(|n| (120..280).contains(n)), "{drawn:?}");
    let mut never = Dropout::new(0.0, &mut rng);
    assert!((0..100).all(|_| never.layers(3) == 3));
}
