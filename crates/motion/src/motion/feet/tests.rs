use super::*;
use crate::data::read_motion;
use crate::motion::fixtures::{procedural, real};
use crate::motion::synth::Script;
use crate::motion::{BONE_LENGTHS, N_JOINTS, ROOT_HEIGHT, ROOT_VELOCITY, build_features};
use crate::motion::{complete_features, mirror_features};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

/// Clips of several actions, with turns, jumps and both feet on the floor.
const SEEDS: Range<u64> = 0..24;

fn clip(seed: u64) -> Vec<f32> {
    build_features(&procedural(seed))
}

/// The body of a clip slides to its left, so many metres a frame.
fn sliding(mut features: Vec<f32>, step: f32) -> Vec<f32> {
    features.chunks_exact_mut(N_FEATURES).for_each(|row| row[ROOT_VELOCITY.start] += step);
    features
}

/// The joints of the legs but the hips, which a clean foot moves.
const MOVED: [usize; 6] = [4, 5, 7, 8, 10, 11];

fn lengths(features: &[f32]) -> Vec<f64> {
    let of = |row: &[f32], joint: usize| {
        let parent = PARENTS[joint].expect("a joint of a leg");
        norm(sub(at(row, joint), at(row, parent)))
    };
    let rows = features.chunks_exact(N_FEATURES);
    rows.flat_map(|row| MOVED.map(|joint| of(row, joint))).collect()
}

#[test]
fn a_motion_without_contacts_stays_the_same_to_the_bit() {
    for seed in SEEDS {
        let mut floating = clip(seed);
        for row in floating.chunks_exact_mut(N_FEATURES) {
            row[ROOT_HEIGHT] += 1.0;
            row[POSITIONS].iter_mut().skip(1).step_by(3).for_each(|y| *y += 1.0);
        }
        assert_eq!(clean_feet(&floating, 20.0), (floating, MovedFeet::default()));
    }
    assert_eq!(clean_feet(&[], 20.0), (Vec::new(), MovedFeet::default()));
    let one = clip(0)[..N_FEATURES].to_vec();
    assert_eq!(clean_feet(&one, 20.0), (one, MovedFeet::default()));
}

#[test]
fn bones_keep_their_lengths_and_the_rest_of_the_body_its_bits() {
    for (seed, step) in SEEDS.flat_map(|seed| [0.0, 0.02, -0.035].map(|step| (seed, step))) {
        let given = sliding(clip(seed), step);
        let (cleaned, _) = clean_feet(&given, 20.0);
        let off = lengths(&given).into_iter().zip(lengths(&cleaned)).map(|(a, b)| (a - b).abs());
        let off = off.fold(0.0, f64::max);
        assert!(off < 1e-4, "{seed}, {step}: {off} m");
        for (row, own) in given.chunks_exact(N_FEATURES).zip(cleaned.chunks_exact(N_FEATURES)) {
            let stays = |joint: &usize| !MOVED.contains(joint);
            assert_eq!(row[..POSITIONS.start], own[..POSITIONS.start], "the root");
            for joint in (1..N_JOINTS).filter(stays) {
                assert_eq!(row[columns(joint)], own[columns(joint)], "joint {joint}");
            }
        }
    }
}

/// The length of the leg of a toe, over the sum of its bones.
fn stretch(pose: &Pose, toe: usize) -> f64 {
    let ankle = PARENTS[toe].expect("an ankle");
    let knee = PARENTS[ankle].expect("a knee");
    let [hip, knee, ankle] =
        [PARENTS[knee].expect("a hip"), knee, ankle].map(|j| pose[j].map(f64::from));
    norm(sub(ankle, hip)) / (norm(sub(knee, hip)) + norm(sub(ankle, knee)))
}

