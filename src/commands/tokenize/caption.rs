//! The captions of motions: given, a line each, or beside them.

use std::fs;
use std::path::Path;

use anyhow::{Context, Result, bail};
use isoflop::data::{Annotation, parse_annotation};

use super::args::{TokenizeArgs, motion_name};

/// The caption of each motion, where it has one.
pub fn captions(args: &TokenizeArgs) -> Result<Vec<Option<String>>> {
    let n = args.files.len();
    match (&args.caption, &args.texts) {
        (Some(caption), _) if caption.trim().is_empty() => bail!("--caption is empty"),
        (Some(caption), _) => Ok(vec![Some(caption.clone()); n]),
        (None, Some(path)) => captions_of_lines(path, n),
        (None, None) => args.files.iter().map(|path| caption_beside(path)).collect(),
    }
}

/// A caption a line, as many as there are motions.
pub fn captions_of_lines(path: &Path, n: usize) -> Result<Vec<Option<String>>> {
    let captions: Vec<Option<String>> = lines_of(path)?.into_iter().map(Some).collect();
    if captions.len() != n {
        let found = captions.len();
        bail!("{} has {found} captions for {n} motions; write one a line", path.display());
    }
    Ok(captions)
}

/// The lines of a file that are not blank.
pub fn lines_of(path: &Path) -> Result<Vec<String>> {
    let text = fs::read_to_string(path).with_context(|| format!("reading {}", path.display()))?;
    let lines = text.lines().map(str::trim).filter(|line| !line.is_empty());
    Ok(lines.map(String::from).collect())
}

/// The first caption of the whole clip in the `.txt` beside a motion, plain or as HumanML3D has them.
pub fn caption_beside(motion: &Path) -> Result<Option<String>> {
    let path = motion.with_file_name(format!("{}.txt", motion_name(motion)));
    if !path.is_file() {
        return Ok(None);
    }
    let text = fs::read_to_string(&path).with_context(|| format!("reading {}", path.display()))?;
    let lines = text.trim_start_matches('\u{feff}').lines().filter(|line| !line.trim().is_empty());
    let read: Result<Vec<Annotation>, _> = lines.map(parse_annotation).collect();
    let read = read.with_context(|| format!("a line of {}", path.display()))?;
    match read.into_iter().find(|annotation| annotation.span_s.is_none()) {
        Some(annotation) => Ok(Some(annotation.caption)),
        None => bail!("{} has no caption of the whole motion", path.display()),
    }
}
