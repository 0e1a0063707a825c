//! [`Clips`]: the motions as clips, each with captions, a group and a split.

use std::collections::{BTreeMap, HashMap};

use serde::Serialize;

use super::captions::{CaptionSource, captions, within};
use super::cut::{SHORTEST, cuts};
use super::error::ImportError;
use super::group::{groups, splits};
use super::listing::{Listing, SourceFile};
use super::motions::{Motion, Motions, Skeleton};
use super::options::ImportOptions;
use crate::data::Split;
use crate::motion::{Pose, canonicalise, is_canonical};

/// A clip of the data set.
pub struct Clip {
    pub id: String,
    /// The file that it comes from, relative to the folder that is imported.
    pub source: String,
    /// Frames of the whole motion, at the rate of the data set, that it is.
    pub frames: std::ops::Range<usize>,
    /// Canonical; see [`canonicalise`].
    pub poses: Vec<Pose>,
    pub captions: Vec<String>,
    pub captioned_by: CaptionSource,
    pub group: String,
    pub split: Split,
    /// Frames a second of the file.
    pub source_fps: f64,
    /// Metres in one of the file's units; `None` where places stay as they are.
    pub unit_m: Option<f64>,
}

/// The clips of all files, and what became of the others. But for the clips it is `import.json`: what was
/// imported, how, and what was left out.
#[derive(Default, Serialize)]
pub struct Clips {
    /// What the files hold.
    pub form: &'static str,
    /// Frames a second.
    pub fps: f64,
    pub left_handed: bool,
    #[serde(skip)]
    pub clips: Vec<Clip>,
    pub skeletons: Vec<Skeleton>,
    /// A sentence for each file that cannot be used.
    pub problems: Vec<String>,
    /// Sentences about motions shorter than a clip.
    pub too_short: Vec<String>,
    #[serde(skip)]
    pub draft: Option<String>,
}

impl Clips {
    /// Cuts, captions, groups and splits the motions.
    ///
    /// # Errors
    /// Nothing can be used, or there are too few groups.
    pub fn of(
        motions: Motions,
        listing: &Listing,
        options: &ImportOptions,
    ) -> Result<Self, ImportError> {
        let groups = groups(&listing.files, options.group);
        let Motions { motions, skeletons, draft } = motions;
        let fps = options.rate.of_all(&motions)?;
        let (form, left_handed) = (options.form.name(), options.left_handed);
        let mut all = Self { form, left_handed, fps, skeletons, draft, ..Self::default() };
        for ((motion, file), group) in motions.into_iter().zip(&listing.files).zip(groups) {
            match motion.and_then(|motion| clips(motion, file, (group, fps), listing, options)) {
                Ok(clips) if clips.is_empty() => {
                    all.too_short.push(format!("{}: too short", file.name));
                }
                Ok(clips) => all.clips.extend(clips),
                Err(problem) => all.problems.push(format!("{}: {problem}", file.name)),
            }
        }
        if all.clips.is_empty() {
            let problems = [all.problems, all.too_short].concat();
            return Err(ImportError::NothingUsable { problems, draft: all.draft });
        }
        all.split(listing.splits.as_ref())?;
        Ok(all)
    }

    /// Gives each clip its split: those of the folder, or by groups.
    fn split(&mut self, told: Option<&HashMap<String, Split>>) -> Result<(), ImportError> {
        if let Some(told) = told {
            let (known, other): (Vec<Clip>, Vec<Clip>) =
                self.clips.drain(..).partition(|clip| told.contains_key(base(&clip.id)));
            self.clips = known;
            let problem =
                |clip: &Clip| format!("{}: is in none of train, val and test.txt", clip.source);
            self.problems.extend(other.iter().map(problem));
            self.clips.iter_mut().for_each(|clip| clip.split = told[base(&clip.id)]);
            return Ok(());
        }
        let mut frames: BTreeMap<String, usize> = BTreeMap::new();
        for clip in &self.clips {
            *frames.entry(clip.group.clone()).or_default() += clip.poses.len();
        }
        let noun = if frames.len() == 1 { "group" } else { "groups" };
        let found = format!("{} {noun} of motions", frames.len());
        let splits = splits(&frames).ok_or(ImportError::TooFewGroups { found })?;
        self.clips.iter_mut().for_each(|clip| clip.split = splits[&clip.group]);
        Ok(())
    }
}

/// The poses at the origin, on the floor, facing +z; as they are where they are there already.
fn canonical(poses: &[Pose]) -> Vec<Pose> {
    if is_canonical(poses) { poses.to_vec() } else { canonicalise(poses) }
}

/// The file's name of a clip that is a part of it.
fn base(id: &str) -> &str {
    id.split('~').next().unwrap_or(id)
}

fn clips(
    motion: Motion,
    file: &SourceFile,
    (group, fps): (String, f64),
    listing: &Listing,
    options: &ImportOptions,
) -> Result<Vec<Clip>, String> {
    let poses: Vec<Pose> =
        motion.poses.iter().map(|pose| pose.map(|joint| joint.map(|c| c as f32))).collect();
    if poses.len() < SHORTEST {
        return Ok(Vec::new());
    }
    let (lines, captioned_by) = captions(file, listing, options)?;
    let cuts = cuts(&poses);
    let parts = cuts.len();
    let clip = |(part, frames): (usize, std::ops::Range<usize>)| Clip {
        id: if parts == 1 { file.id.clone() } else { format!("{}~{}", file.id, part + 1) },
        source: file.name.clone(),
        poses: canonical(&poses[frames.clone()]),
        captions: if parts == 1 { lines.clone() } else { within(&lines, &frames, fps) },
        captioned_by,
        group: group.clone(),
        split: Split::Train,
        source_fps: motion.fps,
        unit_m: motion.unit_m,
        frames,
    };
    let clips = cuts.into_iter().enumerate().map(clip);
    Ok(clips.filter(|clip| !clip.captions.is_empty()).collect())
}
