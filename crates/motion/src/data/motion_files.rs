//! Motion from files: how a folder holds it and at how many frames per second, and one motion from one file.

use std::io::ErrorKind;
use std::ops::RangeInclusive;
use std::path::Path;

use serde::Deserialize;

use super::look::Finding;
use super::npy::{NpyArray, NpyProblem, parse_npy};
use super::source::DataError;
use crate::files::{LARGE, SMALL, as_written, read_regular};
use crate::motion::bvh::Bvh;
use crate::motion::retarget::Stance;
use crate::motion::{JOINT_NAMES, N_FEATURES, N_JOINTS, Pose, build_features_at, recover_joints};

/// The content of a folder's motion files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MotionFiles {
    pub folder: &'static str,
    /// The shape of each, in words.
    shape: &'static str,
    /// Their word in the digest of a data set; changes with the computation of features.
    pub rule: &'static str,
}

impl MotionFiles {
    /// `[T, 263]`.
    pub const FEATURES: Self = Self { folder: "new_joint_vecs", shape: "[frames, 263]", rule: "" };
    /// The same, in Motion-X's layout.
    pub const MOTION_X: Self = Self { folder: "vector_263", ..Self::FEATURES };
    /// `[T + 1, 22, 3]`, metres, y up.
    pub const JOINTS: Self = Self {
        folder: "new_joints",
        shape: "[frames, 22, 3], two frames or more,",
        rule: " joints-1",
    };

    /// The files of the folder `root`; features if it has both.
    pub fn of(root: &Path) -> Option<Self> {
        [Self::FEATURES, Self::MOTION_X, Self::JOINTS]
            .into_iter()
            .find(|files| root.join(files.folder).is_dir())
    }

    /// Whether clips lie in folders below, so that their names have `/` in them.
    pub fn in_folders(self) -> bool {
        self == Self::MOTION_X
    }

    /// The folder of captions in the folder `root`.
    pub fn texts(self, root: &Path) -> &'static str {
        const LABELS: &str = "texts/semantic_labels";
        let has_labels = self == Self::MOTION_X && root.join(LABELS).is_dir();
        if has_labels { LABELS } else { "texts" }
    }

    /// Name within the data set of the motion of clip `id`.
    pub fn name(self, id: &str) -> String {
        format!("{}/{id}.npy", self.folder)
    }

    /// Features `[T, 263]`, row-major, T ≥ 1, of `fps` frames a second.
    ///
    /// # Errors
    /// The array has another shape.
    pub fn features(self, array: NpyArray, fps: f64) -> Result<Vec<f32>, NpyProblem> {
        match (self, &array.shape[..]) {
            (Self::FEATURES | Self::MOTION_X, &[t, N_FEATURES]) if t > 0 => Ok(array.values),
            (Self::JOINTS, &[t, N_JOINTS, 3]) if t > 1 => {
                Ok(build_features_at(&poses(&array.values), fps))
            }
            _ => Err(NpyProblem::Shape { found: array.shape, expected: self.shape }),
        }
    }
}

fn poses(values: &[f32]) -> Vec<Pose> {
    let pose = |frame: &[f32]| std::array::from_fn(|j| std::array::from_fn(|i| frame[3 * j + i]));
    values.chunks_exact(N_JOINTS * 3).map(pose).collect()
}

// Frames per second of a folder.

/// Frames per second of HumanML3D's files.
pub const FPS: f64 = 20.0;
/// Frames per second of Motion-X's files, which are not resampled.
const MOTION_X: f64 = 30.0;
/// The facts that an import stored in the folder.
const IMPORT: &str = "import.json";

/// The part that is read; a file of that name by another program is ignored.
#[derive(Deserialize)]
struct Import {
    fps: Option<f64>,
}

/// Frames per second of the files in `root`: stored by its import, `told`, or the layout's.
///
/// # Errors
/// The import's file cannot be read, or contradicts `told`.
pub fn frame_rate(root: &Path, files: MotionFiles, told: Option<f64>) -> Result<f64, DataError> {
    let by_layout = if files == MotionFiles::MOTION_X { MOTION_X } else { FPS };
    match (imported(root)?, told) {
        (Some(fps), Some(told)) if fps != told => Err(DataError::invalid(
            root.join(IMPORT).display(),
            format!("{fps} frames a second, where data.fps is {told}"),
        )),
        (imported, told) => Ok(imported.or(told).unwrap_or(by_layout)),
    }
}

