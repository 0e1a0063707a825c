//! The runs: a table that sorts and filters.

use maud::{Markup, html};

use super::input;
use super::words::Words;
use crate::laws::text::count;
use crate::record::RunRecord;

/// A cell: what is read, and what it is sorted by.
struct Cell {
    text: String,
    value: Option<f64>,
}

/// The table; `None` where there is no run.
pub fn section(records: &[&RunRecord], words: &Words) -> Option<Markup> {
    let (size, loss) = (words.size, words.loss);
    let columns = [
        "generator",
        size,
        "layers",
        "width",
        "V",
        "C",
        "share",
        "seed",
        "D",
        "epochs",
        loss,
        "seconds",
    ];
    let within = html! {
        label for="filter" { "Show runs with " }
        input id="filter" type="search" placeholder="masked 1e11 V=128";
        " " span id="shown" aria-live="polite" {}
        div.wide.tall tabindex="0" role="region" aria-label="Table of runs" {
            table id="table" {
                caption { "Finished runs" }
                thead { tr {
                    @for name in columns { th scope="col" { button type="button" { (name) } } }
                } }
                tbody { @for record in records { (row(record)) } }
            }
        }
    };
    (!records.is_empty()).then(|| input::section("runs", "Runs", &within))
}

fn row(record: &RunRecord) -> Markup {
    html! {
        tr {
            @for Cell { text, value } in cells(record) {
                td data-value=[value] { (text) }
            }
        }
    }
}

fn cells(record: &RunRecord) -> [Cell; 12] {
    let (planned, measured) = (&record.planned, &record.measured);
    let whole = |value: Option<f64>| number(value, |x| format!("{x}"));
    let many = |value: f64| number(Some(value), count);
    let of = |value: Option<usize>| whole(value.map(|value| value as f64));
    [
        Cell { text: planned.generator.clone().unwrap_or_default(), value: None },
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

fn number(value: Option<f64>, text: fn(f64) -> String) -> Cell {
    Cell { text: value.map(text).unwrap_or_default(), value }
}
