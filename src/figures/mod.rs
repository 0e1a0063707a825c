//! From a table of runs and its laws to the figures of a paper, as SVG, PNG and PDF.
//!
//! Each figure is a file of its own: a function from `Sources` to a page (`scene::Scene`) or
//! to the reason why there is none. To add one, write such a function and name it in
//! `FIGURES`.
//!
//! | layer | files |
//! | --- | --- |
//! | what is shown | `cells` (runs by model × vocabulary × budget), `fitted` (minima and laws) |
//! | how a page is laid out | `page`, `panel`, `axis`, `ticks`, `legend`, `series` |
//! | shapes and files | `scene`, `colour`, `font`, `svg`, `render` (PNG), `pdf`, `write` |
//!
//! Motions have pages of their own in [`motion`].
//!
//! The same input gives the same bytes: the typeface is in the binary, and a page holds no time.
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
mod cells;
mod colour;
mod fitted;
mod font;
mod legend;
mod page;
mod panel;
mod pdf;
mod quantity;
mod render;
mod scene;
mod series;
mod svg;
mod ticks;
mod words;
mod write;

mod codes;
mod compare;
mod generators;
mod isoflop_parabolas;
mod loss_vs_budget;
mod loss_vs_data;
mod loss_vs_flops;
mod loss_vs_vocab;
pub mod motion;
mod power_laws;
mod quality;
mod tokenizers;
mod vocab_vs_nonvocab;

use std::path::{Path, PathBuf};

use thiserror::Error;

use crate::files::FileError;
use crate::laws::Laws;
use crate::record::RunRecord;
use crate::spec::FlopsRule;
use crate::tokenizer::TokenizerMetrics;
use axis::{Axis, COMPUTE, Scale};
use cells::{Cells, Shown};
pub use codes::draw as codes;
pub use compare::draw as compare;
pub use generators::{GeneratorRuns, draw as generators};
use legend::{Legend, Sample};
use page::Page;
use panel::Plot;
pub use quality::draw as quality;
use scene::{Mark, Marker, Point, Scene, Stroke};
use series::{Look, bound_stroke, category_looks, law_stroke, ordered_looks};
pub use write::Format;

/// What the figures of a sweep are drawn from.
#[derive(Clone, Copy, Debug)]
pub struct FigureInput<'a> {
    /// The sweep's name, at the head of each figure.
    pub title: &'a str,
    /// What the loss is called, if it is not L_u: the column or expression of a table.
    pub loss_name: Option<&'a str>,
    pub records: &'a [RunRecord],
    pub laws: Option<&'a Laws>,
    pub tokenizers: &'a [TokenizerMetrics],
}

/// What [`draw_all`] wrote, and what it could not show.
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

/// Why figures could not be written.
#[derive(Debug, Error)]
pub enum FigureError {
    #[error(transparent)]
    File(#[from] FileError),
    #[error("cannot draw the figure {name}: {message}")]
    Draw { name: String, message: String },
    #[error(
        "the laws count FLOPs by {rule:?}, which no run records; \
         fit them again with --flops openai, 6nd or exact"
    )]
    UnknownRule { rule: String },
}

/// What a figure is drawn from: the input, and its runs in cells.
struct Sources<'a> {
    input: &'a FigureInput<'a>,
    cells: Cells,
    /// The rule by which `cells` count FLOPs.
    rule: FlopsRule,
}

/// A page, or the reason why there is none.
pub type Drawing = Result<Scene, String>;

