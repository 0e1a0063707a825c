//! `grid.vary`: expands one sweep into several that differ in given keys.

use serde_json::Value;

use super::overrides;
use super::problem::Problem;
use super::sections::Sweep;

/// Sections whose keys can be axes: they say how a cell is built and trained, and not which cells there are.
const SECTIONS: [&str; 3] = ["train", "model", "tokenizer"];

/// A sweep with one value for each varied key.
#[derive(Clone, Debug, PartialEq)]
pub struct Variant {
    /// `train.lr=0.001, train.weight_decay=0`; `None` if nothing is varied.
    pub label: Option<String>,
    pub sweep: Sweep,
}

impl Sweep {
    /// The sweep for each combination of varied keys; itself if nothing varies.
    ///
    /// # Panics
    /// Values are invalid at their keys, which the check of a sweep refuses.
    pub fn variants(&self) -> Vec<Variant> {
        let variants = self.combined().collect::<Result<_, _>>();
        variants.expect("checked when the sweep was read")
    }

    /// The combinations one by one: the sweep, or serde's error after the label of the invalid value.
    pub(super) fn combined(&self) -> impl Iterator<Item = Result<Variant, String>> {
        let mut plain = self.clone();
        let vary = std::mem::take(&mut plain.grid.vary);
        let n_combinations = vary.values().map(Vec::len).product();
        (0..n_combinations).map(move |mut place: usize| {
            let mut variant = Variant { label: None, sweep: plain.clone() };
            for (key, values) in &vary {
                let value = &values[place % values.len()];
                place /= values.len();
                variant = variant.with(key, value)?;
            }
            Ok(variant)
        })
    }

    /// The sweep with a value at a key.
    ///
    /// # Errors
    /// serde's error of an invalid value.
    pub(super) fn with(&self, key: &str, value: &Value) -> Result<Self, String> {
        let mut whole = serde_yaml::to_value(self).map_err(|error| error.to_string())?;
        let problem = overrides::apply(&mut whole, &[setting(key, value)]).pop();
        match problem {
            Some(problem) => Err(problem.message),
            None => serde_yaml::from_value(whole).map_err(|error| error.to_string()),
        }
    }
}

impl Variant {
    fn with(&self, key: &str, value: &Value) -> Result<Self, String> {
        let own = setting(key, value);
        let label =
            self.label.as_ref().map_or_else(|| own.clone(), |label| format!("{label}, {own}"));
        let sweep = self.sweep.with(key, value).map_err(|problem| format!("{label}: {problem}"))?;
        Ok(Self { label: Some(label), sweep })
    }
}

/// `train.lr=0.001`; JSON is YAML.
fn setting(key: &str, value: &Value) -> String {
    match value {
        Value::String(text) => format!("{key}={text}"),
        other => format!("{key}={other}"),
    }
}

// Problems of the varied keys.

/// Combinations of values that a sweep varies, at most: each is planned by itself.
const MOST_COMBINATIONS: f64 = 1000.0;

/// Problems of the varied keys; `of_sweep` finds the problems of a single sweep.
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
        let message = match sweep.with(key, value) {
            Err(message) => Some(message),
            Ok(own) => fresh(&own),
        };
        message.map(|message| Problem::value(format!("{path}[{i}]"), message))
    };
    values.iter().enumerate().filter_map(of_value).collect()
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
    fn every_combination_is_a_sweep_of_its_own() {
        let vary = "{train.lr: [1e-3, 3e-3], train.weight_decay: [0, 0.1, 0.3]}";
        let sweep = parse("t.yaml", &TEXT.replace("VARY", vary), &[]).expect("a sweep");
        let variants = sweep.variants();
        let labels: Vec<&str> =
            variants.iter().filter_map(|variant| variant.label.as_deref()).collect();
        assert_eq!(labels.len(), 6);
        assert_eq!(labels[0], "train.lr=0.001, train.weight_decay=0");
        let last = &variants[5].sweep;
        assert_eq!((last.train.lr.coefficient, last.train.weight_decay), (3e-3, 0.3));
        assert!(last.train.lr.is_constant() && last.grid.vary.is_empty());
        let plain = parse("t.yaml", &TEXT.replace("VARY", "{}"), &[]).expect("a sweep");
        assert_eq!((plain.variants().len(), &plain.variants()[0].label), (1, &None));
    }

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
            ("{train.min_steps: [0]}", "t.yaml:6:28", "at least one step"),
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
