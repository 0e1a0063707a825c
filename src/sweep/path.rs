//! Entries of a value by their paths, as `grid.models[1].n_head`.

use serde_yaml::{Mapping, Value};

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
