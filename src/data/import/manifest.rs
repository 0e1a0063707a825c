//! `manifest.csv`: a row a clip. `import.json`: what was imported, how, and what was left out.

use serde::Serialize;

use super::clips::{Clip, Clips};

/// The head of `manifest.csv`.
const COLUMNS: &str = "id,source_file,start,end,frames,source_fps,unit_m,captions,group,split";

/// The rows of all clips.
pub fn manifest(clips: &[Clip]) -> String {
    let mut text = format!("{COLUMNS}\n");
    for clip in clips {
        let unit_m = clip.unit_m.map_or(String::new(), |unit_m| format!("{unit_m:.6}"));
        let fields = [
            clip.id.clone(),
            clip.source.clone(),
            clip.frames.start.to_string(),
            clip.frames.end.to_string(),
            clip.poses.len().to_string(),
            clip.source_fps.to_string(),
            unit_m,
            clip.captioned_by.name().to_string(),
            clip.group.clone(),
            clip.split.name().to_string(),
        ];
        text += &(fields.map(|field| quoted(&field)).join(",") + "\n");
    }
    text
}

/// A field as RFC 4180 writes it.
fn quoted(field: &str) -> String {
    if field.contains([',', '"', '\n', '\r']) {
        return format!("\"{}\"", field.replace('"', "\"\""));
    }
    field.to_string()
}

/// The document of `import.json`.
#[derive(Serialize)]
pub struct Import<'a> {
    form: &'static str,
    fps: f64,
    left_handed: bool,
    skeletons: Vec<SkeletonRow<'a>>,
    problems: &'a [String],
    too_short: &'a [String],
}

#[derive(Serialize)]
struct SkeletonRow<'a> {
    files: usize,
    up: &'a str,
    neutral: String,
    joints: std::collections::BTreeMap<&'static str, &'a str>,
}

impl<'a> Import<'a> {
    pub fn of(clips: &'a Clips) -> Self {
        let skeletons = clips.skeletons.iter().map(|skeleton| SkeletonRow {
            files: skeleton.files,
            up: &skeleton.up,
            neutral: skeleton.neutral_words(),
            joints: skeleton.roles.iter().map(|(role, name)| (*role, name.as_str())).collect(),
        });
        Self {
            form: clips.form,
            fps: clips.fps,
            left_handed: clips.left_handed,
            skeletons: skeletons.collect(),
            problems: &clips.problems,
            too_short: &clips.short,
        }
    }
}
