//! Draws the figures of a paper from a table of runs and its laws, as SVG, PNG and PDF.
//!
//! Each figure is a function from `Sources` to a page (`scene::Scene`) or to the reason why there is
//! none. To add one, write such a function and name it in `FIGURES`.
//!
//! | layer | files |
//! | --- | --- |
//! | the figures | `runs`, `best_loss`, `optima`, `tokenizers`, `quality` |
//! | content | `sources`, `cells` (runs by model × vocabulary × budget), `fitted` (minima and laws) |
//! | layout of a page | `page`, `panel`, `axis`, `legend` |
//! | shapes and files | `scene`, `style`, `formats` (SVG, PNG), `pdf` |
//!
//! Pages of motions are in [`motion`].
//!
//! The same input gives the same bytes: the typeface is in the binary, and a page has no date.
//!
//! # Example
//!
//! ```
//! use std::path::Path;
//!
//! use isoflop::figures::{FigureInput, Format, draw_all};
//! use isoflop::record::table;
//!
//! let records = table::read(Path::new("results/cmu-motion"))?;
//! let input = FigureInput {
//!     title: "cmu-motion",
//!     loss_name: None,
//!     records: &records,
//!     laws: None,
//!     tokenizers: &[],
//! };
//! let folder = tempfile::tempdir()?;
//! let drawn = draw_all(&input, folder.path(), |name| name == "loss_vs_flops", &[Format::Pdf])?;
//! assert!(drawn.paths[0].ends_with("loss_vs_flops.pdf"));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod axis;
mod best_loss;
mod cells;
mod fitted;
mod formats;
mod legend;
pub mod motion;
mod optima;
mod page;
mod panel;
mod pdf;
mod quality;
mod runs;
mod scene;
mod style;
mod tokenizers;

use std::path::{Path, PathBuf};

pub use best_loss::{GeneratorRuns, generators};
pub use cells::{Drawing, FigureError, FigureInput};
pub use formats::Format;
pub use optima::compare;
pub use quality::quality;
pub use tokenizers::codes;

use crate::files::{FileError, atomic};
use cells::Shown;
use cells::Sources;
use scene::Scene;

/// The files written by [`draw_all`], and the items that it could not show.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Drawn {
    /// A file of each format for each figure drawn.
    pub paths: Vec<PathBuf>,
    pub left_out: Vec<LeftOut>,
}

/// A figure, or a run in all figures, that is not shown.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LeftOut {
    /// The figure's file name without its extension, or `run <id>`.
    pub name: String,
    /// A clause for a person: "there are no laws".
    pub reason: String,
}

/// A figure: the name of its files, and how it is drawn.
type Figure = (&'static str, fn(&Sources) -> Drawing);

const LOSS_VS_DATA: &str = "loss_vs_data";

const FIGURES: [Figure; 8] = [
    ("loss_vs_flops", runs::loss_vs_flops),
    ("isoflop_parabolas", runs::isoflop_parabolas),
    ("loss_vs_vocab", runs::loss_vs_vocab),
    ("vocab_vs_nonvocab", optima::vocab_vs_nonvocab),
    ("loss_vs_budget", best_loss::loss_vs_budget),
    (LOSS_VS_DATA, best_loss::loss_vs_data),
    ("power_laws", optima::power_laws),
    ("tokenizers", tokenizers::tokenizers),
];

/// The figures of a sweep. Without data shares it has no figure of data, and no note says so.
fn figures(input: &FigureInput) -> impl Iterator<Item = Figure> {
    let has_shares = best_loss::has_shares(input.records);
    FIGURES.into_iter().filter(move |(name, _)| *name != LOSS_VS_DATA || has_shares)
}

/// The names of the figures of [`draw_all`].
pub fn names() -> [&'static str; FIGURES.len()] {
    FIGURES.map(|(name, _)| name)
}

/// Draws into `folder` the figures that are wanted by name and that the input allows, as `<name>.svg`, `.png`
/// and `.pdf`.
///
/// The folder is made if it is missing; each file is renamed into place. The same input gives the same files,
/// byte for byte.
///
/// # Errors
///
/// A file cannot be written, or the laws count FLOPs by a rule that no run records.
pub fn draw_all(
    input: &FigureInput,
    folder: &Path,
    is_wanted: impl Fn(&str) -> bool,
    formats: &[Format],
) -> Result<Drawn, FigureError> {
    let sources = Sources::of(input)?;
    std::fs::create_dir_all(folder).map_err(FileError::write(folder))?;
    let runs = input.records.iter().filter_map(|run| {
        let reason = Shown::of(run, sources.rule).err()?;
        Some(LeftOut { name: format!("run {}", run.planned.run_id), reason })
    });
    let mut drawn = Drawn { paths: Vec::new(), left_out: runs.collect() };
    for (name, draw) in figures(input).filter(|(name, _)| is_wanted(name)) {
        match draw(&sources) {
            Ok(scene) => drawn.paths.extend(write(&scene, folder, name, formats)?),
            Err(reason) => drawn.left_out.push(LeftOut { name: name.to_owned(), reason }),
        }
    }
    Ok(drawn)
}

/// Writes a single figure in each format: [`codes`], [`compare`], [`generators`] or [`quality`](quality()).
/// Returns the paths.
///
/// # Errors
///
/// There is nothing to show, or a file cannot be written.
pub fn draw_alone(
    name: &str,
    drawing: Drawing,
    folder: &Path,
    formats: &[Format],
) -> Result<Vec<PathBuf>, FigureError> {
    let failed = |message| FigureError::Draw { name: name.to_owned(), message };
    let scene = drawing.map_err(failed)?;
    std::fs::create_dir_all(folder).map_err(FileError::write(folder))?;
    write(&scene, folder, name, formats)
}

/// Writes a figure in each format, renaming each file into place; returns the paths.
fn write(
    scene: &Scene,
    folder: &Path,
    name: &str,
    formats: &[Format],
) -> Result<Vec<PathBuf>, FigureError> {
    let one = |format: &Format| {
        let failed = |message| FigureError::Draw { name: name.to_owned(), message };
        let bytes = format.bytes(scene).map_err(|error| failed(error.to_string()))?;
        let path = folder.join(format!("{name}.{}", format.extension()));
        atomic::write_bytes(&path, &bytes)?;
        Ok(path)
    };
    formats.iter().map(one).collect()
}

#[cfg(test)]
mod tests;
