//! `--set path=value`: settings laid over a sweep file before it is checked.

use serde_yaml::{Mapping, Value};

use super::merge::KIND;
use super::presets::{INCLUDE, PRESET};
use super::problem::Problem;

/// Lays each setting over `value`; what cannot be applied is returned as a problem.
pub fn apply(value: &mut Value, settings: &[String]) -> Vec<Problem> {
    settings.iter().filter_map(|setting| set(value, setting).err()).collect()
}

fn set(value: &mut Value, setting: &str) -> Result<(), Problem> {
    let wrong = |reason: &str| {
        Problem::value("", format!("--set {setting}: {reason}"))
            .with_help("write it as --set train.min_steps=100 or --set 'grid.budgets=[1e9, 1e10]'")
    };
    let (path, text) = setting.split_once('=').ok_or_else(|| wrong("no `=` in it"))?;
    let new = serde_yaml::from_str(text).map_err(|_| wrong("the value is not valid YAML"))?;
    let place = steps(path)
        .and_then(|steps| steps.iter().try_fold(value, |at, step| step.enter(at)))
        .ok_or_else(|| wrong("there is no such entry"))?;
    *place = new;
    Ok(())
}

/// The settings that say of what kind a section is, or which preset or file a sweep lies over: what is kept of
/// a preset depends on them.
pub fn of_kinds(settings: &[String]) -> Vec<String> {
    let says = |setting: &&String| {
        let path = setting.split_once('=').map_or("", |(path, _)| path);
        path == PRESET || path == INCLUDE || path.rsplit('.').next() == Some(KIND)
    };
    settings.iter().filter(says).cloned().collect()
}

/// Marks a problem as the fault of the setting that it stems from, where there is one.
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
    use super::*;

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
