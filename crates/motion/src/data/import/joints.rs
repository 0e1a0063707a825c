//! `.npy` files of joints' places as poses of HumanML3D's skeleton.

use rayon::prelude::*;

use super::listing::{Listing, SourceFile};
use super::options::{Form, ImportError, ImportOptions, Motion, Motions};
use crate::data::FPS;
use crate::data::npy::{NpyArray, NpyProblem, parse_npy};
use crate::motion::geometry::{Point, add, scale, sub};
use crate::motion::retarget::{PointsError, Pose64, Settled, reflected, settled};
use crate::motion::{N_JOINTS, feature_width, recover_body};

/// Reads every file.
///
/// # Errors
/// [`ImportError::Fps`].
pub fn read(listing: &Listing, options: &ImportOptions) -> Result<Motions, ImportError> {
    let of_layout = match options.form {
        Form::Kit => Some(KIT_FPS),
        _ => listing.humanml3d.then_some(FPS),
    };
    let fps = options.fps.or(of_layout).ok_or(ImportError::Fps)?;
    let one = |file: &SourceFile| motion(file, fps, options);
    let motions = listing.files.par_iter().map(one).collect();
    Ok(Motions { motions, skeletons: Vec::new(), draft: None })
}

fn motion(file: &SourceFile, fps: f64, options: &ImportOptions) -> Result<Motion, String> {
    let array = parse_npy(&file.read()?).map_err(|problem| problem.to_string())?;
    let settle = |poses: Result<Vec<Pose64>, NpyProblem>| {
        let poses = poses.map_err(|problem| problem.to_string())?;
        let hand = |pose: Pose64| if options.left_handed { pose.map(reflected) } else { pose };
        let poses: Vec<Pose64> = poses.into_iter().map(hand).collect();
        Ok::<_, String>(settled(&poses, options.up))
    };
    let found = match options.form {
        // The toes decide the sides: sources disagree on which comes first.
        Form::Kit => match settle(of_kit(&array, RIGHT_FIRST))? {
            Err(PointsError::Backwards) => settle(of_kit(&array, LEFT_FIRST))?,
            found => found,
        },
        form => settle(of_humanml3d(&array, form))?,
    };
    let Settled { poses, unit_m } = found.map_err(|error| error.to_string())?;
    Ok(Motion { poses: options.rate.of(&poses, fps), fps, unit_m, remark: None })
}

fn of_humanml3d(array: &NpyArray, form: Form) -> Result<Vec<Pose64>, NpyProblem> {
    let (expected, most) = match form {
        Form::SmplxJoints => ("[frames, 22 or more, 3], two frames or more,", usize::MAX),
        _ => ("[frames, 22, 3], two frames or more,", N_JOINTS),
    };
    match array.shape[..] {
        [t, n, 3] if t > 1 && (N_JOINTS..=most).contains(&n) => Ok(bodies(&array.values, n)),
        _ => Err(NpyProblem::Shape { found: array.shape.clone(), expected }),
    }
}

/// The joints of KIT-ML, given as they are or as the features made of them.
fn of_kit(array: &NpyArray, sides: [usize; 2]) -> Result<Vec<Pose64>, NpyProblem> {
    let wide = |body: [[f32; 3]; JOINTS]| body.map(|place| place.map(f64::from));
    let bodies = match array.shape[..] {
        [t, JOINTS, 3] if t > 1 => bodies(&array.values, JOINTS),
        [t, FEATURES] if t > 1 => recover_body(&array.values).into_iter().map(wide).collect(),
        _ => {
            let expected = "[frames, 21, 3] or [frames, 251], two frames or more,";
            return Err(NpyProblem::Shape { found: array.shape.clone(), expected });
        }
    };
    Ok(bodies.iter().map(|body| pose_of(body, sides)).collect())
}

/// The first `J` joints of bodies that have `n_joints`.
fn bodies<const J: usize>(values: &[f32], n_joints: usize) -> Vec<[Point; J]> {
    let place = |frame: &[f32], at: usize| std::array::from_fn(|i| f64::from(frame[3 * at + i]));
    let body = |frame: &[f32]| std::array::from_fn(|joint| place(frame, joint));
    values.chunks_exact(3 * n_joints).map(body).collect()
}

