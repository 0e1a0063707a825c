//! What is wrong with the keys that `grid.vary` varies.

use serde_json::Value;

use crate::sweep::problem::Problem;
use crate::sweep::sections::Sweep;
use crate::sweep::typed::outside_of_sweep;
use crate::sweep::variants::Variant;
use crate::sweep::variants::entry;

/// Sections whose keys can be axes: they say how a cell is built and trained, and not which cells there are.
const SECTIONS: [&str; 3] = ["train", "model", "tokenizer"];

/// Combinations of values that a sweep varies, at most: each is planned by itself.
const MOST_COMBINATIONS: f64 = 1000.0;

/// What is wrong with the keys that the grid varies; `of_sweep` finds what is wrong with a sweep that varies
/// nothing.
pub fn problems(sweep: &Sweep, of_sweep: fn(&Sweep) -> Vec<Problem>) -> Vec<Problem> {
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
        let message = match (outside_of_sweep(&at_key(key, value)).pop(), sweep.with(key, value)) {
            (Some(problem), _) => Some(problem.message),
            (None, Err(message)) => Some(message),
            (None, Ok(own)) => fresh(&own),
        };
        message.map(|message| Problem::value(format!("{path}[{i}]"), message))
    };
    values.iter().enumerate().filter_map(of_value).collect()
}

/// A sweep file with a value at a key and nothing else.
fn at_key(key: &str, value: &Value) -> serde_yaml::Value {
    let mut file = serde_yaml::Value::Null;
    if let (Some(place), Ok(value)) = (entry(&mut file, key), serde_yaml::to_value(value)) {
        *place = value;
    }
    file
}

#[cfg(test)]
mod tests {
    use crate::sweep::parse;

    const MANY: &str = "{train.lr: [1, 2, 3, 4, 5, 6, 7, 8], train.min_steps: [1, 2, 3, 4, 5, 6, 7, 8], \
        train.weight_decay: [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8], \
        train.clip_norm: [1, 2, 3, 4, 5, 6, 7, 8]}";
    const TEXT: &str =
        "name: t\ngrid:\n  models: scamo\n  vocab: [64]\n  budgets: [1e18]\n  vary: VARY\n";

    #[test]
    fn keys_and_values_that_cannot_be_varied_are_shown_where_they_stand() {
        let told = |vary: &str| {
            parse("t.yaml", &TEXT.replace("VARY", vary), &[]).expect_err("wrong").render(false)
        };
        for (vary, place, words) in [
            ("{data.seed: [1, 2]}", "t.yaml:6:10", "a key of train, model or tokenizer"),
            ("{train.lr: []}", "t.yaml:6:20", "no value"),
            ("{train.lr: [1e-3, 1e-3]}", "t.yaml:6:20", "a value stands twice"),
            ("{train.lr: [1e-3, many]}", "t.yaml:6:27", "expected a number"),
            ("{train.rate: [1]}", "t.yaml:6:23", "unknown field"),
            ("{train.min_steps: [0]}", "t.yaml:6:28", "out of range: 1 to"),
            (
                "{train.schedule.warmup: [0.1, 0.6], train.schedule.decay: [0.2, 0.6], train.schedule.kind: [wsd]}",
                "t.yaml:6:9",
                "warmup=0.6: warm-up and decay together are more",
            ),
            (MANY, "t.yaml:6:9", "4096 combinations"),
        ] {
            let told = told(vary);
            assert!(told.contains(place) && told.contains(words), "{vary}: {told}");
        }
    }
}
