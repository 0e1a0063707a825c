//! Positions into rotations.

use super::*;
use crate::motion::fixtures::{dance, moved};
use crate::motion::{BONE_LENGTHS, JOINT_NAMES, N_JOINTS};
use proptest::prelude::*;

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn a_rigid_body_is_read_back_where_it_was(seed: u64, turn in -3.0..3.0f64, x in -5.0..5.0f32) {
        let mm = written_and_read_mm(&moved(&procedural(seed), turn, [x, 0.3, -x]));
        prop_assert!(mm < 1.0, "{mm} mm");
    }
}

#[test]
fn the_deviation_is_that_of_the_text() {
    let poses = dance(60);
    let fitted = fit_bvh(&poses, 20.0).unwrap();
    let Deviation { largest_mm, mean_mm } = fitted.deviation;
    assert!((largest_mm - written_and_read_mm(&poses)).abs() < 1e-3);
    // Every bone of the dance changes its length.
    assert!(largest_mm > 10.0 && mean_mm > 1.0 && mean_mm < largest_mm, "{largest_mm} {mean_mm}");
}

#[test]
fn a_stretched_bone_moves_its_own_end_alone() {
    let mut poses = vec![procedural(1)[0]; 4];
    // The left upper arm of the first frame is 8 cm longer: 6 cm more than the mean.
    let ([shoulder, elbow], wrist) = ([poses[0][16], poses[0][18]], poses[0][20]);
    let along: [f32; 3] = std::array::from_fn(|c| (elbow[c] - shoulder[c]) / BONE_LENGTHS[18]);
    let longer = |joint: [f32; 3]| std::array::from_fn(|c| joint[c] + 0.08 * along[c]);
    (poses[0][18], poses[0][20]) = (longer(elbow), longer(wrist));
    let read = fit_bvh(&poses, 20.0).unwrap().bvh.poses().unwrap();
    let apart = |joint: usize| {
        let squares = (0..3).map(|c| (read[0][joint][c] - poses[0][joint][c]).powi(2));
        1000.0 * squares.sum::<f32>().sqrt()
    };
    assert!((apart(18) - 60.0).abs() < 0.1, "{}", apart(18));
    assert!(apart(20) < 60.0 && apart(20) > 0.0);
    for joint in (0..N_JOINTS).filter(|joint| ![18, 20].contains(joint)) {
        assert!(apart(joint) < 0.1, "{}: {} mm", JOINT_NAMES[joint], apart(joint));
    }
}

#[test]
fn a_body_that_spins_is_never_turned_back() {
    let still = procedural(2)[0];
    let spin = |t: usize| moved(&[still], 0.05 * t as f64, [0.0; 3])[0];
    let bvh = fit_bvh(&(0..200).map(spin).collect::<Vec<_>>(), 20.0).unwrap().bvh;
    let heading = |frame: &[f64]| frame[3];
    assert_eq!(bvh.joints[0].channels[3], Channel::Rotation(Axis::Y));
    let turned = heading(&bvh.frames[199]) - heading(&bvh.frames[0]);
    assert!((turned - (0.1f64 * 199.0).to_degrees()).abs() < 1.0, "{turned}");
    let (step, channel) = largest_step(&bvh);
    assert!(step < 6.0, "{step} of {channel}");
}

#[test]
fn limbs_do_not_spin_and_angles_do_not_flip() {
    for seed in 0..40 {
        let (step, channel) = largest_step(&fit_bvh(&procedural(seed), 20.0).unwrap().bvh);
        assert!(step < 100.0, "{step}° of {channel} in clip {seed}");
    }
}

#[test]
fn the_rest_pose_is_a_t_with_its_left_to_x() {
    let bvh = fit_bvh(&procedural(3), 20.0).unwrap().bvh;
    let zeros = vec![0.0; bvh.n_channels()];
    let rest = Bvh { frames: vec![zeros], ..bvh }.poses().unwrap()[0];
    let [left, right] = [rest[20], rest[21]];
    assert!(left[0] > 0.6 && right[0] < -0.6, "{left:?} {right:?}");
    assert!((left[1] - rest[16][1]).abs() < 1e-6, "the arm is level");
    assert!(rest[15][1] > 0.5 && rest[7][1] < -0.7, "head up, feet down");
    assert!(rest[10][2] > rest[7][2] + 0.1, "feet to the front");
    assert!(rest[1][0] > 0.03 && rest[2][0] < -0.03);
}

#[test]
fn a_body_without_size_and_a_single_frame_are_files_too() {
    let point = fit_bvh(&[[[1.0; 3]; N_JOINTS]; 3], 20.0).unwrap();
    assert!(point.deviation.largest_mm < 1e-3, "{:?}", point.deviation);
    assert!(point.bvh.frames.iter().flatten().all(|value| value.is_finite()));
    assert!(written_and_read_mm(&procedural(4)[..1]) < 1.0);
}

#[test]
fn what_is_no_motion_is_refused_with_its_place() {
    let poses = dance(3);
    assert_eq!(fit_bvh(&[], 20.0), Err(FitBvhError::NoFrames));
    assert_eq!(fit_bvh(&poses, 0.0), Err(FitBvhError::Fps { fps: 0.0 }));
    assert!(fit_bvh(&poses, f32::NAN).is_err());
    let mut broken = poses;
    broken[2][7][1] = f32::NAN;
    let error = fit_bvh(&broken, 20.0).unwrap_err();
    assert_eq!(error, FitBvhError::NotFinite { frame: 2, joint: "left_ankle" });
}