fn imported(root: &Path) -> Result<Option<f64>, DataError> {
    let path = root.join(IMPORT);
    let invalid = |problem: String| DataError::invalid(path.display(), problem);
    let advice = "`isoflop data import` writes it";
    let bytes = match read_regular(&path, SMALL) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
        bytes => bytes.map_err(DataError::read(&path, advice))?,
    };
    let bytes = as_written(&path, bytes).map_err(|error| invalid(error.to_string()))?;
    let import: Import =
        serde_json::from_slice(&bytes).map_err(|error| invalid(error.to_string()))?;
    match import.fps {
        // Numbers that single precision holds.
        Some(fps) if !(1e-6..=1e6).contains(&fps) => {
            Err(invalid(format!("{fps} frames a second are no rate")))
        }
        fps => Ok(fps),
    }
}

// One motion from one file: features, joints, or BVH.

/// Relative tolerance of a file's rate from a multiple of the requested one.
const FPS_TOLERANCE: f64 = 0.01;

/// Features of the motion in a file, row-major `[T, 263]` with T ≥ 1, not normalised, at `fps`
/// frames per second.
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
        Some("npy") => of_array(&bytes, fps),
        Some("bvh") => of_bvh(&bytes, fps).and_then(of_a_body),
        _ => Err(format!("is no motion that can be read; {advice}")),
    };
    features.and_then(finite).map_err(|problem| DataError::invalid(path.display(), problem))
}

fn of_array(bytes: &[u8], fps: f64) -> Result<Vec<f32>, String> {
    let told = |problem: NpyProblem| problem.to_string();
    let array = parse_npy(bytes).map_err(told)?;
    match array.shape.len() {
        2 => MotionFiles::FEATURES.features(array, fps).map_err(told),
        3 => MotionFiles::JOINTS.features(array, fps).map_err(told).and_then(of_a_body),
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
        _ => Ok(build_features_at(&poses, fps)),
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
    let Some(at) = features.iter().position(|value| !value.is_finite()) else {
        return Ok(features);
    };
    let (frame, column) = (at / N_FEATURES, at % N_FEATURES);
    Err(format!("makes a feature that is not finite, number {column} of frame {frame}"))
}

/// Legs shorter or longer by these factors are of another unit of length: inches for centimetres are among them.
const LEGS: RangeInclusive<f64> = 0.5..=2.0;

/// A body whose legs are half or twice as long is one in another unit.
fn of_a_body(features: Vec<f32>) -> Result<Vec<f32>, String> {
    let Stance { legs, .. } = Stance::of(&recover_joints(&features));
    // Numbers that are not finite have an error of their own.
    if !legs.is_finite() || LEGS.contains(&legs) {
        return Ok(features);
    }
    Err(format!("is in another unit: {}", Finding::Scale(legs)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::npy::npy_bytes;
    use crate::motion::build_features;
    use crate::motion::bvh::fit_bvh;
    use crate::motion::fixtures::procedural;
    use crate::motion::mpjpe_mm;
    use std::fs;

    #[test]
    fn the_import_the_sweep_and_the_layout_tell_in_this_order() {
        let root = tempfile::tempdir().unwrap();
        let rate =
            |files, told| frame_rate(root.path(), files, told).map_err(|error| error.to_string());
        assert_eq!(rate(MotionFiles::FEATURES, None), Ok(20.0));
        assert_eq!(rate(MotionFiles::MOTION_X, None), Ok(30.0));
        assert_eq!(rate(MotionFiles::MOTION_X, Some(25.0)), Ok(25.0));
        fs::write(root.path().join(IMPORT), r#"{"fps": 60.0, "form": "bvh"}"#).unwrap();
        assert_eq!(rate(MotionFiles::FEATURES, None), Ok(60.0));
        assert_eq!(rate(MotionFiles::FEATURES, Some(60.0)), Ok(60.0));
        let told = rate(MotionFiles::FEATURES, Some(30.0)).unwrap_err();
        assert!(told.contains("60 frames a second, where data.fps is 30"), "{told}");
        fs::write(root.path().join(IMPORT), r#"{"by": "somebody else"}"#).unwrap();
        assert_eq!(rate(MotionFiles::FEATURES, None), Ok(20.0));
        fs::write(root.path().join(IMPORT), r#"{"fps": 0}"#).unwrap();
        assert!(rate(MotionFiles::FEATURES, None).unwrap_err().contains("are no rate"));
    }

    /// The first frames of a motion.
    fn walk(n: usize) -> Vec<Pose> {
        procedural(3)[..n].to_vec()
    }

    fn read(name: &str, bytes: &[u8]) -> Result<Vec<f32>, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        fs::write(&path, bytes).unwrap();
        read_motion(&path, 20.0).map_err(|error| error.to_string())
    }

    fn joints(poses: &[Pose]) -> Vec<u8> {
        npy_bytes(&[poses.len(), 22, 3], poses.as_flattened().as_flattened())
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
        for told in [0.01, 1.0 / 2.54, 2.54, 100.0].into_iter().flat_map(in_unit) {
            let problem = told.unwrap_err();
            assert!(problem.contains("times as long as those of HumanML3D"), "{problem}");
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