#[test]
fn a_toe_moves_in_a_contact_only_where_the_leg_is_too_short() {
    let (mut still, mut all) = (0, 0);
    for seed in SEEDS {
        let given = sliding(clip(seed), 0.02);
        let (before, after) = (recover_joints(&given), recover_joints(&clean_feet(&given, 20.0).0));
        for toe in [10, 11] {
            let wanted = wanted(&before, toe, 20.0, &mut MovedFeet::default());
            let goes = |frame: &usize| wanted[*frame] != [0.0; 2];
            // Beside the contacts that are left.
            let pinned = contacts(&before, toe, 20.0).into_iter();
            let pinned = pinned.filter(|own| 2 * own.clone().filter(goes).count() > own.len());
            for frame in pinned.flat_map(|own| own.start..own.end - 1) {
                let [a, b] = [&after[frame], &after[frame + 1]];
                let step = sub(b[toe], a[toe]);
                all += 1;
                if step[0].hypot(step[2]) < 1e-4 {
                    still += 1;
                } else {
                    let stretched = stretch(a, toe).max(stretch(b, toe));
                    assert!(stretched > STRETCH - 1e-4, "{seed}, {frame}: {step:?} {stretched}");
                }
            }
        }
    }
    assert!(all > 500 && 4 * still > 3 * all, "{still} of {all}");
}

/// Of a motion at 20 frames a second: the fraction of the steps in which a toe below 5 cm is faster than 0.5 m/s, and
/// the mean size of the third differences of all joints.
fn skate_and_jerk(features: &[f32]) -> [f64; 2] {
    let poses = recover_joints(features);
    let slides = |step: &[Pose], toe: usize| {
        let [a, b] = [step[0][toe], step[1][toe]];
        a[1].max(b[1]) < 0.05 && (b[0] - a[0]).hypot(b[2] - a[2]) > 0.025
    };
    let steps = poses.windows(2).filter(|step| slides(step, 10) || slides(step, 11)).count();
    let third = |four: &[Pose], joint: usize| {
        let [a, b, c, d] = [0, 1, 2, 3].map(|i| four[i][joint].map(f64::from));
        norm(sub(sub(d, a), scale(sub(c, b), 3.0)))
    };
    let all = poses.windows(4).flat_map(|four| (0..N_JOINTS).map(move |joint| third(four, joint)));
    let jerk = all.sum::<f64>() / ((poses.len() - 3) * N_JOINTS) as f64;
    [steps as f64 / (poses.len() - 1) as f64, jerk]
}

#[test]
fn a_walk_that_slides_skates_less_once_its_feet_are_clean() {
    let scripts = (0..400).map(|seed| Script::sample(&mut ChaCha8Rng::seed_from_u64(seed)));
    let walks = scripts.filter(|own| own.captions()[0].starts_with("a person walks")).take(20);
    let truths: Vec<Vec<f32>> = walks.map(|own| build_features(&own.poses())).collect();
    assert_eq!(truths.len(), 20);
    // 0.6 m/s to a side. Contacts of more than 0.4 s then travel farther than FARTHEST, and stay as they are.
    for step in [0.03, -0.03] {
        let slid = || truths.iter().map(|truth| sliding(truth.clone(), step));
        let cleaned: Vec<Vec<f32>> = slid().map(|own| clean_feet(&own, 20.0).0).collect();
        let mean = |motions: &[Vec<f32>]| {
            let each = motions.iter().map(|own| skate_and_jerk(own));
            each.fold([0.0; 2], |sum, own| [sum[0] + own[0] / 20.0, sum[1] + own[1] / 20.0])
        };
        let [truth, slid, cleaned] =
            [&truths, &slid().collect(), &cleaned].map(|own: &Vec<Vec<f32>>| mean(own));
        let all = format!("{truth:?} {slid:?} {cleaned:?}");
        assert!(slid[0] > truth[0] + 0.4, "{all}");
        assert!(cleaned[0] < slid[0] - 0.2, "{all}");
        assert!(cleaned[1] < 1.5 * slid[1], "{all}");
    }
}

#[test]
fn features_of_moved_frames_follow_from_their_positions() {
    let given = sliding(clip(3), 0.02);
    let (cleaned, moved) = clean_feet(&given, 20.0);
    assert!(moved.contacts > 2 && moved.mean_mm > 1.0 && moved.largest_mm < 1000.0 * FARTHEST);
    let known = cleaned.chunks_exact(N_FEATURES).flat_map(|row| row[..POSITIONS.end].to_vec());
    let all = complete_features(&known.collect::<Vec<f32>>(), 20.0);
    let rows = || cleaned.chunks_exact(N_FEATURES).zip(given.chunks_exact(N_FEATURES));
    for (frame, (own, before)) in rows().enumerate() {
        let expected = if own[POSITIONS] == before[POSITIONS] {
            // The frame before a contact steps into it.
            [&before[..193], &own[193..]].concat()
        } else {
            all[frame * N_FEATURES..][..N_FEATURES].to_vec()
        };
        assert!(own == expected, "frame {frame}");
    }
}

