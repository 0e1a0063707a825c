//! BVH files as poses of HumanML3D's skeleton: each file with its own axes, the upright pose of its skeleton read
//! from all its files.
//!
//! Files share a skeleton if they have the same joints and similar OFFSETs: a file that was turned, laid down or
//! mirrored with its OFFSETs is a separate skeleton.

use rayon::prelude::*;

use super::listing::SourceFile;
use super::options::{ImportOptions, Motion, Motions, Skeleton};
use crate::motion::bvh::{Bvh, Placed};
use crate::motion::geometry::{Point, dot, norm, sub, with_length};
use crate::motion::retarget::{
    Differs, Neutral, Pose64, Rig, RigError, Roles, Survey, Up, draft, follow, reflected_joint,
    roles_of, unit_m, with_ends,
};
use crate::motion::{JOINT_NAMES, N_JOINTS, PARENTS};

/// Joints and parents.
type Key = Vec<(String, Option<usize>)>;

struct Surveyed {
    key: Key,
    zero: Vec<Placed>,
    roles: Roles,
    survey: Survey,
}

/// The files of one skeleton: the first of them, and the sums over all.
struct Group<'a> {
    first: &'a Surveyed,
    survey: Survey,
    files: usize,
}

/// Reads every file twice: first for its skeleton, then for its motion.
pub fn read(files: &[SourceFile], options: &ImportOptions) -> Motions {
    let surveyed: Vec<Result<Surveyed, String>> =
        files.par_iter().map(|file| survey(file, options)).collect();
    let (groups, of_files) = groups(&surveyed);
    let rigs: Vec<Result<(Rig, Option<Differs>), String>> = (surveyed.iter().zip(&of_files))
        .map(|(found, group)| {
            let group = &groups[*group.as_ref().map_err(String::clone)?];
            let found = found.as_ref().map_err(String::clone)?;
            group.rig(found, options.up).map_err(|error| error.to_string())
        })
        .collect();
    let followed = files.par_iter().zip(&rigs).map(|(file, rig)| {
        let (rig, differs) = rig.as_ref().map_err(String::clone)?;
        let motion = motion(file, rig, options)?;
        Ok(Motion { remark: differs.map(|differs| differs.to_string()), ..motion })
    });
    let followed: Vec<Result<Motion, String>> = followed.collect();
    // Of a skeleton the first file that can be followed is told.
    let told = |index: usize| {
        let of_one = of_files.iter().zip(&rigs).filter(|(group, _)| **group == Ok(index));
        let rig =
            of_one.filter_map(|(_, rig)| rig.as_ref().ok()).min_by_key(|(_, odd)| odd.is_some());
        Some((&groups[index], &rig?.0))
    };
    let mut skeletons: Vec<(&Group, &Rig)> = (0..groups.len()).filter_map(told).collect();
    skeletons.sort_by_key(|(group, _)| &group.first.key);
    let skeletons = skeletons.into_iter().map(|(group, rig)| skeleton(group, rig)).collect();
    let broken = surveyed.iter().zip(files).filter(|(found, _)| found.is_err());
    // A mapping file for a skeleton whose joints are not all found.
    let draft =
        broken.filter_map(|(_, file)| parsed(file).ok()).find_map(|Bvh { joints, .. }| {
            roles_of(&joints, &options.map).is_err().then(|| draft(&joints, &options.map))
        });
    Motions { motions: followed, skeletons, draft }
}

impl Group<'_> {
    /// How a file of the skeleton moves the target: by its own axes; upright as its own OFFSETs stand, since
    /// performers differ, or as those of the first file, or as the standing frames of all.
    fn rig(&self, own: &Surveyed, up: Option<Up>) -> Result<(Rig, Option<Differs>), RigError> {
        let (survey, differs) = self.survey.with_axes_of(&own.survey);
        let of = |zero: &[Placed]| Rig::of(zero, own.roles, &survey, up);
        let rig = match of(&own.zero) {
            Ok(rig) if rig.neutral == Neutral::ZeroPose => rig,
            _ => of(&self.first.zero)?,
        };
        Ok((rig, differs.filter(|_| up.is_none())))
    }
}

/// The skeletons of some files, and which is each file's, or why it has none.
fn groups(surveyed: &[Result<Surveyed, String>]) -> (Vec<Group<'_>>, Vec<Result<usize, String>>) {
    let mut groups: Vec<Group> = Vec::new();
    let mut join = |found| {
        let place = groups.iter().position(|group| group.first.is_of_one_skeleton(found));
        let place = place.unwrap_or(groups.len());
        if place == groups.len() {
            groups.push(Group { first: found, survey: Survey::default(), files: 0 });
        }
        groups[place].survey.add(&found.survey);
        groups[place].files += 1;
        place
    };
    let joined = surveyed.iter().map(|found| found.as_ref().map(&mut join).map_err(String::clone));
    let joined = joined.collect();
    (groups, joined)
}

/// Cosine within which a bone of the OFFSETs lies as another file's: 45°, since performers differ.
const ALIKE: f64 = 0.7;
/// Fraction of a leg below which a bone has no direction.
const SHORT: f64 = 0.02;

