//! Features, recovery and mirroring against numbers from another implementation.
//!
//! `check/` beside the real motion holds canonical joints of twelve clips and the features of the
//! mirrored clips. Both are stored coarsely, which bounds what can be asked: joints lie on a grid
//! of 0.1 mm around the root, and features keep 14 significant bits. Tolerances are what follows
//! from that: a bone of 57 mm whose ends are off by 0.05 mm in each coordinate turns by 2.4 mrad,
//! and its rotation is relative to another that is off as well.

use std::path::{Path, PathBuf};

use isoflop::data::{FEATURE_GROUPS, NpyArray, parse_npy};
use isoflop::motion::N_FEATURES;
use isoflop::motion::{
    MIRROR_PARTNER, N_JOINTS, PARENTS, Pose, build_features, features_of_canonical,
    mirror_features, mpjpe_mm, recover_joints,
};

/// One clip of `check/`.
struct Check {
    id: String,
    poses: Vec<Pose>,
    features: Vec<f32>,
    mirrored: Vec<f32>,
}

/// Every clip of `check/`, or none with a word on it if the data is not there.
fn checks() -> Vec<Check> {
    let root = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data/cmu-motion"));
    let Ok(folder) = std::fs::read_dir(root.join("check")) else {
        eprintln!("skipped: {}/check is not there", root.display());
        return Vec::new();
    };
    let names = folder.map(|entry| entry.expect("a readable folder").file_name());
    let mut ids: Vec<String> = names
        .filter_map(|name| Some(name.to_str()?.strip_suffix(".joints.npy")?.to_owned()))
        .collect();
    ids.sort();
    assert_eq!(ids.len(), 12);
    ids.into_iter().map(|id| check(&root, id)).collect()
}

fn check(root: &Path, id: String) -> Check {
    let poses = poses(&read(&root.join(format!("check/{id}.joints.npy"))));
    let features = read(&root.join(format!("new_joint_vecs/{id}.npy"))).values;
    let mirrored = read(&root.join(format!("check/M{id}.vec.npy"))).values;
    assert_eq!(features.len(), (poses.len() - 1) * N_FEATURES);
    Check { id, poses, features, mirrored }
}

fn read(path: &Path) -> NpyArray {
    let bytes = std::fs::read(path).expect("a readable file");
    parse_npy(&bytes).expect("an array")
}

fn poses(array: &NpyArray) -> Vec<Pose> {
    assert_eq!(array.shape[1..], [N_JOINTS, 3]);
    let point = |frame: &[f32], joint: usize| std::array::from_fn(|c| frame[3 * joint + c]);
    let frames = array.values.chunks_exact(3 * N_JOINTS);
    frames.map(|frame| std::array::from_fn(|joint| point(frame, joint))).collect()
}

/// Largest deviation in each of the groups of columns, in [`FEATURE_GROUPS`]'s order.
type Tolerances = [f32; 7];

const TOLERANCES: Tolerances = [1.5e-4, 1e-5, 1.2e-4, 3e-4, 5e-3, 3e-4, 0.0];
/// In this clip the body spins so fast that its smoothed heading all but vanishes at frame 46:
/// there 0.1 mm in the joints turns the heading by a milliradian.
const SPINNING: (&str, Tolerances) = ("000401", [2e-3, 1e-4, 1.2e-4, 1e-3, 5e-3, 5e-4, 0.0]);

fn tolerances(id: &str) -> Tolerances {
    if id == SPINNING.0 { SPINNING.1 } else { TOLERANCES }
}

/// Fails where features differ by more than the clip's tolerances, naming clip, frame and column,
/// or where their mean difference is larger than rounding leaves behind.
fn assert_close(id: &str, found: &[f32], expected: &[f32]) {
    assert_eq!(found.len(), expected.len(), "{id}");
    for (group, tolerance) in FEATURE_GROUPS.into_iter().zip(tolerances(id)) {
        let mut sum = 0.0;
        let rows = found.chunks(N_FEATURES).zip(expected.chunks(N_FEATURES));
        for (frame, (row, expected)) in rows.enumerate() {
            for column in group.clone() {
                let (a, b) = (row[column], expected[column]);
                assert!((a - b).abs() <= tolerance, "{id}[{frame}, {column}]: {a}, not {b}");
                sum += f64::from(a - b);
            }
        }
        let mean = sum / (found.len() / N_FEATURES * group.len()) as f64;
        assert!(mean.abs() < 7e-5, "{id}, columns {group:?}: {mean} on the mean");
    }
}

#[test]
fn features_follow_from_joints() {
    for check in checks() {
        assert_close(&check.id, &features_of_canonical(&check.poses), &check.features);
    }
}

#[test]
fn making_canonical_joints_canonical_changes_little() {
    for check in checks() {
        assert_close(&check.id, &build_features(&check.poses), &check.features);
    }
}

#[test]
fn joints_follow_from_features() {
    for check in checks() {
        let recovered = recover_joints(&check.features);
        let expected = &check.poses[..recovered.len()];
        let pairs = recovered.as_flattened().iter().zip(expected.as_flattened());
        for (a, b) in pairs {
            let close = a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1.5e-4);
            assert!(close, "{}: {a:?} is not {b:?}", check.id);
        }
        assert!(mpjpe_mm(expected, &recovered) < 0.06, "{}", check.id);
    }
}

#[test]
fn mirrored_joints_on_the_same_skeleton_give_the_features_of_the_mirrored_clip() {
    for check in checks() {
        let lengths = bone_lengths_m(&check.poses);
        let mirrored: Vec<Pose> =
            check.poses.iter().map(|pose| with_lengths(&mirrored_pose(pose), &lengths)).collect();
        assert_close(&check.id, &build_features(&mirrored), &check.mirrored);
    }
}

#[test]
fn mirrored_features_describe_the_mirrored_clip() {
    for check in checks() {
        let mirrored = recover_joints(&mirror_features(&check.features));
        let error_mm = mpjpe_mm(&recover_joints(&check.mirrored), &mirrored);
        // HumanML3D's skeleton is not symmetric: its hips differ by 7 mm, its ankles by 7 mm.
        assert!(error_mm < 6.0, "{}: {error_mm} mm", check.id);
    }
}

fn mirrored_pose(pose: &Pose) -> Pose {
    std::array::from_fn(|joint| {
        let [x, y, z] = pose[MIRROR_PARTNER[joint]];
        [-x, y, z]
    })
}

/// Length of the bone to each joint, its mean over the clip, which evens out the grid.
fn bone_lengths_m(poses: &[Pose]) -> [f32; N_JOINTS] {
    let total = |joint: usize| poses.iter().map(|pose| bone(pose, joint).1).sum::<f32>();
    std::array::from_fn(|joint| total(joint) / poses.len() as f32)
}

/// Vector to `joint` from its parent, and its length.
fn bone(pose: &Pose, joint: usize) -> ([f32; 3], f32) {
    let parent = PARENTS[joint].unwrap_or(joint);
    let vector: [f32; 3] = std::array::from_fn(|c| pose[joint][c] - pose[parent][c]);
    (vector, vector.iter().map(|c| c * c).sum::<f32>().sqrt())
}

/// `pose` with bones of other lengths that point where its own do.
fn with_lengths(pose: &Pose, lengths: &[f32; N_JOINTS]) -> Pose {
    let mut placed = *pose;
    for joint in 1..N_JOINTS {
        let (vector, length) = bone(pose, joint);
        let parent = placed[PARENTS[joint].expect("only the pelvis has no parent")];
        placed[joint] = std::array::from_fn(|c| parent[c] + vector[c] * lengths[joint] / length);
    }
    placed
}
