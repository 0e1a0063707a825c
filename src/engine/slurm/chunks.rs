//! Many short jobs into few tasks of about the same length.

/// Seconds below which a task is not worth its place in the queue.
const LEAST_S: f64 = 60.0;

/// Tasks that a cluster is taken to run at once, where nothing says how many.
const ASSUMED_PARALLEL: usize = 16;

/// Tasks a slot, so that the last to end does not hold up the rest for long.
const TASKS_PER_SLOT: usize = 3;

/// How long a task should be, given all the work in seconds: `target_s` at most, and so short that
/// each of `parallel` slots gets three, but not below a minute.
pub fn length_s(all_s: f64, target_s: f64, parallel: Option<usize>) -> f64 {
    let tasks = TASKS_PER_SLOT * parallel.unwrap_or(ASSUMED_PARALLEL);
    (all_s / tasks as f64).max(LEAST_S).min(target_s)
}

/// How many tasks of a length hold the work of some units, each of which stays whole.
pub fn count(units_s: &[f64], length_s: f64) -> usize {
    let all: f64 = units_s.iter().sum();
    ((all / length_s).ceil() as usize).clamp(1, units_s.len().max(1))
}

/// Packs units with their seconds into `count` bins, the longest unit first, each into the bin that
/// has least: the fullest bin holds at most 4/3 of what the best packing would (Graham 1969).
///
/// Bins come in the order of their work, the most first; so do the units of a bin.
pub fn pack<T>(units: Vec<(f64, T)>, count: usize) -> Vec<Vec<T>> {
    let mut units = units;
    units.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut bins: Vec<(f64, Vec<T>)> = (0..count).map(|_| (0.0, Vec::new())).collect();
    for (seconds, unit) in units {
        let Some(least) = bins.iter_mut().min_by(|a, b| a.0.total_cmp(&b.0)) else { break };
        least.0 += seconds;
        least.1.push(unit);
    }
    bins.sort_by(|a, b| b.0.total_cmp(&a.0));
    bins.into_iter().map(|(_, units)| units).filter(|units| !units.is_empty()).collect()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn the_longest_come_first_and_bins_are_level() {
        let units = [3.0, 5.0, 2.0, 4.0, 2.0].map(|s| (s, s));
        assert_eq!(pack(units.to_vec(), 2), [vec![5.0, 2.0, 2.0], vec![4.0, 3.0]]);
    }

    #[test]
    fn a_small_sweep_is_spread_and_a_large_one_fills_its_tasks() {
        assert_eq!(length_s(600.0, 1800.0, None), 60.0);
        assert_eq!(length_s(6.0 * 3600.0, 1800.0, None), 450.0);
        assert_eq!(length_s(6.0 * 3600.0, 1800.0, Some(2)), 1800.0);
        assert_eq!(length_s(600.0, 3.0, None), 3.0);
        assert_eq!(count(&[50.0, 50.0, 50.0], 60.0), 3);
        assert_eq!(count(&[1.0; 100], 60.0), 2);
        assert_eq!(count(&[500.0], 60.0), 1);
    }

    proptest! {
        #[test]
        fn every_unit_is_in_one_bin_and_no_bin_is_far_too_full(
            seconds in prop::collection::vec(0.1f64..100.0, 1..60), bins in 1usize..12,
        ) {
            let units: Vec<(f64, usize)> = seconds.iter().copied().zip(0..).collect();
            let packed = pack(units, bins);
            let mut all: Vec<usize> = packed.iter().flatten().copied().collect();
            all.sort_unstable();
            prop_assert_eq!(all, (0..seconds.len()).collect::<Vec<_>>());
            let load = |bin: &Vec<usize>| bin.iter().map(|i| seconds[*i]).sum::<f64>();
            let fullest = packed.iter().map(load).fold(0.0, f64::max);
            let longest = seconds.iter().copied().fold(0.0, f64::max);
            let fair = seconds.iter().sum::<f64>() / bins as f64;
            prop_assert!(fullest <= fair + longest + 1e-9);
        }
    }
}
