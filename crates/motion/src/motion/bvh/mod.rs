//! BVH: a hierarchy of joints with offsets, and their channels frame by frame, as text.
//!
//! Data flows one way in each direction:
//!
//! - poses → [`fit_bvh`] (rest pose, rotations, Euler angles) → [`Bvh`] → text, by `Display`, or GLB, by
//!   [`Bvh::to_glb`];
//! - text → [`Bvh::parse`] → [`Bvh`] → [`Bvh::positions`] (forward kinematics).
//!
//! Files are written in centimetres and degrees, y up, the rest pose facing +z. The rotations come
//! from the joints' positions, never from the 6-D columns of the features: those begin the arms at
//! the root's rotation, which no ordinary hierarchy does.

mod fit;
mod glb;
mod hierarchy;
mod text;

pub use fit::{Deviation, FitBvhError, FittedBvh, fit_bvh};
pub use hierarchy::{Axis, Bvh, BvhJoint, Channel, Placed};
pub use text::BvhError;

#[cfg(test)]
mod tests {
    use std::fs;
    use std::path::PathBuf;

    use proptest::prelude::*;

    use super::*;
    use crate::data::parse_npy;
    use crate::motion::fixtures::{dance, moved, procedural, real};
    use crate::motion::{BONE_LENGTHS, JOINT_NAMES, N_JOINTS, Pose, recover_joints};

    /// The largest distance in millimetres between `poses` and the text of their file, read again.
    fn written_and_read_mm(poses: &[Pose]) -> f64 {
        let text = fit_bvh(poses, 20.0).expect("sound poses").bvh.to_string();
        let read = Bvh::parse(&text).expect("a sound file").poses().expect("our own names");
        assert_eq!(read.len(), poses.len());
        let joints = poses.as_flattened().iter().zip(read.as_flattened());
        let squared = |(a, b): (&[f32; 3], &[f32; 3])| {
            (0..3).map(|c| f64::from(a[c] - b[c]).powi(2)).sum::<f64>()
        };
        joints.map(squared).fold(0.0, f64::max).sqrt() * 1000.0
    }

    /// The largest change in degrees of a rotation channel from frame to frame, with its joint.
    fn largest_step(bvh: &Bvh) -> (f64, String) {
        let names = bvh.joints.iter().flat_map(|joint| {
            joint.channels.iter().map(|channel| (format!("{} {channel:?}", joint.name), *channel))
        });
        let names: Vec<(String, Channel)> = names.collect();
        let mut largest = (0.0, String::new());
        for pair in bvh.frames.windows(2) {
            for (index, (name, channel)) in names.iter().enumerate() {
                let step = (pair[1][index] - pair[0][index]).abs();
                if matches!(channel, Channel::Rotation(_)) && step > largest.0 {
                    largest = (step, name.clone());
                }
            }
        }
        largest
    }

    // Positions into rotations.

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
        assert!(
            largest_mm > 10.0 && mean_mm > 1.0 && mean_mm < largest_mm,
            "{largest_mm} {mean_mm}"
        );
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

    // Text into hierarchies and back.

    const SAMPLE: &str = "HIERARCHY
ROOT Hips {
  OFFSET 1 2 3
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT Left Leg
  {
    CHANNELS 1 xrotation
    OFFSET 0 -10 0
    End Site
    {
      OFFSET 0 -5 0
    }
  }
  JOINT tail
  {
    OFFSET 0 0 -4
    CHANNELS 2 Yposition Xrotation
  }
}
MOTION
Frames:\t2
Frame Time: .05
0 0 0  0 0 0  0  0 0
1 20 3  0 0 90  90  7 0
";

    fn error(text: &str) -> String {
        Bvh::parse(text).expect_err("a broken file").to_string()
    }

    fn assert_close(a: [f64; 3], b: [f64; 3]) {
        assert!((0..3).all(|c| (a[c] - b[c]).abs() < 1e-9), "{a:?} is not {b:?}");
    }

    #[test]
    fn channels_of_any_kind_place_the_joints() {
        let bvh = Bvh::parse(SAMPLE).unwrap();
        assert_eq!((bvh.n_channels(), bvh.frame_time_s), (9, 0.05));
        assert_eq!(bvh.joints[1].name, "Left Leg");
        assert_eq!(bvh.joints[1].end_sites, [[0.0, -5.0, 0.0]]);
        let [first, second] = &bvh.positions()[..] else { panic!("two frames") };
        // Position channels replace OFFSET, each its own number.
        assert_eq!(first[..], [[0.0; 3], [0.0, -10.0, 0.0], [0.0, 0.0, -4.0]]);
        assert_close(second[0], [1.0, 20.0, 3.0]);
        assert_close(second[1], [1.0, 10.0, 3.0]);
        // A quarter turn about y takes -z to -x.
        assert_close(second[2], [-3.0, 27.0, 3.0]);
    }

    #[test]
    fn rotations_apply_from_right_to_left() {
        let turned = |order: &str| {
            let text = format!(
                "HIERARCHY\nROOT a\n{{\nCHANNELS 3 {order}\nJOINT b\n{{\nOFFSET 1 0 0\n}}\n}}\n\
                 MOTION\nFrames: 1\nFrame Time: 1\n90 90 0\n"
            );
            Bvh::parse(&text).unwrap().positions()[0][1]
        };
        // Y takes x to -z, and Z leaves that; Z takes x to y, and Y leaves that.
        assert_close(turned("Zrotation Yrotation Xrotation"), [0.0, 0.0, -1.0]);
        assert_close(turned("Yrotation Zrotation Xrotation"), [0.0, 1.0, 0.0]);
    }

