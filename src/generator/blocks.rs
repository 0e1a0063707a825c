//! [`losses_by_block`]: the loss on parts of a split that have no recording in common.
//!
//! How far a loss hangs on which clips were held out is told by parts of them: with B parts of about
//! equal size the mean over the parts has the variance of the parts' losses over B (random groups;
//! Wolter 2007, "Introduction to Variance Estimation"). Clips that were recorded together stay in one part.

use std::collections::BTreeMap;

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::Sums;
use crate::learn::params::distinct;

/// Parts of a split. Twenty tell a deviation to within a sixth.
const MOST_BLOCKS: usize = 20;

/// Seeds which groups go together: the same for all runs of a data set.
const SEED: u64 = 0;

/// L_u of each block of a split, by the sums of each clip, and the group and the frames of each.
///
/// Groups are dealt in an order of chance, each to the block of the fewest frames; so blocks are the same
/// whatever made the codes. There are 20, or fewer where there are fewer groups.
pub fn losses_by_block(clips: &[Sums], groups: &[u32], frames: &[usize]) -> Vec<f64> {
    let mut of_groups: BTreeMap<u32, (usize, Vec<usize>)> = BTreeMap::new();
    for (clip, group) in groups.iter().enumerate() {
        let (total, own) = of_groups.entry(*group).or_default();
        *total += frames[clip];
        own.push(clip);
    }
    let groups: Vec<(usize, Vec<usize>)> = of_groups.into_values().collect();
    let order = distinct(groups.len(), groups.len(), &mut ChaCha8Rng::seed_from_u64(SEED));
    let mut blocks = vec![(0, Sums::default()); groups.len().min(MOST_BLOCKS)];
    for (frames, own) in order.into_iter().map(|group| &groups[group]) {
        let lightest = blocks.iter_mut().min_by_key(|(total, _)| *total).expect("a block a group");
        lightest.0 += frames;
        lightest.1 =
            Sums::all([&lightest.1].into_iter().chain(own.iter().map(|&clip| &clips[clip])));
    }
    blocks.iter().map(|(_, sums)| sums.normalised()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::learn::params::below;

    /// A clip of `targets` codes with L_u = `loss`.
    fn clip(loss: f64, targets: usize) -> Sums {
        Sums { nats: loss * targets as f64, unigram_nats: 0.0, targets }
    }

    #[test]
    fn clips_that_were_recorded_together_stay_in_one_block() {
        let clips: Vec<Sums> = (0..60).map(|i| clip(-f64::from(i / 20), 5)).collect();
        let groups: Vec<u32> = (0..60).map(|i| i / 20).collect();
        let mut losses = losses_by_block(&clips, &groups, &[20; 60]);
        losses.sort_by(f64::total_cmp);
        assert_eq!(losses, [-2.0, -1.0, 0.0]);
    }

    #[test]
    fn blocks_are_of_like_size_and_their_mean_is_the_loss() {
        let clips: Vec<Sums> = (0..400).map(|i| clip(-f64::from(i % 7), 10)).collect();
        let groups: Vec<u32> = (0..400).collect();
        let losses = losses_by_block(&clips, &groups, &[40; 400]);
        assert_eq!(losses.len(), MOST_BLOCKS);
        let mean = losses.iter().sum::<f64>() / losses.len() as f64;
        assert!((mean - Sums::all(&clips).normalised()).abs() < 1e-12, "{mean}");
    }

    #[test]
    fn the_scatter_of_blocks_tells_how_far_the_loss_hangs_on_the_clips() {
        // L_u of a clip scatters by 2, so that of the mean of 400 clips does by 0.1.
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let clips = (0..400).map(|_| clip([-2.0, 2.0][below(&mut rng, 2)], 10));
        let clips: Vec<Sums> = clips.collect();
        let losses = losses_by_block(&clips, &(0..400).collect::<Vec<_>>(), &[40; 400]);
        let mean = losses.iter().sum::<f64>() / 20.0;
        let variance = losses.iter().map(|loss| (loss - mean).powi(2)).sum::<f64>() / (20.0 * 19.0);
        assert!((variance.sqrt() / 0.1 - 1.0).abs() < 0.35, "{}", variance.sqrt());
    }
}
