//! One motion from one file: features, joints, or BVH.

use std::path::Path;

use super::motion_files::MotionFiles;
use super::npy::{NpyProblem, parse_npy};
use super::source::DataError;
use crate::files::{LARGE, read_regular};
use crate::motion::bvh::Bvh;
use crate::motion::retarget::leg_ratio;
use crate::motion::{JOINT_NAMES, N_FEATURES, build_features, recover_joints};

/// How far the frames a second of a file may be from a multiple of those wanted, as a share.
const FPS_TOLERANCE: f64 = 0.01;

/// Features of the motion in a file, row-major `[T, 263]` with T ≥ 1, not normalised, at `fps`
/// frames a second.
///
/// - `.npy` with `[T, 263]`: HumanML3D features, as they are, taken to be at that rate;
/// - `.npy` with `[T + 1, 22, 3]`: places of the joints in metres, y up, likewise;
/// - `.bvh` with the joints of [`JOINT_NAMES`], in centimetres, at a multiple of that rate: every n-th frame,
///   T + 1 of them.
///
/// # Errors
/// The file cannot be read, is none of these, holds too few frames or a number that is not finite.
pub fn read_motion(path: &Path, fps: f64) -> Result<Vec<f32>, DataError> {
    let advice = "give .npy or .bvh files";
    let bytes = read_regular(path, LARGE).map_err(DataError::read(path, advice))?;
    let ending = path.extension().unwrap_or_default().to_ascii_lowercase();
    let features = match ending.to_str() {
        Some("npy") => of_array(&bytes),
        Some("bvh") => of_bvh(&bytes, fps).and_then(of_a_body),
        _ => Err(format!("is no motion that can be read; {advice}")),
    };
    features.and_then(finite).map_err(|problem| DataError::invalid(path.display(), problem))
}

fn of_array(bytes: &[u8]) -> Result<Vec<f32>, String> {
    let told = |problem: NpyProblem| problem.to_string();
    let array = parse_npy(bytes).map_err(told)?;
    match array.shape.len() {
        2 => MotionFiles::FEATURES.features(array).map_err(told),
        3 => MotionFiles::JOINTS.features(array).map_err(told).and_then(of_a_body),
        _ => {
            let expected = "[frames, 263] or [frames, 22, 3]";
            Err(told(NpyProblem::Shape { found: array.shape, expected }))
        }
    }
}

fn of_bvh(bytes: &[u8], fps: f64) -> Result<Vec<f32>, String> {
    let text = std::str::from_utf8(bytes).map_err(|_| "is not UTF-8".to_string())?;
    let bvh = Bvh::parse(text).map_err(|error| error.to_string())?;
    let every = frames_a_frame(1.0 / bvh.frame_time_s, fps)?;
    let has = |name: &str| bvh.joints.iter().any(|joint| joint.name == name);
    let poses = bvh.poses().ok_or_else(|| {
        let missing: Vec<&str> = JOINT_NAMES.into_iter().filter(|name| !has(name)).collect();
        format!("lacks joints of the skeleton of 22: {}", missing.join(", "))
    })?;
    let poses: Vec<_> = poses.into_iter().step_by(every).collect();
    match poses.len() {
        0 | 1 => Err("has too few frames: features want two".to_string()),
        _ => Ok(build_features(&poses)),
    }
}

/// The frames of a file that pass in one frame at the wanted rate.
fn frames_a_frame(fps: f64, wanted: f64) -> Result<usize, String> {
    let every = (fps / wanted).round().max(1.0);
    if (fps / (every * wanted) - 1.0).abs() > FPS_TOLERANCE {
        return Err(format!("has {fps:.4} frames a second, which is no multiple of {wanted}"));
    }
    Ok(every as usize)
}

/// Joints that lie on one another have no direction, and features of them no value.
fn finite(features: Vec<f32>) -> Result<Vec<f32>, String> {
    match features.iter().position(|value| !value.is_finite()) {
        None => Ok(features),
        Some(at) => {
            let (frame, column) = (at / N_FEATURES, at % N_FEATURES);
            Err(format!("makes a feature that is not finite, number {column} of frame {frame}"))
        }
    }
}

/// Legs shorter or longer by these factors are of another unit of length.
const LEGS: [f64; 2] = [0.2, 5.0];