    #[test]
    fn what_is_written_reads_as_the_same() {
        let sample = Bvh::parse(SAMPLE).unwrap();
        assert_eq!(Bvh::parse(&sample.to_string()).unwrap(), sample);
        let own = fit_bvh(&procedural(5), 20.0).unwrap().bvh;
        assert_eq!(Bvh::parse(&own.to_string()).unwrap(), own);
        let windows = own.to_string().replace('\n', "\r\n");
        assert_eq!(Bvh::parse(&format!("\u{feff}{windows}\r\n")).unwrap(), own);
    }

    #[test]
    fn several_roots_are_read_and_written() {
        let text = "HIERARCHY\nROOT a\n{\nOFFSET 0 0 0\nCHANNELS 0\n}\nROOT b\n{\nOFFSET 1 0 0\n\
                    CHANNELS 1 Yposition\n}\nMOTION\nFrames: 1\nFrame Time: 1\n4\n";
        let bvh = Bvh::parse(text).unwrap();
        assert_eq!(bvh.positions()[0], [[0.0; 3], [1.0, 4.0, 0.0]]);
        assert_eq!(Bvh::parse(&bvh.to_string()).unwrap(), bvh);
    }

    #[test]
    fn every_fault_names_its_line_and_what_is_expected() {
        let broken = |from: &str, to: &str| error(&SAMPLE.replacen(from, to, 1));
        assert_eq!(
            error(""),
            "the file ends at line 0, where the line MOTION is expected: it is cut short"
        );
        assert_eq!(
            error("clip,frames\nMOTION\n"),
            "line 1: HIERARCHY is expected, here is \"clip,frames\""
        );
        assert_eq!(
            error("HIERARCHY\nMOTION\n"),
            "the file ends at line 1, where ROOT is expected: it is cut short"
        );
        assert_eq!(
            broken("xrotation", "rotX"),
            "line 7: a channel such as Xrotation or Yposition is expected, here is \"rotX\""
        );
        assert_eq!(
            broken("OFFSET 0 -10 0", "OFFSET 0 -10"),
            "line 9: a number of the OFFSET is expected, here is \"End\""
        );
        assert_eq!(
            broken("0 0 -4", "0 nan -4"),
            "line 16: a number of the OFFSET is expected, here is \"nan\""
        );
        assert_eq!(
            broken("  }\n}\n", "  }\n"),
            "the file ends at line 18, where } is expected: it is cut short"
        );
        assert_eq!(
            broken("ROOT Hips {", "JOINT Hips {"),
            "line 2: ROOT or MOTION is expected, here is \"JOINT\""
        );
        assert_eq!(
            broken("Frames:\t2", "Frames: two"),
            "line 21: \"Frames:\" and a count is expected, here is \"Frames: two\""
        );
        assert_eq!(
            broken(".05", "0"),
            "line 22: \"Frame Time:\" and seconds above zero is expected, here is \"Frame Time: 0\""
        );
        assert_eq!(
            broken("  7 0\n", "  7\n"),
            "line 24: a frame of this hierarchy has 9 numbers, here are 8"
        );
        assert_eq!(broken("90  7", "9o  7"), "line 24: a number is expected, here is \"9o\"");
        assert_eq!(
            broken("Frames:\t2", "Frames: 3"),
            "line 21 announces 3 frames, 2 follow; correct the number or the frames"
        );
    }

    // Real captures, which say so where they are not at hand.

    /// The files below a folder of real motion whose names end so.
    fn files_below(folder: &str, ending: &str) -> Vec<PathBuf> {
        let Some(folder) = real(folder) else { return Vec::new() };
        let paths = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
        let mut paths: Vec<PathBuf> =
            paths.filter(|path| path.to_string_lossy().ends_with(ending)).collect();
        paths.sort();
        paths
    }

    /// One clip of six: all of them take ten seconds.
    #[test]
    fn real_clips_deviate_by_less_than_a_millimetre() {
        for path in files_below("cmu-motion/new_joint_vecs", ".npy").iter().step_by(6) {
            let features = parse_npy(&fs::read(path).unwrap()).unwrap().values;
            let fitted = fit_bvh(&recover_joints(&features), 20.0).unwrap();
            let Deviation { largest_mm, mean_mm } = fitted.deviation;
            assert!(largest_mm < 1.0 && mean_mm > 0.0, "{}: {largest_mm} mm", path.display());
        }
    }

    #[test]
    fn the_text_of_real_clips_is_read_back_within_a_millimetre() {
        for path in files_below("cmu-motion/check", ".joints.npy") {
            let joints = parse_npy(&fs::read(&path).unwrap()).unwrap().values;
            let (joints, _) = joints.as_chunks::<3>();
            let (poses, _) = joints.as_chunks::<22>();
            let mm = written_and_read_mm(poses);
            assert!(mm < 1.0, "{}: {mm} mm", path.display());
        }
    }

    #[test]
    fn files_of_four_skeletons_are_read() {
        let folders = ["bvh", "bvh/bandai", "bandai-motion/check"];
        for path in folders.iter().flat_map(|folder| files_below(folder, ".bvh")) {
            let text = fs::read_to_string(&path).unwrap();
            let bvh = Bvh::parse(&text).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
            let positions = bvh.positions();
            assert!(positions.len() > 30 && bvh.joints.len() > 18, "{}", path.display());
            assert!(positions.iter().flatten().flatten().all(|c| c.is_finite()));
            assert_eq!(bvh.frames.len(), positions.len());
        }
    }
}
