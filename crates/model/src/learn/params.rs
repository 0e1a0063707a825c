//! Parameters drawn on the host, so that a seed gives the same bits on every device.

use burn::module::{Param, ParamId};
use burn::tensor::{Device, Tensor, TensorData};
use rand_chacha::ChaCha8Rng;

use crate::draws::{normal_pair, unit};

/// A parameter of independent normal values, mean 0, standard deviation `std`.
pub fn normal<const D: usize>(
    shape: [usize; D],
    std: f64,
    rng: &mut ChaCha8Rng,
    device: &Device,
) -> Param<Tensor<D>> {
    let n: usize = shape.iter().product();
    let mut values = Vec::with_capacity(n + 1);
    while values.len() < n {
        let (a, b) = normal_pair(rng);
        values.extend([(a * std) as f32, (b * std) as f32]);
    }
    values.truncate(n);
    from_values(values, shape, device)
}

/// A parameter of independent values, uniform in [−`bound`, `bound`).
pub fn uniform<const D: usize>(
    shape: [usize; D],
    bound: f64,
    rng: &mut ChaCha8Rng,
    device: &Device,
) -> Param<Tensor<D>> {
    let n: usize = shape.iter().product();
    let values = (0..n).map(|_| ((2.0 * unit(rng) - 1.0) * bound) as f32).collect();
    from_values(values, shape, device)
}

/// A parameter with the same value everywhere.
pub fn constant<const D: usize>(
    shape: [usize; D],
    value: f32,
    device: &Device,
) -> Param<Tensor<D>> {
    from_values(vec![value; shape.iter().product()], shape, device)
}

/// A parameter of given values, row-major.
pub fn from_values<const D: usize>(
    values: Vec<f32>,
    shape: [usize; D],
    device: &Device,
) -> Param<Tensor<D>> {
    let tensor = Tensor::from_data(TensorData::new(values, shape), device);
    let tensor = if device.is_autodiff() { tensor.require_grad() } else { tensor };
    Param::initialized(ParamId::new(), tensor)
}

#[cfg(test)]
mod tests {
    use rand_chacha::rand_core::SeedableRng;

    use super::*;

    #[test]
    fn normal_parameters_have_the_asked_deviation() {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let values = normal([101, 99], 0.02, &mut rng, &Device::flex()).val().into_data();
        let values = values.as_slice::<f32>().unwrap();
        let mean = values.iter().sum::<f32>() / values.len() as f32;
        let variance = values.iter().map(|v| v * v).sum::<f32>() / values.len() as f32;
        assert!(mean.abs() < 1e-3, "mean {mean}");
        assert!((variance.sqrt() - 0.02).abs() < 1e-3, "deviation {}", variance.sqrt());
    }

    #[test]
    fn the_same_stream_gives_the_same_bits() {
        let draw = || {
            let mut rng = ChaCha8Rng::seed_from_u64(3);
            uniform([17], 1.0, &mut rng, &Device::flex()).val().into_data()
        };
        assert_eq!(draw(), draw());
    }
}