// KIT-ML's 21 joints (Plappert et al. 2016), in the order of text-to-motion, as the 22 of HumanML3D.
//
// Pelvis, belly, chest, lower and upper neck; shoulder, elbow and wrist of one side and of the other; hip, knee,
// ankle, ball of the foot and toes likewise. Millimetres, 12.5 frames per second.

/// Joints of KIT-ML's body.
const JOINTS: usize = 21;
/// Features of a frame, if a file has them.
const FEATURES: usize = feature_width(JOINTS);
/// Frames per second of KIT-ML's files.
const KIT_FPS: f64 = 12.5;

/// The sides, 0 the left, of the joints 5 to 7 and 11 to 15 and of those after them: as text-to-motion reads them.
const RIGHT_FIRST: [usize; 2] = [1, 0];
/// The same as the order of their names has them.
const LEFT_FIRST: [usize; 2] = [0, 1];

/// Position of HumanML3D's collar between neck, shoulder and chest: by least squares over moving bodies, 6 mm off an
/// axis.
const COLLAR: [f64; 2] = [0.37, 0.28];
/// Position of the second joint of the spine between the first and the third, likewise.
const SPINE: f64 = 0.73;

/// A pose of KIT-ML as HumanML3D's joints. Missing joints are placed between existing ones.
fn pose_of(joints: &[Point; JOINTS], sides: [usize; 2]) -> Pose64 {
    let [chest, neck] = [joints[2], joints[3]];
    let between = |a: Point, share: f64, b: Point| add(a, scale(sub(b, a), share));
    let mut pose = [[0.0; 3]; N_JOINTS];
    let trunk = [(0, joints[0]), (3, joints[1]), (6, between(joints[1], SPINE, chest)), (9, chest)];
    trunk.into_iter().chain([(12, neck), (15, joints[4])]).for_each(|(i, place)| pose[i] = place);
    // Of HumanML3D's joints those of the left come first.
    for (kit, side) in sides.into_iter().enumerate() {
        let (arm, leg) = (&joints[5 + 3 * kit..], &joints[11 + 5 * kit..]);
        let [out, down] = COLLAR;
        let low = between(neck, down, chest);
        pose[13 + side] = add(low, scale(sub(arm[0], neck), out));
        (0..3).for_each(|i| pose[16 + 2 * i + side] = arm[i]);
        (0..4).for_each(|i| pose[1 + 3 * i + side] = leg[i]);
    }
    pose
}

#[cfg(test)]
mod tests {
    use super::super::tests::{motion as long_motion, options};
    use super::super::{Rate, import};
    use super::*;
    use crate::data::npy::npy_bytes;
    use crate::motion::{JOINT_NAMES, Pose, build_features, mpjpe_mm, recover_joints};
    use std::fs;
    use std::path::Path;

    #[test]
    fn every_joint_has_its_place() {
        // Joint i of KIT-ML lies at x = i.
        let joints: [Point; JOINTS] = std::array::from_fn(|i| [i as f64, 0.0, 0.0]);
        let named = |sides| {
            let pose = pose_of(&joints, sides);
            JOINT_NAMES.into_iter().zip(pose.map(|place| place[0])).collect::<Vec<_>>()
        };
        let right = named(RIGHT_FIRST);
        let at = |name: &str| right.iter().find(|(own, _)| *own == name).unwrap().1;
        assert_eq!(["right_wrist", "left_wrist", "head"].map(at), [7.0, 10.0, 4.0]);
        assert_eq!(["right_hip", "right_ankle", "right_foot"].map(at), [11.0, 13.0, 14.0]);
        assert_eq!(["left_hip", "left_knee", "spine2"].map(at), [16.0, 17.0, 1.73]);
        let left = named(LEFT_FIRST);
        assert!(left.contains(&("left_wrist", 7.0)) && left.contains(&("right_foot", 19.0)));
    }

    /// The 21 joints that KIT-ML would have of a pose, in millimetres, one side or the other first.
    fn as_kit(pose: &Pose, sides: [usize; 2]) -> Vec<f32> {
        let mut joints = vec![pose[0], pose[3], pose[9], pose[12], pose[15]];
        for side in sides {
            joints.extend([16, 18, 20].map(|joint| pose[joint + side]));
        }
        for side in sides {
            joints.extend([1, 4, 7, 10].map(|joint| pose[joint + side]));
            let (ankle, ball) = (pose[7 + side], pose[10 + side]);
            joints.push(std::array::from_fn(|i| ball[i] + 0.4 * (ball[i] - ankle[i])));
        }
        joints.into_flattened().into_iter().map(|metres| 1000.0 * metres).collect()
    }

