//! [`look`]: whether motion is that of a body that stands, faces and moves as bodies do, in metres with y up; and
//! whether clips are one motion.
//!
//! Every reader asks it: the import, the opening of a data set and its check, and the commands that read files.

mod finding;
#[cfg(test)]
mod tests;

pub use finding::{Finding, Found};

use std::borrow::Cow;
use std::collections::HashMap;
use std::mem::discriminant;
use std::ops::RangeInclusive;

use rayon::prelude::*;

use super::source::{FAR, FEATURE_GROUPS, FeatureStats, Split, StatsAccumulator};
use crate::motion::geometry::norm;
use crate::motion::retarget::{BACKWARDS, Stance, Up, has_target_bones};
use crate::motion::{
    MIRROR_PARTNER, N_FEATURES, POSITIONS, Pose, ROOT_HEIGHT, lowest, mirror_features,
    recover_joints,
};

/// A motion that is looked at.
pub struct Seen<'a> {
    /// Its name in sentences: that of a file, or of a clip.
    pub name: String,
    /// Its split, where it is a clip of a data set.
    pub split: Option<Split>,
    pub motion: Held<'a>,
}

impl<'a> Seen<'a> {
    /// A motion of a file, or of a clip of a split.
    pub fn of(name: &str, split: Option<Split>, motion: Held<'a>) -> Self {
        Self { name: name.to_string(), split, motion }
    }
}

/// What is held of a motion.
#[derive(Clone, Copy)]
pub enum Held<'a> {
    /// `[T, 263]` row-major, not normalised.
    Features(&'a [f32]),
    /// Canonical, in metres.
    Poses(&'a [Pose]),
}

impl<'a> Held<'a> {
    fn poses(self) -> Cow<'a, [Pose]> {
        match self {
            Self::Features(features) => Cow::Owned(recover_joints(features)),
            Self::Poses(poses) => Cow::Borrowed(poses),
        }
    }

    /// Heights of the root in millimetres, which neither a turn nor a mirror changes.
    fn heights(self) -> Vec<i32> {
        let mm = |metres: f32| (1000.0 * metres).round() as i32;
        match self {
            Self::Features(features) => {
                features.chunks_exact(N_FEATURES).map(|row| mm(row[ROOT_HEIGHT])).collect()
            }
            Self::Poses(poses) => poses.iter().map(|pose| mm(pose[0][1])).collect(),
        }
    }
}

/// How many motions are looked at one by one, and by what they are normalised.
#[derive(Clone, Copy)]
pub struct Look<'a> {
    /// At even distances; all are compared with one another.
    pub most: usize,
    /// Mean and deviation that features should be of.
    pub stats: Option<&'a FeatureStats>,
    /// Whether they should be those of the training clips among the motions.
    pub of_these: bool,
}

impl Look<'_> {
    /// Every motion, without mean and deviation.
    pub const ALL: Self = Self { most: usize::MAX, stats: None, of_these: false };
}

/// All that may be wrong with some motions: one after another, two by two, and as a whole.
///
/// Clips are compared with one another where all have a split.
pub fn look(motions: &[Seen], how: Look) -> Vec<Found> {
    let n = motions.len().min(how.most);
    let sample: Vec<&Seen> = (0..n).map(|i| &motions[i * motions.len() / n]).collect();
    let each: Vec<Vec<Finding>> =
        sample.par_iter().map(|seen| of_one(seen.motion, how.stats)).collect();
    let named = sample.iter().zip(each).flat_map(|(seen, findings)| {
        findings.into_iter().map(move |finding| (finding, seen.name.clone()))
    });
    let mut found = grouped(named, n);
    found.extend(grouped(pairs(motions).into_iter(), motions.len()));
    let whole = how.stats.filter(|_| how.of_these).map(|stats| of_stats(&sample, stats));
    let of_all = |finding| Found { finding, names: Vec::new(), of: n };
    found.extend(whole.into_iter().flatten().map(of_all));
    found
}

/// Findings of a kind as one, in the order in which they are met.
fn grouped(named: impl Iterator<Item = (Finding, String)>, of: usize) -> Vec<Found> {
    let mut found: Vec<Found> = Vec::new();
    for (finding, name) in named {
        let kind = discriminant(&finding);
        match found.iter_mut().find(|own| discriminant(&own.finding) == kind) {
            Some(own) => own.names.push(name),
            None => found.push(Found { finding, names: vec![name], of }),
        }
    }
    found
}

// One motion.

/// Legs shorter or longer by these factors are of another unit of length, or of another body.
const LEGS: RangeInclusive<f64> = 0.75..=1.33;
/// Cosine between y and the mean direction from the ankles to the shoulders below which a body lies.
const LYING: f64 = 0.5;
/// Frames that one pose fills, at least, and their share of the motion.
const STILL: (usize, f64) = (40, 0.5);
/// Metres below which joints have not moved.
const UNMOVED_M: f32 = 2e-5;
/// Metres below or above the floor at which the lowest joint of a clip may be.
const FLOOR_M: f32 = 0.1;
/// Metres that bones may differ from HumanML3D's.
const BONES_M: f64 = 0.02;