/// A body whose legs are a hundredth or a hundred times as long is one in another unit.
fn of_a_body(features: Vec<f32>) -> Result<Vec<f32>, String> {
    let factor = leg_ratio(&recover_joints(&features));
    // Numbers that are not finite have an error of their own.
    if !factor.is_finite() {
        return Ok(features);
    }
    let [shortest, longest] = LEGS;
    if (shortest..=longest).contains(&factor) {
        return Ok(features);
    }
    Err(format!(
        "has legs {factor:.3} times as long as a body's: joints are in metres, BVH is in centimetres; `isoflop \
         data import` reads other units"
    ))
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;
    use crate::data::fixtures::npy_bytes;
    use crate::motion::bvh::fit_bvh;
    use crate::motion::synth::Script;
    use crate::motion::{Pose, mpjpe_mm};
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::SeedableRng;

    /// The first frames of a motion.
    fn walk(n: usize) -> Vec<Pose> {
        Script::sample(&mut ChaCha8Rng::seed_from_u64(3)).poses()[..n].to_vec()
    }

    fn read(name: &str, bytes: &[u8]) -> Result<Vec<f32>, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        fs::write(&path, bytes).unwrap();
        read_motion(&path, 20.0).map_err(|error| error.to_string())
    }

    fn joints(poses: &[Pose]) -> Vec<u8> {
        npy_bytes(&[poses.len() as u64, 22, 3], poses.as_flattened().as_flattened())
    }

    #[test]
    fn features_joints_and_bvh_of_a_motion_are_one_motion() {
        let poses = walk(21);
        let features = build_features(&poses);
        assert_eq!(read("a.npy", &joints(&poses)).as_ref(), Ok(&features));
        assert_eq!(read("a.NPY", &npy_bytes(&[20, 263], &features)).as_ref(), Ok(&features));
        let bvh = fit_bvh(&poses, 20.0).unwrap().bvh.to_string();
        let of_bvh = read("a.bvh", bvh.as_bytes()).unwrap();
        let off = mpjpe_mm(&recover_joints(&features), &recover_joints(&of_bvh));
        assert!(of_bvh.len() == features.len() && off < 2.0, "{off} mm");
    }

    #[test]
    fn a_file_of_more_frames_a_second_gives_every_nth() {
        let bvh = |fps| fit_bvh(&walk(21), fps).unwrap().bvh.to_string();
        let rows = |fps| read("a.bvh", bvh(fps).as_bytes()).map(|x| x.len() / N_FEATURES);
        assert_eq!((rows(60.0), rows(120.0)), (Ok(6), Ok(3)));
        let problem = rows(30.0).unwrap_err();
        assert!(problem.contains("has 30.0000 frames a second, which is no multiple"), "{problem}");
    }

    #[test]
    fn a_body_in_another_unit_is_refused() {
        let in_unit = |factor: f32| {
            let scaled = |pose: &Pose| pose.map(|place| place.map(|x| x * factor));
            let poses: Vec<Pose> = walk(21).iter().map(scaled).collect();
            [
                read("a.npy", &joints(&poses)),
                read("a.bvh", fit_bvh(&poses, 20.0).unwrap().bvh.to_string().as_bytes()),
            ]
        };
        assert!(in_unit(1.0).iter().chain(&in_unit(1.3)).all(Result::is_ok));
        for told in in_unit(0.01).into_iter().chain(in_unit(100.0)) {
            let problem = told.unwrap_err();
            assert!(problem.contains("times as long as a body's"), "{problem}");
        }
    }

    #[test]
    fn what_is_no_motion_is_told_by_name() {
        let cases = [
            ("a.npy", npy_bytes(&[2, 251], &[0f32; 502]), "where [frames, 263] is needed"),
            ("a.npy", npy_bytes(&[2, 21, 3], &[0f32; 126]), "where [frames, 22, 3], two frames"),
            ("a.npy", npy_bytes(&[1, 22, 3], &[0f32; 66]), "two frames or more"),
            ("a.npy", npy_bytes(&[526], &[0f32; 526]), "[frames, 263] or [frames, 22, 3]"),
            ("a.npy", npy_bytes(&[2, 263], &[f32::NAN; 526]), "not finite, the first at [0, 0]"),
            ("a.csv", b"1,2".to_vec(), "no motion that can be read; give .npy or .bvh files"),
            ("a.bvh", b"HIERARCHY".to_vec(), "the line MOTION"),
        ];
        for (name, bytes, words) in cases {
            let problem = read(name, &bytes).unwrap_err();
            assert!(problem.contains(name) && problem.contains(words), "{problem}");
        }
        let bvh = fit_bvh(&walk(9), 20.0).unwrap().bvh.to_string().replace("left_hip", "hip");
        let problem = read("a.bvh", bvh.as_bytes()).unwrap_err();
        assert!(problem.contains("lacks joints of the skeleton of 22: left_hip"), "{problem}");
        let problem = read_motion(Path::new("no/such.npy"), 20.0).unwrap_err().to_string();
        assert!(problem.contains("cannot read no/such.npy"), "{problem}");
    }
}
