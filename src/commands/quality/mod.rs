//! What the scored runs of a sweep say: their table, their figure, and whether loss predicts quality.

mod agreement;
mod best;
mod fid_law;
mod ranks;
mod rows;
mod text;

use anyhow::Result;
use isoflop::figures::{self, Format, draw_alone};
use isoflop::jobs::ResultsFolder;
use isoflop::record::{RunRecord, write_scores};
use isoflop::sweep::Sweep;
use serde_json::{Value, json};

use super::output::Output;
use agreement::Agreement;
use best::best;
use fid_law::fid_laws;
use ranks::LossRanks;
use rows::Rows;
use text::text;

/// What is said of scored runs.
pub struct Scored {
    pub document: Value,
    pub text: String,
}

impl Scored {
    /// Writes the table and the figure of those runs that are scored; `None` where none is.
    pub fn of(
        sweep: &Sweep,
        folder: &ResultsFolder,
        records: &[RunRecord],
        output: &Output,
    ) -> Result<Option<Self>> {
        let Rows { own: rows, by_others } = Rows::of(sweep, folder, records, output)?;
        if rows.is_empty() {
            return Ok(None);
        }
        write_scores(folder.root(), &rows)?;
        let drawing = figures::quality(&folder.name(), &rows);
        let drawn = draw_alone("quality", drawing, &folder.file("figures"), &Format::ALL);
        let figures = drawn.unwrap_or_else(|error| {
            output.warn(&error.to_string());
            Vec::new()
        });
        let (ranks, best) = (LossRanks::of(&rows), best(&rows));
        let laws = fid_laws(&best);
        let agreements = Agreement::of(&rows, &by_others);
        let text = text(folder, &rows, (&ranks, &agreements), (&best, &laws));
        let document = json!({
            "runs": rows.len(), "evaluator_id": rows[0].evaluator_id, "ranks": ranks,
            "agreement": agreements, "best": best, "fid_laws": laws, "figures": figures,
        });
        Ok(Some(Self { document, text }))
    }
}
