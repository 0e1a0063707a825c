//! Latents of a clip at another length: down by area, up by lines.
//!
//! Both are linear maps along time, the same for every clip and channel.
//!
//! Shapes: b clips, t latents, s latents of the other length, c channels.

use burn::tensor::{Tensor, TensorData};

/// `[b, t, c]` to `[b, s, c]`: latent i is the mean of ⌊iT/s⌋..⌈(i+1)T/s⌉ (adaptive average pooling, as
/// LG-Tok's code has it). Bins overlap where s does not divide t, and repeat where s is larger.
pub fn area_down(x_btc: Tensor<3>, s: usize) -> Tensor<3> {
    along_time(x_btc, s, area_weights)
}

/// `[b, s, c]` to `[b, t, c]`: latent i lies at (i + ½)·s/t − ½ on the line through the latents around
/// it, at least at 0 (linear interpolation with `align_corners=False`).
pub fn linear_up(x_bsc: Tensor<3>, t: usize) -> Tensor<3> {
    along_time(x_bsc, t, linear_weights)
}

/// The map with `weights`, `[to, from]`; where both are of one length, it changes nothing.
fn along_time(x_btc: Tensor<3>, to: usize, weights: fn(usize, usize) -> Vec<f32>) -> Tensor<3> {
    let [_, from, _] = x_btc.dims();
    if from == to {
        return x_btc;
    }
    let data = TensorData::new(weights(to, from), [1, to, from]);
    Tensor::<3>::from_data(data, &x_btc.device()).matmul(x_btc)
}

fn area_weights(to: usize, from: usize) -> Vec<f32> {
    let mut weights = vec![0.0; to * from];
    for (i, row) in weights.chunks_exact_mut(from).enumerate() {
        let bin = i * from / to..((i + 1) * from).div_ceil(to);
        let share = 1.0 / bin.len() as f32;
        row[bin].fill(share);
    }
    weights
}

fn linear_weights(to: usize, from: usize) -> Vec<f32> {
    let mut weights = vec![0.0; to * from];
    for (i, row) in weights.chunks_exact_mut(from).enumerate() {
        let place = ((i as f64 + 0.5) * from as f64 / to as f64 - 0.5).max(0.0);
        let left = place as usize;
        let right = (left + 1).min(from - 1);
        let share = (place - left as f64) as f32;
        row[left] += 1.0 - share;
        row[right] += share;
    }
    weights
}

#[cfg(test)]
mod tests {
    use super::*;
    use burn::tensor::Device;

    /// One clip of one channel.
    fn clip(values: &[f32]) -> Tensor<3> {
        let data = TensorData::new(values.to_vec(), [1, values.len(), 1]);
        Tensor::from_data(data, &Device::flex())
    }

    fn host(x_btc: Tensor<3>) -> Vec<f32> {
        x_btc.into_data().try_into_vec().unwrap()
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
}
