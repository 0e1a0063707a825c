//! The tables of the page: generators side by side, runs, tokenizers and provenance.

use std::collections::BTreeSet;
use std::iter;

use maud::{Markup, html};

use super::input::{ReportInput, Study, Words, budgets, of_budget, section};
use crate::codes::{TokenizerMetrics, percent, two_decimals};
use crate::laws::text::count;
use crate::laws::{Exponent, Laws};
use crate::record::RunRecord;
use crate::words::from_to;

/// A table whose first column names its rows; it scrolls if it is wider than the page.
pub fn table(caption: &str, head: &[&str], rows: &[Vec<String>]) -> Markup {
    html! {
        div.wide tabindex="0" role="region" aria-label=(caption) {
            table {
                caption { (caption) }
                thead { tr { @for name in head { th scope="col" { (name) } } } }
                tbody {
                    @for row in rows {
                        tr {
                            @for (column, cell) in row.iter().enumerate() {
                                @if column == 0 { th scope="row" { (cell) } } @else { td { (cell) } }
                            }
                        }
                    }
                }
            }
        }
    }
}

/// An interval in words; empty if there is none.
pub fn interval(interval: Option<[f64; 2]>, number: fn(f64) -> String) -> String {
    interval.map_or_else(String::new, |ends| from_to(ends, number))
}

/// The generators of a sweep side by side; `None` if it has one.
pub fn generators(studies: &[Study]) -> Option<Markup> {
    let head =
        ["generator", "runs", "C", "lowest L_u", "N_nv", "V", "exponent of N_nv", "of N_v", "of D"];
    let rows: Vec<Vec<String>> = studies.iter().filter_map(of_generator).collect();
    let within = html! {
        (table("The best run at the largest budget, and exponents in C with 95 % intervals", &head, &rows))
        nav aria-label="Generators" {
            ul.legend {
                @for study in studies {
                    li { a href={ "#" (study.id("verdict")) } { (study.generator.unwrap_or_default()) } }
                }
            }
        }
        p.faint { "L_u is in nats per token. Losses of generators with different kinds of tokens cannot be \
        compared; the scores of their motions can." }
    };
    (!rows.is_empty()).then(|| section("generators", "Generators", &within))
}

/// A generator that has a name.
fn of_generator(study: &Study) -> Option<Vec<String>> {
    let mut cells = vec![study.generator?.to_string(), study.records.len().to_string()];
    let largest = budgets(study.records).last().copied();
    let best = largest.and_then(|budget| best(study.records, budget));
    let told = best.map(|(RunRecord { planned, .. }, loss)| {
        let (flops, size) = (count(planned.budget_flops), count(planned.params_nonvocab as f64));
        [flops, format!("{loss:.4}"), size, planned.n_vocab.to_string()]
    });
    cells.extend(told.unwrap_or_default());
    let answer = study.laws.map(Laws::answer);
    let own = answer.as_ref().map(|answer| &answer.exponents);
    let of = |symbol| {
        let Exponent { value, ci95, .. } = own?.of(symbol)?;
        let (exponent, certain) = (hundredths((*value)?), interval(*ci95, hundredths));
        Some(if certain.is_empty() { exponent } else { format!("{exponent} ({certain})") })
    };
    cells.extend(["N_nv", "N_v", "D"].map(|symbol| of(symbol).unwrap_or_default()));
    Some(cells)
}

/// Two decimals: a row has room for three intervals.
fn hundredths(x: f64) -> String {
    format!("{x:.2}")
}

/// The run of the lowest L_u at a budget.
fn best(records: &[RunRecord], budget: f64) -> Option<(&RunRecord, f64)> {
    let measured = of_budget(records, budget);
    let measured = measured.filter_map(|record| Some((record, record.loss_normalised().ok()?)));
    measured.min_by(|a, b| a.1.total_cmp(&b.1))
}

/// The runs, in a table that sorts and filters; `None` without runs.
pub fn runs(records: &[&RunRecord], words: &Words) -> Option<Markup> {
    let (size, loss) = (words.size, words.loss);
    // After the generator's column.
    let columns =
        [size, "layers", "width", "V", "C", "share", "seed", "D", "epochs", loss, "seconds"];
    let within = html! {
        label for="filter" { "Show runs with " }
        input id="filter" type="search" placeholder="masked 1e11 V=128";
        " " span id="shown" aria-live="polite" {}
        div.wide.tall tabindex="0" role="region" aria-label="Table of runs" {
            table id="table" {
                caption { "Finished runs" }
                thead { tr {
                    @for name in iter::once("generator").chain(columns) {
                        th scope="col" { button type="button" { (name) } }
                    }
                } }
                tbody { @for record in records {
                    tr { @for (text, value) in of_run(record) { td data-value=[value] { (text) } } }
                } }
            }
        }
    };
    (!records.is_empty()).then(|| section("runs", "Runs", &within))
}

