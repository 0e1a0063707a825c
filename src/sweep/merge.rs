//! Keys laid over keys: a sweep file over a preset.

use serde_yaml::{Mapping, Value};

/// The key that says what a section is.
pub const KIND: &str = "kind";

/// `own` over `below`, and the paths at which `own` stands whole in place of what is below.
///
/// Mappings merge key by key; all else replaces. A mapping with a `kind` that is not the one below
/// replaces that too, whose other keys belong to another kind.
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
}
