//! What differs between the sweeps of studies.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::Result;
use isoflop::files::{FileError, read_text_if_there};
use serde::Serialize;
use serde_yaml::Value;

/// A key whose values differ: one a study, `None` where it has none.
#[derive(Debug, PartialEq, Eq, Serialize)]
pub struct SweepDifference {
    pub key: String,
    pub values: Vec<Option<String>>,
}

impl SweepDifference {
    /// Of the frozen sweeps in folders; nothing where one has none.
    pub fn of(folders: &[&Path]) -> Result<Vec<Self>> {
        let mut all: Vec<BTreeMap<String, String>> = Vec::new();
        for folder in folders {
            // A laws.json stands for no folder.
            if !folder.is_dir() {
                return Ok(Vec::new());
            }
            let path = folder.join("sweep.yaml");
            let Some(text) = read_text_if_there(&path)? else { return Ok(Vec::new()) };
            let value = serde_yaml::from_str(&text).map_err(|e| FileError::damaged(&path, e))?;
            let mut keys = BTreeMap::new();
            flatten("", &value, &mut keys);
            all.push(keys);
        }
        Ok(differences(&all))
    }
}

fn differences(all: &[BTreeMap<String, String>]) -> Vec<SweepDifference> {
    let keys: std::collections::BTreeSet<&String> = all.iter().flat_map(BTreeMap::keys).collect();
    let difference = |key: &String| {
        let values: Vec<Option<String>> = all.iter().map(|keys| keys.get(key).cloned()).collect();
        let differs = values.iter().any(|value| *value != values[0]);
        differs.then(|| SweepDifference { key: key.clone(), values })
    };
    keys.into_iter().filter_map(difference).collect()
}

/// Keys with dots; a list is one value.
fn flatten(key: &str, value: &Value, keys: &mut BTreeMap<String, String>) {
    let Value::Mapping(mapping) = value else {
        let text = serde_json::to_string(value).unwrap_or_default();
        keys.insert(key.to_string(), text);
        return;
    };
    for (name, value) in mapping {
        let name = name.as_str().unwrap_or_default();
        let key = if key.is_empty() { name.to_string() } else { format!("{key}.{name}") };
        flatten(&key, value, keys);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_that_differ_are_told_with_their_values() {
        let keys = |text: &str| {
            let mut keys = BTreeMap::new();
            flatten("", &serde_yaml::from_str(text).unwrap(), &mut keys);
            keys
        };
        let found = differences(&[
            keys("name: a\ngrid: {vocab: [1, 2], budgets: [1e9]}\ntrain: {lr: 1}"),
            keys("name: b\ngrid: {vocab: [1, 2], budgets: [2e9]}"),
        ]);
        let found: Vec<(&str, &Option<String>)> =
            found.iter().map(|each| (each.key.as_str(), &each.values[1])).collect();
        let value = |text: &str| Some(text.to_string());
        assert_eq!(
            found,
            [
                ("grid.budgets", &value("[2000000000.0]")),
                ("name", &value("\"b\"")),
                ("train.lr", &None)
            ]
        );
    }
}
