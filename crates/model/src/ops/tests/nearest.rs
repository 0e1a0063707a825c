//! Codes that are nearest, by both versions, against distances in double precision.

use burn::tensor::Device;

use super::*;
use crate::ops::{nearest, plain};

fn square_distance(a: &[f32], b: &[f32]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (f64::from(*a) - f64::from(*b)).powi(2)).sum()
}

/// Latents, channels, codes.
const SHAPES: [[usize; 3]; 6] =
    [[1, 1, 1], [7, 3, 2], [513, 33, 129], [700, 64, 1003], [40, 300, 520], [1030, 8, 4375]];

#[test]
fn no_code_is_nearer_than_the_one_that_is_taken() {
    for [n, c, v] in SHAPES {
        let (latents, codes) = (input(n, c, 31), input(v, c, 32));
        let device = Device::flex();
        let tensors = (tensor(&latents, &device), tensor(&codes, &device));
        let own = nearest(&tensors.0, &tensors.1);
        let plain = plain::nearest(&tensors.0, &tensors.1);
        for (latent, ids) in latents.values.chunks(c).zip(own.iter().zip(&plain)) {
            let distances: Vec<f64> =
                codes.values.chunks(c).map(|code| square_distance(latent, code)).collect();
            let least = distances.iter().copied().fold(f64::INFINITY, f64::min);
            for id in [ids.0, ids.1] {
                assert!(distances[*id as usize] < least + 1e-5 * (1.0 + least), "{n} {c} {v}");
            }
        }
        assert_eq!((own.len(), plain.len()), (n, n));
    }
}

#[test]
fn latents_of_a_model_in_training_have_codes_too() {
    let device = Device::flex().autodiff();
    let [latents, codes] = [input(20, 4, 33), input(9, 4, 34)];
    let own = nearest(&tensor(&latents, &device), &tensor(&codes, &device));
    let outside = Device::flex();
    assert_eq!(own, nearest(&tensor(&latents, &outside), &tensor(&codes, &outside)));
    assert_eq!(nearest(&Tensor::zeros([0, 4], &outside), &tensor(&codes, &outside)), [0u32; 0]);
}
