//! `grid.vary`: one sweep as several, which differ in keys of one's choice.

use serde_json::Value;

use super::overrides;
use super::sections::Sweep;

/// Sections whose keys can be axes: they say how a cell is built and trained, and not which cells there are.
pub const SECTIONS: [&str; 3] = ["train", "model", "tokenizer"];

/// A sweep with one value for each varied key.
#[derive(Clone, Debug, PartialEq)]
pub struct Variant {
    /// `train.lr=0.001, train.weight_decay=0`; `None` where nothing is varied.
    pub label: Option<String>,
    pub sweep: Sweep,
}

impl Sweep {
    /// The sweep once for each combination of what it varies; itself where it varies nothing.
    ///
    /// # Panics
    /// A value cannot stand at its key, which the check of a sweep refuses.
    pub fn variants(&self) -> Vec<Variant> {
        let mut plain = self.clone();
        let vary = std::mem::take(&mut plain.grid.vary);
        let mut all = vec![Variant { label: None, sweep: plain }];
        for (key, values) in vary {
            let of_value = |value: &Value| {
                let with = |variant: &Variant| {
                    variant.with(&key, value).expect("checked when the sweep was read")
                };
                all.iter().map(with).collect::<Vec<_>>()
            };
            all = values.iter().flat_map(of_value).collect();
        }
        all
    }

    /// The sweep with a value at a key.
    ///
    /// # Errors
    /// What cannot stand there, in serde's words.
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
        Ok(Self { label: Some(label), sweep: self.sweep.with(key, value)? })
    }
}

/// `train.lr=0.001`; JSON is YAML.
fn setting(key: &str, value: &Value) -> String {
    match value {
        Value::String(text) => format!("{key}={text}"),
        other => format!("{key}={other}"),
    }
}

#[cfg(test)]
mod tests {
    use crate::sweep::parse;

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
        ] {
            let told = told(vary);
            assert!(told.contains(place) && told.contains(words), "{vary}: {told}");
        }
    }
}
