//! Tests on real motion, which say so where it is not at hand.

use std::ops::Range;
use std::path::PathBuf;

use super::super::*;
use super::{options, skip};
use crate::data::stats::FEATURE_GROUPS;
use crate::motion::{mpjpe_mm, recover_joints};

/// A folder of real motion, or `None` with a word on it.
fn real_motion(name: &str) -> Option<PathBuf> {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data").join(name);
    if !path.is_dir() {
        eprintln!("skipped: {} is not there", path.display());
        return None;
    }
    Some(path)
}

#[test]
fn real_motion_opens_whole_and_recovers_finite_bodies() {
    let Some(path) = real_motion("cmu-motion") else { return };
    let set = HumanMl3d::open(&path, &options(true, BrokenFiles::Refuse)).expect("sound data");
    let counts = Split::ALL.map(|split| set.n_clips(split));
    assert_eq!((counts, set.warnings()), ([2 * 463, 33, 61], &[][..]));
    for split in Split::ALL {
        for index in 0..set.n_clips(split) {
            let features = set.features(split, index).expect("in memory");
            let poses = recover_joints(&features);
            assert_eq!(poses.len(), set.n_frames(split, index));
            assert!(poses.len().is_multiple_of(4) && (40..=196).contains(&poses.len()));
            assert!(mpjpe_mm(&poses, &poses[..1].repeat(poses.len())).is_finite());
        }
    }
}

#[test]
fn statistics_of_real_motion_agree_with_its_files() {
    let Some(path) = real_motion("cmu-motion") else { return };
    let set = HumanMl3d::open(&path, &skip()).expect("sound data");
    let mut computed = StatsAccumulator::default();
    (0..set.n_clips(Split::Train))
        .for_each(|index| computed.add(&set.features(Split::Train, index).expect("in memory")));
    let computed = computed.finish().expect("real motion varies");
    // The files count the frames that cropping to multiples of 4 takes away, two in a hundred.
    for column in 0..N_FEATURES {
        let deviation = set.stats().std[column];
        assert!((computed.std[column] / deviation - 1.0).abs() < 0.01, "deviation of {column}");
        let shift = (computed.mean[column] - set.stats().mean[column]) / deviation;
        assert!(shift.abs() < 0.01, "mean of {column}: {shift}");
    }
}

#[test]
fn the_digest_of_real_motion_is_the_same_each_time() {
    let Some(path) = real_motion("cmu-motion") else { return };
    let digest = || HumanMl3d::open(&path, &skip()).expect("sound data").digest().to_owned();
    let first = digest();
    assert_eq!((first.len(), &first), (64, &digest()));
}

#[test]
fn features_of_joints_are_those_that_others_made_of_them() {
    let Some(path) = real_motion("bandai-motion") else { return };
    let set = HumanMl3d::open(&path, &options(true, BrokenFiles::Refuse)).expect("sound data");
    assert_eq!(Split::ALL.map(|split| set.n_clips(split)), [2 * 2106, 122, 409]);
    let mut compared = 0;
    for split in Split::ALL {
        for index in 0..set.n_clips(split) {
            let vectors = path.join(format!("check/{}.vec.npy", set.clip_id(split, index)));
            let Ok(bytes) = std::fs::read(vectors) else { continue };
            let mut expected = crate::data::parse_npy(&bytes).expect("a sound file").values;
            let found = set.features(split, index).expect("in memory");
            // Clips are cropped to whole units of four frames.
            expected.truncate(found.len());
            // Those were made before joints were rounded to 1/8192 m, which turns short bones.
            for (group, most) in
                FEATURE_GROUPS.into_iter().zip([1e-3, 1e-3, 1e-4, 1e-3, 1e-2, 1e-3])
            {
                let apart = most_apart(&found, &expected, group.clone());
                assert!(apart < most, "{} {group:?}: {apart}", set.clip_id(split, index));
            }
            let poses = [&found, &expected].map(|features| recover_joints(features));
            assert!(mpjpe_mm(&poses[0], &poses[1]) < 1.0);
            compared += 1;
        }
    }
    assert_eq!(compared, 8);
}

fn most_apart(found: &[f32], expected: &[f32], columns: Range<usize>) -> f32 {
    let rows = found.chunks_exact(N_FEATURES).zip(expected.chunks_exact(N_FEATURES));
    let apart = |(a, b): (&[f32], &[f32])| {
        columns.clone().map(|column| (a[column] - b[column]).abs()).fold(0.0, f32::max)
    };
    rows.map(apart).fold(0.0, f32::max)
}