/// A figure: the name of its files, and how it is drawn.
type Figure = (&'static str, fn(&Sources) -> Drawing);

const FIGURES: [Figure; 8] = [
    ("loss_vs_flops", loss_vs_flops::draw),
    ("isoflop_parabolas", isoflop_parabolas::draw),
    ("loss_vs_vocab", loss_vs_vocab::draw),
    ("vocab_vs_nonvocab", vocab_vs_nonvocab::draw),
    ("loss_vs_budget", loss_vs_budget::draw),
    (loss_vs_data::NAME, loss_vs_data::draw),
    ("power_laws", power_laws::draw),
    ("tokenizers", tokenizers::draw),
];

/// The names of the figures of [`draw_all`].
pub fn names() -> [&'static str; FIGURES.len()] {
    FIGURES.map(|(name, _)| name)
}

/// Draws the figures that are wanted by name and that the input allows into `folder`, as `<name>.svg` and
/// its kin.
///
/// The folder is made where it is missing; each file appears whole, by rename. The files are
/// the same, byte for byte, at each call with the same input.
///
/// # Errors
///
/// Where a file cannot be written, or the laws count FLOPs by a rule that no run records.
pub fn draw_all(
    input: &FigureInput,
    folder: &Path,
    is_wanted: impl Fn(&str) -> bool,
    formats: &[Format],
) -> Result<Drawn, FigureError> {
    let sources = Sources::of(input)?;
    std::fs::create_dir_all(folder).map_err(FileError::write(folder))?;
    let left_out = runs_without_a_place(input.records, sources.rule);
    let mut drawn = Drawn { paths: Vec::new(), left_out };
    // A sweep on one data set has no figure of data, and is not told so.
    let is_meant = |name: &str| name != loss_vs_data::NAME || loss_vs_data::is_there(input.records);
    for (name, draw) in FIGURES.into_iter().filter(|(name, _)| is_wanted(name) && is_meant(name)) {
        match draw(&sources) {
            Ok(scene) => drawn.paths.extend(write::figure(&scene, folder, name, formats)?),
            Err(reason) => drawn.left_out.push(LeftOut { name: name.to_owned(), reason }),
        }
    }
    Ok(drawn)
}

/// Writes a figure that stands by itself as `<name>.svg` and its kin: [`codes`](codes()),
/// [`compare`](compare()), [`generators`](generators()) or [`quality`](quality()). Gives their paths.
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
    write::figure(&scene, folder, name, formats)
}

impl<'a> Sources<'a> {
    /// Counts FLOPs by the rule of the laws; without laws by one that the runs are counted by.
    fn of(input: &'a FigureInput<'a>) -> Result<Sources<'a>, FigureError> {
        let name = input.laws.map_or(counted(input.records).name(), |laws| &laws.flops_rule);
        let rule = FlopsRule::named(name);
        let rule = rule.ok_or_else(|| FigureError::UnknownRule { rule: name.to_owned() })?;
        Ok(Sources { input, cells: Cells::of(input.records, rule), rule })
    }

    /// The figure's title after the sweep's.
    fn title(&self, figure: &str) -> String {
        format!("{}: {figure}", self.input.title)
    }

    fn laws(&self) -> Result<&'a Laws, String> {
        self.input.laws.ok_or_else(|| "there are no laws".to_owned())
    }

    fn held_out_budget(&self) -> Option<f64> {
        self.input.laws?.held_out.as_ref().map(|held_out| held_out.budget_flops)
    }
}

/// The rule of a sweep by default, or that of a table which counts by one rule alone.
fn counted(records: &[RunRecord]) -> FlopsRule {
    let usual = FlopsRule::default();
    let others = [FlopsRule::SixNd, FlopsRule::OpenAi, FlopsRule::Exact];
    let has = |rule: &FlopsRule| records.iter().any(|run| run.flops(*rule).is_ok());
    [usual].into_iter().chain(others).find(has).unwrap_or(usual)
}

fn runs_without_a_place(records: &[RunRecord], rule: FlopsRule) -> Vec<LeftOut> {
    let left_out = |run: &RunRecord| {
        let reason = Shown::of(run, rule).err()?;
        Some(LeftOut { name: format!("run {}", run.planned.run_id), reason })
    };
    records.iter().filter_map(left_out).collect()
}

#[cfg(test)]
mod tests;
