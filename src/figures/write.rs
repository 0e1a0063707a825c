//! Puts a figure's files into place, each whole, by rename.

use std::fs::{self, Permissions};
use std::io::Write;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};

use tempfile::NamedTempFile;

use super::FigureError;
use super::render;
use super::scene::Scene;
use crate::files::atomic::PARTIAL;

/// Makes the folder of the figures, and those above it.
pub fn make_folder(folder: &Path) -> Result<(), FigureError> {
    let at = |source| FigureError::Write { path: folder.to_owned(), source };
    fs::create_dir_all(folder).map_err(at)
}

/// Writes `<name>.svg` and `<name>.png`; returns both paths.
pub fn figure(scene: &Scene, folder: &Path, name: &str) -> Result<[PathBuf; 2], FigureError> {
    let failed = |message| FigureError::Draw { name: name.to_owned(), message };
    let document = render::svg(scene).map_err(failed)?;
    let (svg, png) = (folder.join(format!("{name}.svg")), folder.join(format!("{name}.png")));
    whole(&svg, |file| {
        let path = svg.clone();
        file.write_all(document.as_bytes()).map_err(|source| FigureError::Write { path, source })
    })?;
    whole(&png, |file| render::png(scene, file.path()).map_err(failed))?;
    Ok([svg, png])
}

/// Fills a file beside `path` and renames it there.
fn whole(
    path: &Path,
    fill: impl FnOnce(&mut NamedTempFile) -> Result<(), FigureError>,
) -> Result<(), FigureError> {
    let at = |source| FigureError::Write { path: path.to_owned(), source };
    let mut file = beside(path).map_err(at)?;
    fill(&mut file)?;
    file.persist(path).map_err(|error| at(error.error))?;
    Ok(())
}

/// A temporary file in the same folder, with the same extension, as readable as any other.
fn beside(path: &Path) -> std::io::Result<NamedTempFile> {
    let extension = path.extension().unwrap_or_default().to_string_lossy();
    tempfile::Builder::new()
        .prefix(PARTIAL)
        .suffix(&format!(".{extension}"))
        .permissions(Permissions::from_mode(0o666))
        .tempfile_in(path.parent().unwrap_or(Path::new(".")))
}