#[test]
fn a_body_that_glides_on_both_feet_is_left_as_it_is() {
    let mut standing = vec![0.0; 60 * N_FEATURES];
    let row = clip(3)[..N_FEATURES].to_vec();
    standing.chunks_exact_mut(N_FEATURES).for_each(|own| own[..67].copy_from_slice(&row[..67]));
    standing.chunks_exact_mut(N_FEATURES).for_each(|own| own[..3].fill(0.0));
    for toe in [10, 11] {
        let lower = |own: &mut [f32]| own[columns(toe)][1] = 0.01;
        standing.chunks_exact_mut(N_FEATURES).for_each(lower);
    }
    let gliding = sliding(standing.clone(), 0.03);
    let (same, moved) = clean_feet(&gliding, 20.0);
    assert_eq!((moved.contacts, moved.left), (0, 2));
    assert!(same == gliding);
    // A slow one is held.
    let (_, moved) = clean_feet(&sliding(standing, 0.005), 20.0);
    assert_eq!((moved.contacts, moved.left), (2, 0));
    assert!((100.0..=150.0).contains(&moved.largest_mm), "{moved:?}");
}

#[test]
fn a_mirrored_motion_is_cleaned_as_in_a_mirror() {
    for seed in SEEDS {
        let given = sliding(clip(seed), 0.015);
        let there = mirror_features(&clean_feet(&given, 20.0).0);
        let here = clean_feet(&mirror_features(&given), 20.0).0;
        let off = there.iter().zip(&here).enumerate().filter(|(i, _)| i % N_FEATURES < 67);
        let off = off.map(|(_, (a, b))| (a - b).abs()).fold(0.0, f32::max);
        assert!(off < 1e-3, "{seed}: {off}");
    }
}

/// A leg of the rest pose: hip, knee, ankle and toe.
fn leg(bent: f64) -> [Point; 4] {
    let [thigh, shin, foot] = [4, 7, 10].map(|joint| f64::from(BONE_LENGTHS[joint]));
    let knee = [0.0, -thigh * bent.cos(), thigh * bent.sin()];
    let ankle = add(knee, [0.0, -shin * bent.cos(), -shin * bent.sin()]);
    [[0.0; 3], knee, ankle, add(ankle, [0.0, 0.0, foot])]
}

#[test]
fn a_straight_leg_bends_its_knee_forward_and_a_short_one_reaches_as_far_as_it_can() {
    let straight = leg(0.0);
    let up = [0.0, 0.1, 0.0];
    assert!(bend(straight, reach(straight, up))[2] > 0.1, "forward");
    let bent = leg(0.2);
    let moved = reach(bent, [0.5, 0.0, 0.0]);
    let length = norm(sub(bent[1], bent[0])) + norm(sub(bent[2], bent[1]));
    assert!((norm(add(bent[2], moved)) - STRETCH * length).abs() < 1e-9 && moved[0] > 0.05);
    assert_eq!(reach(straight, [0.3, 0.0, 0.0]), [0.0; 3]);
    assert_eq!(bend(bent, [0.0; 3]).map(|c| (1e9 * c).round()), bent[1].map(|c| (1e9 * c).round()));
    // The hip is where the ankle should go.
    assert_eq!(reach(bent, scale(bent[2], -0.97)), [0.0; 3]);
}

#[test]
fn real_motion_stays_finite_and_near() {
    let Some(folder) = real("cmu-motion") else { return };
    for id in ["000052", "000163", "000300", "000303", "000423", "000518"] {
        let path = folder.join(format!("new_joint_vecs/{id}.npy"));
        let given = read_motion(&path, 20.0).expect("a motion");
        let (cleaned, moved) = clean_feet(&given, 20.0);
        assert!(cleaned.iter().all(|x| x.is_finite()), "{id}");
        assert!(moved.largest_mm <= 1000.0 * FARTHEST, "{id}: {moved:?}");
        let off = lengths(&given).into_iter().zip(lengths(&cleaned));
        assert!(off.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) < 1e-4, "{id}");
    }
}
