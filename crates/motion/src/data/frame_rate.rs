//! How many frames a second a folder's files have.

use std::io::ErrorKind;
use std::path::Path;

use serde::Deserialize;

use super::motion_files::MotionFiles;
use super::source::DataError;

/// Frames a second of HumanML3D's files.
pub const FPS: f64 = 20.0;
/// Frames a second of Motion-X's files, which are not resampled.
const MOTION_X: f64 = 30.0;
/// What an import says of the folder that it wrote.
const IMPORT: &str = "import.json";

/// What is read of it; a file of that name that somebody else wrote says nothing.
#[derive(Deserialize)]
struct Import {
    fps: Option<f64>,
}

/// Frames a second of the files in `root`: those that its import wrote down, those `told`, or those of the
/// layout.
///
/// # Errors
/// The import's words cannot be read, or say something else than is told.
pub(super) fn frame_rate(
    root: &Path,
    files: MotionFiles,
    told: Option<f64>,
) -> Result<f64, DataError> {
    let by_layout = if files == MotionFiles::MOTION_X { MOTION_X } else { FPS };
    match (imported(root)?, told) {
        (Some(fps), Some(told)) if fps != told => Err(DataError::invalid(
            root.join(IMPORT).display(),
            format!("{fps} frames a second, where data.fps is {told}"),
        )),
        (imported, told) => Ok(imported.or(told).unwrap_or(by_layout)),
    }
}

fn imported(root: &Path) -> Result<Option<f64>, DataError> {
    let path = root.join(IMPORT);
    let invalid = |problem: String| DataError::invalid(path.display(), problem);
    let text = match crate::files::read_text(&path) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
        text => text.map_err(DataError::read(&path, "`isoflop data import` writes it"))?,
    };
    let import: Import = serde_json::from_str(&text).map_err(|error| invalid(error.to_string()))?;
    match import.fps {
        Some(fps) if !(fps.is_finite() && fps > 0.0) => {
            Err(invalid(format!("{fps} frames a second are no rate")))
        }
        fps => Ok(fps),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_import_the_sweep_and_the_layout_tell_in_this_order() {
        let root = tempfile::tempdir().unwrap();
        let rate =
            |files, told| frame_rate(root.path(), files, told).map_err(|error| error.to_string());
        assert_eq!(rate(MotionFiles::FEATURES, None), Ok(20.0));
        assert_eq!(rate(MotionFiles::MOTION_X, None), Ok(30.0));
        assert_eq!(rate(MotionFiles::MOTION_X, Some(25.0)), Ok(25.0));
        std::fs::write(root.path().join(IMPORT), r#"{"fps": 60.0, "form": "bvh"}"#).unwrap();
        assert_eq!(rate(MotionFiles::FEATURES, None), Ok(60.0));
        assert_eq!(rate(MotionFiles::FEATURES, Some(60.0)), Ok(60.0));
        let told = rate(MotionFiles::FEATURES, Some(30.0)).unwrap_err();
        assert!(told.contains("60 frames a second, where data.fps is 30"), "{told}");
        std::fs::write(root.path().join(IMPORT), r#"{"by": "somebody else"}"#).unwrap();
        assert_eq!(rate(MotionFiles::FEATURES, None), Ok(20.0));
        std::fs::write(root.path().join(IMPORT), r#"{"fps": 0}"#).unwrap();
        assert!(rate(MotionFiles::FEATURES, None).unwrap_err().contains("are no rate"));
    }
}
