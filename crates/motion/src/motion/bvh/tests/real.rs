//! Real captures, which say so where they are not at hand.

use std::fs;
use std::path::{Path, PathBuf};

use super::*;
use crate::data::parse_npy;
use crate::motion::recover_joints;

/// The files below a folder of real motion whose names end so; none, with a word, without it.
fn files(folder: &str, ending: &str) -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data").join(folder);
    let Ok(listed) = fs::read_dir(&folder) else {
        eprintln!("skipped: {} is not there", folder.display());
        return Vec::new();
    };
    let paths = listed.map(|entry| entry.expect("a readable folder").path());
    let mut paths: Vec<PathBuf> =
        paths.filter(|path| path.to_string_lossy().ends_with(ending)).collect();
    paths.sort();
    paths
}

/// One clip of six: all of them take ten seconds.
#[test]
fn real_clips_deviate_by_less_than_a_millimetre() {
    for path in files("cmu-motion/new_joint_vecs", ".npy").iter().step_by(6) {
        let features = parse_npy(&fs::read(path).unwrap()).unwrap().values;
        let fitted = fit_bvh(&recover_joints(&features), 20.0).unwrap();
        let Deviation { largest_mm, mean_mm } = fitted.deviation;
        assert!(largest_mm < 1.0 && mean_mm > 0.0, "{}: {largest_mm} mm", path.display());
    }
}

#[test]
fn the_text_of_real_clips_is_read_back_within_a_millimetre() {
    for path in files("cmu-motion/check", ".joints.npy") {
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
    for path in folders.iter().flat_map(|folder| files(folder, ".bvh")) {
        let text = fs::read_to_string(&path).unwrap();
        let bvh = Bvh::parse(&text).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        let positions = bvh.positions();
        assert!(positions.len() > 30 && bvh.joints.len() > 18, "{}", path.display());
        assert!(positions.iter().flatten().flatten().all(|c| c.is_finite()));
        assert_eq!(bvh.frames.len(), positions.len());
    }
}
