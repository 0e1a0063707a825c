//! Reads the motions named on the command line, with their captions.

use crate::commands::prelude::*;
use crate::commands::tokenize::{caption_beside, captions_of_lines, motion_name};
use isoflop::data::read_motion;
use isoflop::text::as_in_data;
use rayon::prelude::*;
use std::fs;

/// Problems that are listed, at most.
const LISTED: usize = 10;

/// A motion in a file: its raw features, `[T, 263]` row-major, and its caption.
pub type NamedMotion = (Vec<f32>, Option<String>);
/// The files of motions, and these.
pub type Named = (Vec<PathBuf>, Vec<NamedMotion>);

/// Reads every motion.
///
/// Every file that cannot be read is named, and none is left out.
pub fn named_motions(motions: &[PathBuf], texts: Option<&Path>, fps: f64) -> Result<Named> {
    let mut files: Vec<(PathBuf, Option<String>)> = Vec::new();
    for path in motions {
        match path.is_dir() {
            true => files.extend(of_folder(path)?),
            false => files.push((path.clone(), None)),
        }
    }
    let captions = captions(texts, &files)?;
    let read: Vec<_> = files.par_iter().map(|(path, _)| read_motion(path, fps)).collect();
    let problems: Vec<String> =
        read.iter().filter_map(|read| Some(read.as_ref().err()?.to_string())).collect();
    if !problems.is_empty() {
        let (n, all, shown) = (problems.len(), read.len(), problems.len().min(LISTED));
        bail!("{n} of {all} motions cannot be scored:\n  {}", problems[..shown].join("\n  "));
    }
    let paths = files.into_iter().map(|(path, _)| path).collect();
    Ok((paths, read.into_iter().flatten().zip(captions).collect()))
}

/// One file per motion: features before joint arrays before BVH if it has several.
fn of_folder(folder: &Path) -> Result<Vec<(PathBuf, Option<String>)>> {
    let entries = fs::read_dir(folder).with_context(|| format!("reading {}", folder.display()))?;
    let mut by_name: BTreeMap<String, PathBuf> = BTreeMap::new();
    for path in entries.flatten().map(|entry| entry.path()) {
        let Some(rank) = rank(&path) else { continue };
        // Numbers in the order of their values.
        let name = motion_name(&path);
        let is_number = name.chars().all(|c| c.is_ascii_digit());
        let name = if is_number { format!("{name:0>20}") } else { name };
        if by_name.get(&name).and_then(|other| self::rank(other)).is_none_or(|held| rank < held) {
            by_name.insert(name, path);
        }
    }
    if by_name.is_empty() {
        bail!("{} holds no .npy and no .bvh", folder.display());
    }
    // Numbered files of `isoflop generate` are in the order of their numbers.
    let made: Vec<MadeMotion> = read_if_there(&folder.join("motions.json"))?.unwrap_or_default();
    let with_caption = |path: PathBuf| {
        let index: Option<usize> = motion_name(&path).parse().ok();
        let caption = index.and_then(|index| Some(made.get(index)?.caption.clone()));
        (path, caption)
    };
    Ok(by_name.into_values().map(with_caption).collect())
}

/// The rank of a motion's file, the lowest read first; `None` for other files.
fn rank(path: &Path) -> Option<usize> {
    let name = path.file_name()?.to_str()?.to_ascii_lowercase();
    let endings = [".features.npy", ".joints.npy", ".npy", ".bvh"];
    endings.into_iter().position(|ending| name.ends_with(ending))
}

/// The part of an element of `motions.json` that is read.
#[derive(Deserialize)]
struct MadeMotion {
    caption: String,
}

/// The caption of each motion, if it has one: from `--texts`, else from its folder, else from the .txt next to
/// it.
fn captions(
    texts: Option<&Path>,
    files: &[(PathBuf, Option<String>)],
) -> Result<Vec<Option<String>>> {
    let captions = match texts {
        Some(path) => captions_of_lines(path, files.len())?,
        None => {
            let own = |(path, made): &(PathBuf, Option<String>)| match made {
                Some(caption) => Ok(Some(caption.clone())),
                None => caption_beside(path),
            };
            files.iter().map(own).collect::<Result<_>>()?
        }
    };
    Ok(captions.into_iter().map(|caption| caption.map(|words| as_in_data(&words))).collect())
}