    /// A folder in KIT-ML's layout, a clip a split; `array` makes a file of its poses.
    fn kit_folder(place: &str, array: impl Fn(&[Pose]) -> Vec<u8>) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        fs::create_dir_all(folder.path().join(place)).unwrap();
        fs::create_dir_all(folder.path().join("texts")).unwrap();
        for (i, split) in ["train", "val", "test"].into_iter().enumerate() {
            fs::write(
                folder.path().join(format!("{place}/0000{i}.npy")),
                array(&long_motion(i as u64, 80)),
            )
            .unwrap();
            fs::write(folder.path().join(format!("texts/0000{i}.txt")), "he moves##0.0#0.0\n")
                .unwrap();
            fs::write(folder.path().join(format!("{split}.txt")), format!("0000{i}\n")).unwrap();
        }
        folder
    }

    fn kit_joints(sides: [usize; 2]) -> tempfile::TempDir {
        kit_folder("new_joints", |poses| {
            let values: Vec<f32> = poses.iter().flat_map(|pose| as_kit(pose, sides)).collect();
            npy_bytes(&[80, 21, 3], &values)
        })
    }

    /// What KIT-ML's features say of joints: steps and places, of which those of HumanML3D are one.
    fn kit_features() -> tempfile::TempDir {
        kit_folder("new_joint_vecs", |poses| {
            let row = |row: &[f32]| {
                let mut local = [[0.0, row[3], 0.0]; 22];
                let places = local[1..].iter_mut().zip(row[4..67].chunks(3));
                places.for_each(|(joint, place)| joint.copy_from_slice(place));
                let mut own = vec![row[0], 1000.0 * row[1], 1000.0 * row[2], 1000.0 * row[3]];
                own.extend(&as_kit(&local, [1, 0])[3..]);
                own.resize(251, 0.0);
                own
            };
            let features = build_features(poses);
            let values: Vec<f32> = features.chunks(263).flat_map(row).collect();
            npy_bytes(&[79, 251], &values)
        })
    }

    /// The features of a data set's clip.
    fn features(set: &Path, clip: &str) -> Vec<f32> {
        let bytes = fs::read(set.join(format!("new_joint_vecs/{clip}.npy"))).unwrap();
        parse_npy(&bytes).unwrap().values
    }

    #[test]
    fn kit_ml_is_imported_whichever_side_comes_first() {
        let (right, left, to) =
            (kit_joints([1, 0]), kit_joints([0, 1]), tempfile::tempdir().unwrap());
        let kept = |from: &Path| ImportOptions { rate: Rate::Kept, ..options(from, Form::Kit) };
        let imported = import(&kept(right.path()), &to.path().join("right")).unwrap();
        let clips = imported.splits.map(|split| split.clips);
        assert_eq!((imported.fps, clips), (12.5, [1, 1, 1]));
        import(&kept(left.path()), &to.path().join("left")).unwrap();
        let of = |name: &str| features(&to.path().join(name), "00000");
        assert!(of("right") == of("left"), "sides are told by the toes");
        let truth = recover_joints(&build_features(&long_motion(0, 80)));
        let off = mpjpe_mm(&recover_joints(&of("right")), &truth);
        assert!(off < 10.0, "{off} mm: collars and spine are guessed, limbs are not");
        let faster = import(&options(right.path(), Form::Kit), &to.path().join("faster")).unwrap();
        assert_eq!((faster.fps, faster.splits[0].frames), (20.0, 126));
    }

    #[test]
    fn features_of_kit_ml_give_the_motions_of_its_joints() {
        let (joints, vectors, to) =
            (kit_joints([1, 0]), kit_features(), tempfile::tempdir().unwrap());
        let kept = |from: &Path| ImportOptions { rate: Rate::Kept, ..options(from, Form::Kit) };
        import(&kept(joints.path()), &to.path().join("joints")).unwrap();
        import(&kept(vectors.path()), &to.path().join("vectors")).unwrap();
        let [given, told] = ["joints", "vectors"]
            .map(|set| recover_joints(&features(&to.path().join(set), "00001")));
        assert_eq!((given.len(), told.len()), (79, 78), "features are of one frame less");
        let off = mpjpe_mm(&told, &given[..78]);
        assert!(off < 0.1, "{off} mm");
    }
}
