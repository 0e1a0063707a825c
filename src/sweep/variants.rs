//! `grid.vary`: expands one sweep into several that differ in given keys.

use super::sections::Sweep;
use serde_json::Value as Json;
use serde_yaml::{Mapping, Value};

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
    pub(super) fn with(&self, key: &str, value: &Json) -> Result<Self, String> {
        let mut whole = serde_yaml::to_value(self).map_err(|error| error.to_string())?;
        let place = entry(&mut whole, key).ok_or("there is no such entry")?;
        *place = serde_yaml::to_value(value).map_err(|error| error.to_string())?;
        serde_yaml::from_value(whole).map_err(|error| error.to_string())
    }
}

impl Variant {
    fn with(&self, key: &str, value: &Json) -> Result<Self, String> {
        let own = setting(key, value);
        let label =
            self.label.as_ref().map_or_else(|| own.clone(), |label| format!("{label}, {own}"));
        let sweep = self.sweep.with(key, value).map_err(|problem| format!("{label}: {problem}"))?;
        Ok(Self { label: Some(label), sweep })
    }
}

/// `train.lr=0.001`; JSON is YAML.
fn setting(key: &str, value: &Json) -> String {
    match value {
        Json::String(text) => format!("{key}={text}"),
        other => format!("{key}={other}"),
    }
}

// Entries of a value by their paths, as `grid.models[1].n_head`.

/// The entry at a path, whose keys are made where they are missing; `None` where there can be none.
pub fn entry<'a>(value: &'a mut Value, path: &str) -> Option<&'a mut Value> {
    steps(path)?.iter().try_fold(value, |at, step| step.enter(at))
}

/// Takes the entry at `path` away; false where there is none.
pub fn remove(value: &mut Value, path: &str) -> bool {
    let Some(mut steps) = steps(path) else { return false };
    let Some(last) = steps.pop() else { return false };
    match (steps.iter().try_fold(value, |at, step| step.find(at)), last) {
        (Some(Value::Mapping(map)), PathStep::Key(key)) => map.remove(key.as_str()).is_some(),
        (Some(Value::Sequence(list)), PathStep::Index(i)) if i < list.len() => {
            list.remove(i);
            true
        }
        _ => false,
    }
}

enum PathStep {
    Key(String),
    Index(usize),
}

impl PathStep {
    fn find<'a>(&self, value: &'a mut Value) -> Option<&'a mut Value> {
        match self {
            PathStep::Key(key) => value.get_mut(key.as_str()),
            PathStep::Index(index) => value.get_mut(*index),
        }
    }

    /// Like `find`, but makes a missing key of a mapping.
    fn enter<'a>(&self, value: &'a mut Value) -> Option<&'a mut Value> {
        if value.is_null() {
            *value = Value::Mapping(Mapping::new());
        }
        match (self, value) {
            (PathStep::Key(key), Value::Mapping(map)) => {
                Some(map.entry(key.as_str().into()).or_insert(Value::Null))
            }
            (step, value) => step.find(value),
        }
    }
}

/// `grid.models[1].n_head` as steps.
fn steps(path: &str) -> Option<Vec<PathStep>> {
    let mut steps = Vec::new();
    for part in path.split('.') {
        let (key, indices) = part.split_at(part.find('[').unwrap_or(part.len()));
        if !key.is_empty() {
            steps.push(PathStep::Key(key.to_string()));
        }
        for index in indices.split('[').skip(1) {
            steps.push(PathStep::Index(index.strip_suffix(']')?.parse().ok()?));
        }
    }
    (!steps.is_empty()).then_some(steps)
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
}
