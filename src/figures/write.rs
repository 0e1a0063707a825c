//! Puts a figure's files into place, each whole, by rename.

use std::path::{Path, PathBuf};

use super::FigureError;
use super::pdf;
use super::render::{self, DrawError};
use super::scene::Scene;
use super::svg::svg;
use crate::files::atomic;

/// A kind of file that a figure is written as.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Text that can be selected, lines of any size: for pages.
    Svg,
    /// Pixels, twice those of the page: for slides and chats.
    Png,
    /// Text and lines with the typeface within: for papers.
    Pdf,
}

impl Format {
    /// All of them.
    pub const ALL: [Format; 3] = [Format::Svg, Format::Png, Format::Pdf];

    /// How the names of its files end.
    pub fn extension(self) -> &'static str {
        match self {
            Format::Svg => "svg",
            Format::Png => "png",
            Format::Pdf => "pdf",
        }
    }

    fn bytes(self, scene: &Scene) -> Result<Vec<u8>, DrawError> {
        match self {
            Format::Svg => Ok(svg(scene, "", "").into_bytes()),
            Format::Png => render::png(&render::raster(scene)?),
            Format::Pdf => pdf::pdf(scene),
        }
    }
}

/// Writes `<name>.svg` and its kin; returns their paths.
pub fn figure(
    scene: &Scene,
    folder: &Path,
    name: &str,
    formats: &[Format],
) -> Result<Vec<PathBuf>, FigureError> {
    let failed =
        |error: DrawError| FigureError::Draw { name: name.to_owned(), message: error.to_string() };
    let one = |format: &Format| {
        let path = folder.join(format!("{name}.{}", format.extension()));
        atomic::write_bytes(&path, &format.bytes(scene).map_err(failed)?)?;
        Ok(path)
    };
    formats.iter().map(one).collect()
}
