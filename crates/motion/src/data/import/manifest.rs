//! `manifest.csv`: a row a clip.

use super::clips::Clip;

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
