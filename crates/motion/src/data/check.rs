//! All that is wrong with a data set, and what is odd about it.

use std::collections::HashSet;
use std::path::Path;

use rayon::prelude::*;
use serde::Serialize;

use super::humanml3d::{HumanMl3d, HumanMl3dOptions};
use super::motion_files::MotionFiles;
use super::source::{DataError, MotionSource, Split};
use super::splits::read_splits;
use super::stats::FAR;
use crate::motion::{BONE_LENGTHS, N_JOINTS, PARENTS, Pose, recover_joints};
use crate::spec::BrokenFiles;

/// Metres that bones may differ from HumanML3D's.
const BONES: f32 = 0.02;
/// Metres below or above the floor at which the lowest joint of a clip may be.
const FLOOR: f32 = 0.1;

/// What a look at every file found.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Checked {
    /// Sentences about what cannot be used.
    pub problems: Vec<String>,
    /// Sentences about what can be used and is odd.
    pub remarks: Vec<String>,
}

/// Looks at every file of a folder in the HumanML3D layout.
pub fn check_folder(path: &Path) -> Checked {
    let options = |broken| HumanMl3dOptions { broken, ..HumanMl3dOptions::default() };
    let open = |broken| HumanMl3d::open(path, &options(broken));
    let (problems, data) = match open(BrokenFiles::Refuse) {
        // What is sound among broken files is looked at too.
        Err(DataError::Broken { problems, .. }) => (problems, open(BrokenFiles::Skip)),
        data => (Vec::new(), data),
    };
    let mut checked = Checked { problems, ..Checked::default() };
    match data {
        Ok(data) => {
            let broken: HashSet<&String> = checked.problems.iter().collect();
            let odd = data.warnings().iter().filter(|line| !broken.contains(line));
            checked.remarks.extend(odd.cloned());
            checked.remarks.extend(unlisted(path));
            checked.remarks.extend(odd_clips(&data));
        }
        Err(error) => checked.problems.push(error.to_string()),
    }
    checked
}

/// Motions that no split lists.
fn unlisted(path: &Path) -> Option<String> {
    let files = MotionFiles::of(path)?;
    if files.in_folders() {
        return None;
    }
    let listed: HashSet<String> =
        read_splits(path, files.in_folders()).ok()?.clips.into_iter().map(|(_, id)| id).collect();
    let entries = std::fs::read_dir(path.join(files.folder)).ok()?.flatten();
    let mut names: Vec<String> = entries
        .filter_map(|entry| Some(entry.file_name().to_str()?.strip_suffix(".npy")?.to_string()))
        .filter(|name| !listed.contains(name) && !listed.contains(name.trim_start_matches('M')))
        .collect();
    names.sort();
    let first = names.first()?;
    Some(format!("{} motions are in no split, as {first}", names.len()))
}

/// A sentence for each way in which clips are odd.
fn odd_clips(data: &HumanMl3d) -> Vec<String> {
    let clips = data.clips(&Split::ALL);
    let found: Vec<[bool; WAYS.len()]> =
        clips.par_iter().map(|clip| oddities(data, *clip)).collect();
    let sentence = |(way, words): (usize, &&str)| {
        let mut odd = clips.iter().zip(&found).filter(|(_, odd)| odd[way]).map(|(clip, _)| *clip);
        let (split, index) = odd.next()?;
        Some(format!("{} clips {words}, as {}", odd.count() + 1, data.clip_id(split, index)))
    };
    WAYS.iter().enumerate().filter_map(sentence).collect()
}

const WAYS: [&str; 4] = [
    "have bones that are not HumanML3D's",
    "do not touch the floor, or go below it",
    "have features far from their mean: Mean.npy and Std.npy are of other data, or the features are \
     normalised already",
    "repeat a frame through all their length",
];

fn oddities(data: &HumanMl3d, (split, index): (Split, usize)) -> [bool; WAYS.len()] {
    let Ok(features) = data.features(split, index) else { return [false; WAYS.len()] };
    let poses = recover_joints(&features);
    let lowest = poses.iter().flatten().map(|joint| joint[1]).fold(f32::INFINITY, f32::min);
    let far = data.stats().deviations(&features);
    let still = poses.windows(2).all(|pair| pair[0] == pair[1]);
    [!poses.first().is_some_and(has_bones), lowest.abs() > FLOOR, far > FAR, still]
}

fn has_bones(pose: &Pose) -> bool {
    (1..N_JOINTS).all(|joint| {
        let parent = pose[PARENTS[joint].unwrap_or(0)];
        let squares: f32 = (0..3).map(|c| (pose[joint][c] - parent[c]).powi(2)).sum();
        (squares.sqrt() - BONE_LENGTHS[joint]).abs() < BONES
    })
}
