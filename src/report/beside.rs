//! The generators of a sweep side by side.

use maud::{Markup, html};

use super::input::{self, Study};
use super::scaling::{budgets, of_budget};
use super::table::{interval, table};
use crate::laws::text::count;
use crate::laws::{Exponent, Laws};
use crate::record::RunRecord;

/// The table; `None` where the sweep has one generator.
pub fn section(studies: &[Study]) -> Option<Markup> {
    let head =
        ["generator", "runs", "C", "lowest L_u", "N_nv", "V", "exponent of N_nv", "of N_v", "of D"];
    let rows: Vec<Vec<String>> = studies.iter().filter_map(row).collect();
    let within = html! {
        (table("The best run at the largest budget, and exponents of C with 95 % intervals", &head, &rows))
        nav aria-label="Generators" {
            ul.legend {
                @for study in studies {
                    li { a href={ "#" (study.id("verdict")) } { (study.generator.unwrap_or_default()) } }
                }
            }
        }
        p.faint { "L_u is in nats a token. Losses of generators with other kinds of tokens do not compare; \
                   the scores of their motions do." }
    };
    (!rows.is_empty()).then(|| input::section("generators", "Generators", &within))
}

/// A generator that has a name.
fn row(study: &Study) -> Option<Vec<String>> {
    let mut cells = vec![study.generator?.to_string(), study.records.len().to_string()];
    let largest = budgets(study.records).last().copied();
    let best = largest.and_then(|budget| best(study.records, budget));
    cells.extend(match best {
        Some((record, loss)) => [
            count(record.planned.budget_flops),
            format!("{loss:.4}"),
            count(record.planned.params_nonvocab as f64),
            record.planned.n_vocab.to_string(),
        ],
        None => Default::default(),
    });
    let answer = study.laws.map(Laws::answer);
    let own = answer.as_ref().map(|answer| &answer.exponents);
    let exponent = |own: Option<&Exponent>| {
        let exponent = hundredths(own?.value?);
        let certain = interval(own?.ci95, hundredths);
        Some(if certain.is_empty() { exponent } else { format!("{exponent} ({certain})") })
    };
    let of = |symbol| exponent(own.and_then(|own| own.of(symbol))).unwrap_or_default();
    cells.extend(["N_nv", "N_v", "D"].map(of));
    Some(cells)
}

/// Two decimals: a row has room for three intervals.
fn hundredths(x: f64) -> String {
    format!("{x:.2}")
}

/// The run of the lowest L_u at a budget.
fn best(records: &[RunRecord], budget: f64) -> Option<(&RunRecord, f64)> {
    let measured = of_budget(records, budget)
        .filter_map(|record| Some((record, record.loss_normalised().ok()?)));
    measured.min_by(|a, b| a.1.total_cmp(&b.1))
}
