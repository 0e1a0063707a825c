//! Where the results come from: versions, machines, the resolved sweep, and what was not run.

use std::collections::BTreeSet;

use maud::{Markup, html};

use super::input::{self, ReportInput};
use super::table::table;
use crate::record::RunRecord;

/// Versions, sweep and dropped cells.
pub fn section(input: &ReportInput) -> Markup {
    let records = input.records();
    let rows = [
        ("isoflop, for this page", env!("CARGO_PKG_VERSION").to_string()),
        ("revisions that trained", each(&records, |run| run.measured.git_revision.clone())),
        ("devices", each(&records, |run| run.measured.device.clone())),
        ("seeds", each(&records, |run| run.planned.seed.map(|seed| seed.to_string()))),
    ];
    let rows = rows.map(|(name, value)| vec![name.to_string(), value]);
    let within = html! {
        (table("Versions and machines", &["what", "which"], &rows))
        @if !input.dropped.is_empty() {
            details {
                summary { "Cells of the grid that were not run: " (input.dropped.len()) }
                ul { @for cell in input.dropped { li { (cell) } } }
            }
        }
        @if !input.sweep.is_empty() {
            details {
                summary { "The resolved sweep" }
                pre tabindex="0" role="region" aria-label="The resolved sweep" { (input.sweep.trim()) }
            }
        }
    };
    input::section("about", "Provenance", &within)
}

/// The values that runs have, each once.
fn each(records: &[&RunRecord], of: fn(&RunRecord) -> Option<String>) -> String {
    let values: BTreeSet<String> = records.iter().copied().filter_map(of).collect();
    values.into_iter().collect::<Vec<_>>().join(", ")
}
