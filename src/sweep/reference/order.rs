//! The keys of a section in the order in which they are declared, which a schema forgets.

use serde_yaml::{Mapping, Value};

use crate::sweep::sections::Sweep;

/// A step from the whole file to a part of it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Step {
    /// A key of a section.
    Key(String),
    /// An entry of a list.
    Entry,
    /// A key of one's own choice.
    AnyKey,
}

/// A key that no section has.
const UNKNOWN: &str = "?";

/// The keys that may stand at a place: those that the error names when an unknown key stands there.
/// Empty where any key may.
pub fn keys_at(path: &[Step]) -> Vec<String> {
    let Err(error) = serde_yaml::from_value::<Sweep>(with_unknown_key(path, path.len())) else {
        return Vec::new();
    };
    let message = error.to_string();
    let mut names = message.split('`').skip(1).step_by(2);
    match names.next() {
        Some(UNKNOWN) => names.map(ToString::to_string).collect(),
        _ => Vec::new(),
    }
}

/// The first `depth` steps of a path, with an unknown key at their end.
fn with_unknown_key(path: &[Step], depth: usize) -> Value {
    let mapping = |key: &str, value| Value::Mapping(Mapping::from_iter([(key.into(), value)]));
    let end = mapping(UNKNOWN, Value::Null);
    (0..depth).rev().fold(end, |below, at| match &path[at] {
        Step::Key(key) => mapping(key, below),
        Step::Entry => Value::Sequence(vec![below]),
        Step::AnyKey => {
            let known = keys_at(&path[..at]);
            mapping(known.first().map_or(UNKNOWN, String::as_str), below)
        }
    })
}

#[cfg(test)]
mod tests {
    use super::{Step, keys_at};

    #[test]
    fn keys_stand_in_the_order_of_the_section() {
        let key = |key: &str| Step::Key(key.to_string());
        assert_eq!(keys_at(&[])[..3], ["preset", "include", "name"]);
        assert_eq!(keys_at(&[key("grid")])[..3], ["models", "vocab", "budgets"]);
        let entry = [key("grid"), key("models"), Step::Entry];
        assert_eq!(keys_at(&entry), ["n_layer", "n_head", "d_model", "d_ff"]);
        let rule = keys_at(&entry[..2]);
        assert_eq!(rule, ["d_model", "width_per_layer", "head_dim"]);
        let stages = [key("engine"), key("slurm"), key("stages"), Step::AnyKey];
        assert_eq!(keys_at(&stages[..3]), ["inputs", "train", "fit"]);
        assert_eq!(keys_at(&stages)[0], "partition");
        let env = [key("engine"), key("slurm"), key("env")];
        assert!(keys_at(&env).is_empty());
    }
}
