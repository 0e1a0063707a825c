//! Overrides of keys: a sweep file over its preset or included file, and `--set path=value` over both.

use serde_yaml::{Mapping, Value};

use super::problem::Problem;
use super::variants::entry;

/// The key of a sweep file that names a preset.
pub const PRESET: &str = "preset";

/// The key of a sweep file that names the file below it.
pub const INCLUDE: &str = "include";
/// The key of a section's kind.
pub const KIND: &str = "kind";

/// `own` over `below`, and the paths at which `own` replaces `below` entirely.
///
/// Mappings merge key by key; everything else is replaced. A mapping with a different `kind` is also replaced, since
/// its keys belong to that kind.
pub fn over(own: Mapping, below: Mapping) -> (Mapping, Vec<String>) {
    let mut replaced = Vec::new();
    let merged = merged(own, below, "", &mut replaced);
    (merged, replaced)
}

fn merged(own: Mapping, below: Mapping, path: &str, replaced: &mut Vec<String>) -> Mapping {
    let mut merged = below;
    for (key, value) in own {
        let path = dotted(path, &key);
        let value = match (value, merged.remove(&key)) {
            (Value::Mapping(own), Some(Value::Mapping(below))) if !is_another(&own, &below) => {
                Value::Mapping(self::merged(own, below, &path, replaced))
            }
            (value, below) => {
                replaced.extend(below.is_some().then_some(path));
                value
            }
        };
        merged.insert(key, value);
    }
    merged
}

/// Whether one mapping says that it is of another kind than the other.
fn is_another(own: &Mapping, below: &Mapping) -> bool {
    own.get(KIND).is_some_and(|kind| below.get(KIND) != Some(kind))
}

fn dotted(path: &str, key: &Value) -> String {
    let key = key.as_str().unwrap_or("?");
    if path.is_empty() { key.to_string() } else { format!("{path}.{key}") }
}

// Settings.

/// Applies each setting to `value`; settings that cannot be applied are returned as problems.
pub fn apply(value: &mut Value, settings: &[String]) -> Vec<Problem> {
    settings.iter().filter_map(|setting| set(value, setting).err()).collect()
}

fn set(value: &mut Value, setting: &str) -> Result<(), Problem> {
    let wrong = |reason: &str| {
        Problem::value("", format!("--set {setting}: {reason}"))
            .with_help("write it as --set train.min_steps=100 or --set 'grid.budgets=[1e9, 1e10]'")
    };
    let (place, text) = setting.split_once('=').ok_or_else(|| wrong("no `=` in it"))?;
    let new = serde_yaml::from_str(text).map_err(|_| wrong("the value is not valid YAML"))?;
    *entry(value, place).ok_or_else(|| wrong("there is no such entry"))? = new;
    Ok(())
}

/// The settings of a section's kind, or of the preset or file below a sweep: they decide which keys of a preset are
/// kept.
pub fn of_kinds(settings: &[String]) -> Vec<String> {
    let says = |setting: &&String| {
        let path = setting.split_once('=').map_or("", |(path, _)| path);
        path == PRESET || path == INCLUDE || path.rsplit('.').next() == Some(KIND)
    };
    settings.iter().filter(says).cloned().collect()
}

/// Attributes a problem to the setting that caused it, if there is one.
pub fn blame(problem: &mut Problem, settings: &[String]) {
    let within = |path: &str| {
        let rest = problem.path.strip_prefix(path);
        rest.is_some_and(|rest| rest.is_empty() || rest.starts_with(['.', '[']))
    };
    let guilty = settings
        .iter()
        .rev()
        .find(|setting| setting.split_once('=').is_some_and(|(path, _)| within(path)));
    problem.setting = guilty.cloned();
}

#[cfg(test)]
mod tests {
    use super::*;

    fn laid(own: &str, below: &str) -> (Value, Vec<String>) {
        let [own, below] = [own, below].map(|text| serde_yaml::from_str(text).expect("YAML"));
        let (merged, replaced) = over(own, below);
        (Value::Mapping(merged), replaced)
    }

    fn yaml(text: &str) -> Value {
        serde_yaml::from_str(text).expect("YAML")
    }

    #[test]
    fn mappings_merge_key_by_key_and_all_else_replaces() {
        let below = "{a: {b: 1, c: [1, 2]}, d: 3, e: {f: 4}}";
        let (merged, replaced) = laid("{a: {c: [5]}, e: null, g: 6}", below);
        assert_eq!(merged, yaml("{a: {b: 1, c: [5]}, d: 3, e: null, g: 6}"));
        assert_eq!(replaced, ["a.c", "e"]);
    }

    #[test]
    fn a_section_of_another_kind_takes_no_key_of_the_one_below() {
        let below = "{t: {kind: x, layers: 9, q: {kind: r, depth: 6}}, d: {clips: 5}}";
        let (merged, replaced) = laid("{t: {q: {kind: s}}, d: {kind: m}}", below);
        assert_eq!(merged, yaml("{t: {kind: x, layers: 9, q: {kind: s}}, d: {kind: m}}"));
        assert_eq!(replaced, ["t.q", "d"]);
        let (merged, _) = laid("{t: {kind: y}}", below);
        assert_eq!(merged, yaml("{t: {kind: y}, d: {clips: 5}}"));
        let (merged, replaced) = laid("{t: {kind: x, layers: 3}}", below);
        assert_eq!(merged["t"], yaml("{kind: x, layers: 3, q: {kind: r, depth: 6}}"));
        assert_eq!(replaced, ["t.kind", "t.layers"]);
    }

    #[test]
    fn settings_change_deep_entries_and_make_missing_sections() {
        let mut value: Value = serde_yaml::from_str("grid: {models: [{n_layer: 1}]}").unwrap();
        let settings = ["grid.models[0].n_layer=3".to_string(), "data.path=/a=b".to_string()];
        assert_eq!(apply(&mut value, &settings), []);
        assert_eq!(value["grid"]["models"][0]["n_layer"], Value::from(3));
        assert_eq!(value["data"]["path"], Value::from("/a=b"));
    }

    #[test]
    fn a_setting_that_fits_nowhere_is_a_problem() {
        let mut value: Value = serde_yaml::from_str("seeds: [0]").unwrap();
        for setting in ["seeds", "seeds[4]=1", "seeds.a=1", "seeds=[1"] {
            assert_eq!(apply(&mut value, &[setting.to_string()]).len(), 1, "{setting}");
        }
    }
}
