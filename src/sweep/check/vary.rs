//! Impossible axes of `grid.vary`.

use serde_json::Value;

use crate::sweep::problem::Problem;
use crate::sweep::sections::Sweep;
use crate::sweep::variants::{SECTIONS, Variant};

/// Combinations of values that a sweep varies, at most: each is planned by itself.
const MOST_COMBINATIONS: f64 = 1000.0;

/// What is wrong with the keys that the grid varies; `of_sweep` finds what is wrong with a sweep that varies
/// nothing.
pub fn check(sweep: &Sweep, of_sweep: fn(&Sweep) -> Vec<Problem>) -> Vec<Problem> {
    let known = of_sweep(sweep);
    let fresh = |own: &Sweep| {
        let problem = of_sweep(own).into_iter().find(|problem| !known.contains(problem));
        problem.map(|problem| problem.message)
    };
    let vary = sweep.grid.vary.iter();
    let alone: Vec<Problem> =
        vary.flat_map(|(key, values)| of_key(sweep, key, values, &fresh)).collect();
    if alone.is_empty() { together(sweep, &fresh).into_iter().collect() } else { alone }
}

/// The first combination that will not do, of values that do alone.
fn together(sweep: &Sweep, fresh: &dyn Fn(&Sweep) -> Option<String>) -> Option<Problem> {
    let n = sweep.grid.vary.values().map(|values| values.len() as f64).product::<f64>();
    if n > MOST_COMBINATIONS {
        let message =
            format!("{n} combinations; a sweep varies at most {MOST_COMBINATIONS} of them");
        return Some(Problem::value("grid.vary", message));
    }
    let problem = |variant: Result<Variant, String>| match variant {
        Err(message) => Some(message),
        Ok(Variant { label, sweep }) => {
            fresh(&sweep).map(|message| format!("{}: {message}", label.unwrap_or_default()))
        }
    };
    sweep.combined().find_map(problem).map(|message| Problem::value("grid.vary", message))
}

fn of_key(
    sweep: &Sweep,
    key: &str,
    values: &[Value],
    fresh: &dyn Fn(&Sweep) -> Option<String>,
) -> Vec<Problem> {
    let path = format!("grid.vary.{key}");
    let section = key.split_once('.').map(|(section, _)| section);
    if !section.is_some_and(|section| SECTIONS.contains(&section)) {
        let problem = Problem::value(path, "only a key of train, model or tokenizer can be varied");
        return vec![
            Problem { at_key: true, ..problem }.with_help("as train.lr, or model.ffn_multiple"),
        ];
    }
    if values.is_empty() {
        return vec![Problem::value(path, "no value, so no run")];
    }
    if (1..values.len()).any(|i| values[..i].contains(&values[i])) {
        return vec![Problem::value(path, "a value stands twice")];
    }
    let of_value = |(i, value): (usize, &Value)| {
        let message = match sweep.with(key, value) {
            Err(message) => Some(message),
            Ok(own) => fresh(&own),
        };
        message.map(|message| Problem::value(format!("{path}[{i}]"), message))
    };
    values.iter().enumerate().filter_map(of_value).collect()
}