fn of_one(motion: Held, stats: Option<&FeatureStats>) -> Vec<Finding> {
    let poses = motion.poses();
    let stance = Stance::of(&poses);
    // Numbers that are not finite have an error of their own.
    if !stance.legs.is_finite() {
        return Vec::new();
    }
    let lies = stance.height[1] < LYING * norm(stance.height);
    let gross = [
        (!LEGS.contains(&stance.legs)).then_some(Finding::Scale(stance.legs)),
        lies.then(|| Finding::Lies(Up::along(stance.height))),
        (!lies && stance.toes < BACKWARDS).then_some(Finding::Backwards),
    ];
    if let Some(gross) = gross.into_iter().flatten().next() {
        return vec![gross];
    }
    let still = longest_rest(&poses);
    let far = match (motion, stats) {
        (Held::Features(features), Some(stats)) => stats.deviations(features),
        _ => 0.0,
    };
    let (least, share) = STILL;
    let bones = |pose: &Pose| has_target_bones(&pose.map(|joint| joint.map(f64::from)), BONES_M);
    let fine = [
        (still >= least && still as f64 >= share * poses.len() as f64)
            .then_some(Finding::Still(still)),
        (far > FAR).then_some(Finding::Far(far)),
        (!poses.first().is_some_and(bones)).then_some(Finding::Bones),
        (lowest(&poses).abs() > FLOOR_M).then_some(Finding::Floor),
    ];
    fine.into_iter().flatten().collect()
}

/// Frames of the longest part in which no joint moves.
fn longest_rest(poses: &[Pose]) -> usize {
    let moves = |pair: &[Pose]| !within(&pair[0], &pair[1], UNMOVED_M);
    let (mut longest, mut own) = (1, 1);
    for pair in poses.windows(2) {
        own = if moves(pair) { 1 } else { own + 1 };
        longest = longest.max(own);
    }
    longest
}

/// Whether no joint of one pose is farther than that from the other's, along any axis.
fn within(a: &Pose, b: &Pose, metres: f32) -> bool {
    let pairs = a.as_flattened().iter().zip(b.as_flattened());
    pairs.into_iter().all(|(a, b)| (a - b).abs() < metres)
}

// Two motions.

/// Metres within which two clips are one motion.
const SAME_M: f32 = 2e-3;

/// Pairs of clips that are one motion, or one another's mirror image in another split than training.
///
/// Only clips whose roots have the same heights are compared.
fn pairs(motions: &[Seen]) -> Vec<(Finding, String)> {
    let mut firsts: HashMap<Vec<i32>, (&Seen, Split)> = HashMap::new();
    let mut found = Vec::new();
    for seen in motions {
        let Some(split) = seen.split else { return Vec::new() };
        let (other, others) = *firsts.entry(seen.motion.heights()).or_insert((seen, split));
        let is_leak = split != others && [split, others].contains(&Split::Train);
        let finding = match relation(other, seen) {
            Some(Relation::Same) if is_leak => Finding::Leak,
            Some(Relation::Same) => Finding::Twice,
            Some(Relation::Image) if is_leak => Finding::ImageLeak,
            _ => continue,
        };
        let named = |seen: &Seen, split: Split| format!("{} ({})", seen.name, split.name());
        found.push((finding, format!("{} and {}", named(other, others), named(seen, split))));
    }
    found
}

enum Relation {
    Same,
    Image,
}

/// `None` for a clip and itself, too.
fn relation(a: &Seen, b: &Seen) -> Option<Relation> {
    if std::ptr::eq(a, b) {
        return None;
    }
    let (a, b) = (a.motion.poses(), b.motion.poses());
    let is_b = |own: &[Pose]| own.iter().zip(b.iter()).all(|(own, b)| within(own, b, SAME_M));
    if is_b(&a[..]) {
        return Some(Relation::Same);
    }
    is_b(&mirrored(&a)).then_some(Relation::Image)
}

/// The same seen in a mirror, at its place.
fn mirrored(poses: &[Pose]) -> Vec<Pose> {
    let place = |pose: &Pose, joint: usize| {
        let [x, y, z] = pose[MIRROR_PARTNER[joint]];
        [-x, y, z]
    };
    poses.iter().map(|pose| std::array::from_fn(|joint| place(pose, joint))).collect()
}

/// Metres by which a clip's own mirror image may differ from the one in the data, on the mean: HumanML3D's bones
/// differ from side to side.
const IMAGE_M: f32 = 0.02;

/// Whether features are those of another clip's mirror image.
pub fn is_image(own: &[f32], other: &[f32]) -> bool {
    if own.len() != other.len() {
        return false;
    }
    let place = |i: &usize| POSITIONS.contains(&(i % N_FEATURES));
    let image = mirror_features(own);
    let apart = (0..own.len()).filter(place).map(|i| (image[i] - other[i]).abs());
    let n = own.len() / N_FEATURES * POSITIONS.len();
    apart.sum::<f32>() < IMAGE_M * n as f32
}

// Mean and deviation.

/// Deviations that a column's mean may be off.
const MEAN_OFF: f64 = 2.0;
/// Factors by which the deviation of a group of columns may be off.
const STD_OFF: RangeInclusive<f64> = 0.33..=3.0;

/// How mean and deviation differ from those of the training clips among the motions.
fn of_stats(motions: &[&Seen], stats: &FeatureStats) -> Vec<Finding> {
    let mut sums = StatsAccumulator::default();
    for seen in motions.iter().filter(|seen| seen.split == Some(Split::Train)) {
        if let Held::Features(features) = seen.motion {
            sums.add(features);
        }
    }
    let Some(own) = sums.finish() else { return Vec::new() };
    let off = |column: usize| {
        f64::from(((stats.mean[column] - own.mean[column]) / own.std[column]).abs())
    };
    let of_group = |columns: std::ops::Range<usize>| {
        let mean = columns.clone().map(off).fold(0.0, f64::max);
        let std: f64 = columns.clone().map(|c| f64::from(stats.std[c] / own.std[c])).sum();
        let factor = std / columns.len() as f64;
        let mean = (mean > MEAN_OFF).then_some(Finding::Mean(columns.clone(), mean));
        let std = (!STD_OFF.contains(&factor)).then_some(Finding::Std(columns, factor));
        [mean, std].into_iter().flatten()
    };
    FEATURE_GROUPS.into_iter().flat_map(of_group).collect()
}
