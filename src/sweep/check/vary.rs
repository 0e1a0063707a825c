//! Impossible axes of `grid.vary`.

use serde_json::Value;

use crate::sweep::problem::Problem;
use crate::sweep::sections::Sweep;
use crate::sweep::variants::SECTIONS;

/// What is wrong with the keys that the grid varies; `of_sweep` finds what is wrong with a sweep that varies
/// nothing.
pub fn check(sweep: &Sweep, of_sweep: fn(&Sweep) -> Vec<Problem>) -> Vec<Problem> {
    let known = of_sweep(sweep);
    let fresh = |own: &Sweep| {
        let problem = of_sweep(own).into_iter().find(|problem| !known.contains(problem));
        problem.map(|problem| problem.message)
    };
    sweep.grid.vary.iter().flat_map(|(key, values)| of_key(sweep, key, values, &fresh)).collect()
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
