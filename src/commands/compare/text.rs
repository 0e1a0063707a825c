//! What a person reads of a comparison.

use std::fmt::Write;

use isoflop::laws::{Difference, Estimate};

use super::quantities::Quantity;
use super::study::Study;
use super::sweeps::SweepDifference;
use crate::commands::screen::{dash, more, table};

/// Keys of sweeps that are told, at most.
const KEYS: usize = 12;
/// Characters of a study's name that are shown.
const WIDEST: usize = 24;

/// Characters of a value that are shown.
const SHOWN: usize = 22;

pub fn text(
    studies: &[Study],
    budget: f64,
    quantities: &[Quantity],
    sweeps: &[SweepDifference],
    full: bool,
) -> String {
    let mut text = String::new();
    for quantity in quantities {
        let at = if quantity.is_ratio { format!(" at {budget:.3e} FLOPs") } else { String::new() };
        let _ = writeln!(text, "{}{at}", quantity.name);
        let rows = studies.iter().zip(&quantity.estimates).zip(&quantity.differences);
        let row = |((study, estimate), difference): (
            (&Study, &Option<Estimate>),
            &Option<Difference>,
        )| {
            let name: String = study.name.chars().take(WIDEST).collect();
            let difference = difference.map(|found| against(found, quantity.is_ratio));
            let estimate = dash(*estimate, |found| said(found, quantity));
            [format!("  {name}"), estimate, difference.unwrap_or_default()]
        };
        text += &table(["<", "<", "<"], rows.map(row));
    }
    text += &of_sweeps(studies, sweeps, full);
    text
}

fn said(Estimate { value, ci95 }: Estimate, quantity: &Quantity) -> String {
    let number = |x: f64| match (quantity.name, quantity.is_ratio) {
        ("V", _) => format!("{x:.0}"),
        (_, true) => format!("{x:.2e}"),
        (_, false) => format!("{x:.3}"),
    };
    let interval = ci95.map(|[low, high]| format!(" {}..{}", number(low), number(high)));
    format!("{}{}", number(value), interval.unwrap_or_default())
}

/// A difference, and whether it is one.
fn against(Difference { value, ci95, differs }: Difference, is_ratio: bool) -> String {
    let number = |x: f64| if is_ratio { format!("x{:.2}", x.exp()) } else { format!("{x:+.3}") };
    let Some([low, high]) = ci95 else { return number(value) };
    let verdict = if differs == Some(true) { "differs" } else { "" };
    format!("{} ({}..{}) {verdict}", number(value), number(low), number(high))
}

/// Characters with which all values begin.
fn alike(values: &[&str]) -> usize {
    let same = |i: usize| {
        let letter = values[0].chars().nth(i);
        letter.is_some() && values.iter().all(|value| value.chars().nth(i) == letter)
    };
    (0..).take_while(|i| same(*i)).count()
}

/// A long value from a little before where values begin to differ.
fn cut(value: &str, alike: usize) -> String {
    let n = value.chars().count();
    if n <= SHOWN {
        return value.to_string();
    }
    let first = alike.saturating_sub(SHOWN / 4);
    let shown: String = value.chars().skip(first).take(SHOWN).collect();
    let before = if first > 0 { "…" } else { "" };
    let after = if first + SHOWN < n { "…" } else { "" };
    format!("{before}{shown}{after}")
}

fn of_sweeps(studies: &[Study], sweeps: &[SweepDifference], full: bool) -> String {
    if sweeps.is_empty() {
        return String::new();
    }
    let mut text = String::from("\nsweeps differ in\n");
    let limit = if full { usize::MAX } else { KEYS };
    for SweepDifference { key, values } in sweeps.iter().take(limit) {
        let values: Vec<&str> =
            values.iter().map(|value| value.as_deref().unwrap_or("-")).collect();
        let alike = if full { 0 } else { alike(&values) };
        let shown = |value: &&str| if full { value.to_string() } else { cut(value, alike) };
        let values: Vec<String> = values.iter().map(shown).collect();
        let _ = writeln!(text, "  {key}: {}", values.join(" | "));
    }
    text += &more(sweeps.len(), limit, ": --full");
    let codes = sweeps.iter().any(|each| {
        ["data", "tokenizer"].contains(&each.key.split('.').next().unwrap_or_default())
    });
    if codes && studies.len() > 1 {
        text +=
            "Data or tokenizers differ: L_u is of each study's own codes, and is not compared.\n";
    }
    text
}