impl Surveyed {
    /// Whether another file has the same joints, and its OFFSETs lie as these do.
    fn is_of_one_skeleton(&self, other: &Surveyed) -> bool {
        self.key == other.key
            && (1..N_JOINTS).all(|joint| match (self.bone(joint), other.bone(joint)) {
                (Some(own), Some(others)) => dot(own, others) > ALIKE,
                _ => true,
            })
    }

    /// The direction of the bone of the OFFSETs that ends in a role; `None` for a joint that the file has not,
    /// and for a bone that is hardly there.
    fn bone(&self, joint: usize) -> Option<Point> {
        let at = |role: usize| Some(self.zero[self.roles[role]?].position);
        let bone = sub(at(joint)?, at(PARENTS[joint]?)?);
        let leg = norm(sub(at(4)?, at(1)?));
        if norm(bone) > SHORT * leg { with_length(bone, 1.0) } else { None }
    }
}

fn parsed(file: &SourceFile) -> Result<Bvh, String> {
    let bytes = file.read()?;
    let text = std::str::from_utf8(&bytes).map_err(|_| "is not UTF-8".to_string())?;
    Ok(with_ends(Bvh::parse(text).map_err(|error| error.to_string())?))
}

fn survey(file: &SourceFile, options: &ImportOptions) -> Result<Surveyed, String> {
    let bvh = parsed(file)?;
    let key = bvh.joints.iter().map(|joint| (joint.name.clone(), joint.parent)).collect();
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

fn motion(file: &SourceFile, rig: &Rig, options: &ImportOptions) -> Result<Motion, String> {
    let bvh = parsed(file)?;
    let frames = frames(&bvh, options);
    let unit_m = unit_m(&frames, rig).ok_or("has legs without length")?;
    let poses: Vec<Pose64> = frames.iter().map(|joints| follow(joints, rig, unit_m)).collect();
    if !poses.as_flattened().as_flattened().iter().all(|x| x.abs() < FARTHEST_M) {
        return Err(format!("has a body farther than {FARTHEST_M} m from the origin"));
    }
    let fps = frames_a_second(bvh.frame_time_s)?;
    Ok(Motion { poses: options.rate.of(&poses, fps), fps, unit_m: Some(unit_m), remark: None })
}

/// Shares of a frame a second that a rounded frame time may be off.
const ROUNDED: f64 = 1e-3;
/// Rates of captures and of film, in frames per second.
const USUAL: [f64; 16] = [
    24.0, 25.0, 30.0, 48.0, 50.0, 60.0, 72.0, 90.0, 100.0, 120.0, 144.0, 150.0, 200.0, 240.0,
    250.0, 300.0,
];
/// Frames per second of a file of motion, at least and at most.
const RATES: [f64; 2] = [1.0, 2000.0];

/// `Frame Time: 0.0333333` means 30 frames per second, not 30.00003, and so does `0.033`: the one usual rate that is
/// written so.
fn frames_a_second(frame_time_s: f64) -> Result<f64, String> {
    let fps = 1.0 / frame_time_s;
    let [least, most] = RATES;
    if !(least..=most).contains(&fps) {
        return Err(format!(
            "has a Frame Time of {frame_time_s} s, which is no rate of motion: {least} to {most} frames a second are"
        ));
    }
    let whole = fps.round();
    if (fps / whole - 1.0).abs() < ROUNDED {
        return Ok(whole);
    }
    let digits = format!("{frame_time_s}").split_once('.').map_or(0, |(_, digits)| digits.len());
    let half = 0.5 * 10f64.powi(-(digits as i32));
    let is_meant = |rate: &f64| (1.0 / rate - frame_time_s).abs() <= half;
    let meant: Vec<f64> = USUAL.into_iter().filter(is_meant).collect();
    Ok(if let [one] = meant[..] { one } else { fps })
}

/// Largest distance of a body from the origin for 4-byte numbers, in metres.
const FARTHEST_M: f64 = 1e4;

fn skeleton(group: &Group, rig: &Rig) -> Skeleton {
    let key = &group.first.key;
    let name = |joint: usize| key[joint].0.clone();
    let roles = (JOINT_NAMES.iter().zip(rig.roles))
        .filter_map(|(role, joint)| Some((*role, name(joint?))))
        .collect();
    Skeleton {
        joints: key.iter().map(|(name, _)| name.clone()).collect(),
        files: group.files,
        up: rig.up.to_string(),
        neutral: match rig.neutral {
            Neutral::ZeroPose => "the pose of the OFFSETs".to_string(),
            Neutral::Standing(frames) => format!("the mean of {frames} standing frames"),
        },
        roles,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rate_is_the_usual_one_that_is_written_so() {
        let times = [0.0333333, 0.033, 0.0083, 0.00833333, 0.04, 0.01, 0.0416667, 0.037];
        let rates = times.map(|time| frames_a_second(time).unwrap());
        assert_eq!(rates[..7], [30.0, 30.0, 120.0, 120.0, 25.0, 100.0, 24.0]);
        assert!((rates[7] - 1.0 / 0.037).abs() < 1e-9, "no usual rate is written so");
        for time in [3600.0, 1e5, 1e15, 1e-9] {
            assert!(frames_a_second(time).unwrap_err().contains("no rate of motion"));
        }
    }
}
