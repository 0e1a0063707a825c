//! BVH files as poses of HumanML3D's skeleton, each skeleton read from all its files.

use std::collections::BTreeMap;

use rayon::prelude::*;

use super::listing::SourceFile;
use super::motions::{Motion, Motions, Skeleton};
use super::options::ImportOptions;
use crate::motion::bvh::{Bvh, Placed};
use crate::motion::retarget::{
    Rig, Roles, Survey, draft, follow, reflected_joint, roles_of, unit_m, with_ends,
};

/// Joints and parents: what makes files of one skeleton.
type Key = Vec<(String, Option<usize>)>;

/// A file read once.
struct Read {
    bvh: Bvh,
    key: Key,
}

struct Surveyed {
    key: Key,
    zero: Vec<Placed>,
    roles: Roles,
    survey: Survey,
}

/// Reads every file twice: first for what its skeleton is, then for its motion.
pub fn read(files: &[SourceFile], options: &ImportOptions) -> Motions {
    let surveyed: Vec<Result<Surveyed, String>> =
        files.par_iter().map(|file| survey(file, options)).collect();
    let rigs = rigs(&surveyed, options);
    let followed: Vec<Result<Motion, String>> = (files.par_iter().zip(&surveyed))
        .map(|(file, surveyed)| {
            let surveyed = surveyed.as_ref().map_err(String::clone)?;
            motion(file, rigs[&surveyed.key].as_ref().map_err(String::clone)?, options)
        })
        .collect();
    let skeletons = (rigs.iter())
        .filter_map(|(key, rig)| Some(skeleton(key, rig.as_ref().ok()?, &surveyed)))
        .collect();
    let draft = surveyed.iter().zip(files).find_map(|(found, file)| match found {
        Err(_) => parsed(file).ok().and_then(|read| wanted_draft(&read, options)),
        Ok(_) => None,
    });
    Motions { motions: followed, skeletons, draft }
}

/// A mapping file for a skeleton whose joints are not all found.
fn wanted_draft(read: &Read, options: &ImportOptions) -> Option<String> {
    let joints = &read.bvh.joints;
    roles_of(joints, &options.map).is_err().then(|| draft(joints, &options.map))
}

fn parsed(file: &SourceFile) -> Result<Read, String> {
    let bytes = std::fs::read(&file.path).map_err(|error| format!("cannot be read: {error}"))?;
    let text = std::str::from_utf8(&bytes).map_err(|_| "is not UTF-8".to_string())?;
    let bvh = with_ends(Bvh::parse(text).map_err(|error| error.to_string())?);
    let key = bvh.joints.iter().map(|joint| (joint.name.clone(), joint.parent)).collect();
    Ok(Read { bvh, key })
}

fn survey(file: &SourceFile, options: &ImportOptions) -> Result<Surveyed, String> {
    let Read { bvh, key } = parsed(file)?;
    let roles = roles_of(&bvh.joints, &options.map).map_err(|error| error.to_string())?;
    if bvh.frames.len() < 2 {
        return Err("has too few frames: features want two".to_string());
    }
    let frames = frames(&bvh, options);
    let zero = handed(bvh.zero_pose(), options);
    let survey = Survey::of(&frames, &roles, options.up);
    Ok(Surveyed { key, zero, roles, survey })
}

fn frames(bvh: &Bvh, options: &ImportOptions) -> Vec<Vec<Placed>> {
    bvh.placed().into_iter().map(|joints| handed(joints, options)).collect()
}

/// Joints in right-handed axes.
fn handed(joints: Vec<Placed>, options: &ImportOptions) -> Vec<Placed> {
    if options.left_handed { joints.into_iter().map(reflected_joint).collect() } else { joints }
}

fn rigs(
    surveyed: &[Result<Surveyed, String>],
    options: &ImportOptions,
) -> BTreeMap<Key, Result<Rig, String>> {
    let mut sums: BTreeMap<&Key, (&Surveyed, Survey)> = BTreeMap::new();
    for found in surveyed.iter().flatten() {
        let (_, sum) = sums.entry(&found.key).or_insert((found, Survey::default()));
        *sum = std::mem::take(sum).and(&found.survey);
    }
    let rig = |(key, (first, sum)): (&Key, (&Surveyed, Survey))| {
        let rig = Rig::of(&first.zero, first.roles, &sum, options.up);
        (key.clone(), rig.map_err(|error| error.to_string()))
    };
    sums.into_iter().map(rig).collect()
}

fn motion(file: &SourceFile, rig: &Rig, options: &ImportOptions) -> Result<Motion, String> {
    let Read { bvh, .. } = parsed(file)?;
    let frames = frames(&bvh, options);
    let unit_m = unit_m(&frames, rig).ok_or("has legs without length")?;
    let poses: Vec<_> = frames.iter().map(|joints| follow(joints, rig, unit_m)).collect();
    let fps = frames_a_second(bvh.frame_time_s);
    Ok(Motion { poses: options.rate.of(&poses, fps), fps, unit_m: Some(unit_m) })
}

/// Shares of a frame a second that a rounded frame time may be off.
const ROUNDED: f64 = 1e-3;

/// `Frame Time: 0.0333333` means 30 frames a second, not 30.00003.
fn frames_a_second(frame_time_s: f64) -> f64 {
    let fps = 1.0 / frame_time_s;
    let whole = fps.round();
    if whole > 0.0 && (fps / whole - 1.0).abs() < ROUNDED { whole } else { fps }
}

fn skeleton(key: &Key, rig: &Rig, surveyed: &[Result<Surveyed, String>]) -> Skeleton {
    let name = |joint: usize| key[joint].0.clone();
    let roles = (crate::motion::JOINT_NAMES.iter().zip(rig.roles))
        .filter_map(|(role, joint)| Some((*role, name(joint?))))
        .collect();
    Skeleton {
        joints: key.iter().map(|(name, _)| name.clone()).collect(),
        files: surveyed.iter().flatten().filter(|found| found.key == *key).count(),
        up: rig.up.to_string(),
        neutral: rig.neutral,
        roles,
    }
}
