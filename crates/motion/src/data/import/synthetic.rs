//! The procedural motion as a folder.

use std::path::Path;

use rayon::prelude::*;

use super::captions::{CaptionSource, line};
use super::clips::{Clip, Clips};
use super::error::ImportError;
use super::folder::{self, Imported};
use crate::data::{FPS, MotionSource, Procedural, Split};
use crate::motion::canonicalise;

/// Writes every clip of `source` as the data set `to`; train, val and test are its own.
///
/// # Errors
/// [`ImportError`]: the folder is there already or cannot be written.
pub fn write_procedural(
    source: &Procedural,
    to: &Path,
    overwrite: bool,
) -> Result<Imported, ImportError> {
    folder::check_place(to, overwrite)?;
    let clip = |&(split, index): &(Split, usize)| {
        let id = source.clip_id(split, index);
        let poses = canonicalise(&source.poses(split, index));
        Clip {
            source: String::new(),
            frames: 0..poses.len(),
            poses,
            captions: source.captions(split, index).iter().map(|caption| line(caption)).collect(),
            captioned_by: CaptionSource::File,
            group: id.clone(),
            split,
            source_fps: FPS,
            unit_m: None,
            id,
        }
    };
    let clips = source.clips(&Split::ALL).par_iter().map(clip).collect();
    folder::write(Clips { form: "procedural", fps: FPS, clips, ..Clips::default() }, to)
}
