//! Puts a figure's files into place, each whole, by rename.

use std::path::{Path, PathBuf};

use super::FigureError;
use super::render;
use super::scene::Scene;
use crate::files::atomic;

/// Writes `<name>.svg` and `<name>.png`; returns both paths.
pub fn figure(scene: &Scene, folder: &Path, name: &str) -> Result<[PathBuf; 2], FigureError> {
    let failed = |message| FigureError::Draw { name: name.to_owned(), message };
    let document = render::svg(scene).map_err(failed)?;
    let pixels = render::png(scene).map_err(failed)?;
    let (svg, png) = (folder.join(format!("{name}.svg")), folder.join(format!("{name}.png")));
    atomic::write_bytes(&svg, document.as_bytes())?;
    atomic::write_bytes(&png, &pixels)?;
    Ok([svg, png])
}