/// The cells of a run: text and sort key.
fn of_run(record: &RunRecord) -> [(String, Option<f64>); 12] {
    let (planned, measured) = (&record.planned, &record.measured);
    let number =
        |value: Option<f64>, text: fn(f64) -> String| (value.map(text).unwrap_or_default(), value);
    let whole = |value: Option<f64>| number(value, |x| format!("{x}"));
    let many = |value: f64| number(Some(value), count);
    let of = |value: Option<usize>| whole(value.map(|value| value as f64));
    [
        (planned.generator.clone().unwrap_or_default(), None),
        many(planned.params_nonvocab as f64),
        of(planned.n_layer),
        of(planned.d_model),
        of(Some(planned.n_vocab)),
        many(planned.budget_flops),
        whole(Some(record.share())),
        whole(planned.seed.map(|seed| seed as f64)),
        many(measured.tokens as f64),
        number(measured.epochs, |x| format!("{x:.2}")),
        number(record.loss_normalised().ok(), |x| format!("{x:.4}")),
        number(measured.wall_s, |x| format!("{x:.0}")),
    ]
}

/// The tokenizers next to k-means; `None` if the study has none.
pub fn tokenizers(tokenizers: &[TokenizerMetrics]) -> Option<Markup> {
    let head = [
        "V",
        "kind",
        "seed",
        "MPJPE, mm",
        "heading given",
        "k-means, heading given",
        "codes used",
        "effective codes",
        "steps across codes",
        "jerk",
        "root, %",
        "root at the end, %",
    ];
    let rows: Vec<Vec<String>> = tokenizers.iter().map(of_tokenizer).collect();
    let caption = "Error of the joints on the test split, beside k-means of as many codes";
    let within = html! {
        (table(caption, &head, &rows))
        p.faint { "Boundary: joint steps between codes over joint steps within codes. Boundary and jerk are \
                   divided by the true motion's, so 1 is best. Root: distance on the ground from the true \
                   root, mean over time and in the last frame, as a share of the path; the median over clips \
                   that travel 1 m or more." }
    };
    (!rows.is_empty()).then(|| section("tokenizers", "Tokenizers", &within))
}

fn of_tokenizer(metrics: &TokenizerMetrics) -> Vec<String> {
    let mm = |value: Option<f64>| value.map(|mm| format!("{mm:.1}")).unwrap_or_default();
    let architecture = metrics.architecture.as_deref().unwrap_or_default();
    let own = metrics.continuity;
    vec![
        metrics.n_vocab.to_string(),
        format!("{architecture} {}", metrics.kind).trim().to_string(),
        metrics.seed.map(|seed| seed.to_string()).unwrap_or_default(),
        mm(Some(metrics.mpjpe_mm)),
        mm(metrics.mpjpe_heading_mm),
        mm(metrics.k_means.as_ref().map(|baseline| baseline.mpjpe_heading_mm)),
        format!("{:.0} %", 100.0 * metrics.utilisation),
        format!("{:.0}", metrics.exponential_entropy),
        two_decimals(own.and_then(|own| own.boundary_step_ratio)),
        two_decimals(own.and_then(|own| own.jerk_ratio)),
        percent(own.and_then(|own| own.root_error)),
        percent(own.and_then(|own| own.root_end_error)),
    ]
}

/// The provenance: versions, machines, the resolved sweep, and cells that were not run.
pub fn provenance(input: &ReportInput) -> Markup {
    let records = input.records();
    let rows = [
        ("isoflop that wrote this page", env!("CARGO_PKG_VERSION").to_string()),
        ("training revisions", each(&records, |run| run.measured.git_revision.clone())),
        ("devices", each(&records, |run| run.measured.device.clone())),
        ("seeds", each(&records, |run| run.planned.seed.map(|seed| seed.to_string()))),
    ];
    let rows = rows.map(|(name, value)| vec![name.to_string(), value]);
    let within = html! {
        (table("Versions and machines", &["item", "value"], &rows))
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
    section("about", "Provenance", &within)
}

/// The distinct values of the runs.
fn each(records: &[&RunRecord], of: fn(&RunRecord) -> Option<String>) -> String {
    let values: BTreeSet<String> = records.iter().copied().filter_map(of).collect();
    values.into_iter().collect::<Vec<_>>().join(", ")
}
