//! Ranges of numbers: each stands at its field, and so in the JSON schema of its section.

use serde_json::Value as Schema;
use serde_yaml::Value;

use super::number::of_value;

/// The paths of the numbers outside their ranges, each with a sentence, in the order of the file.
pub fn outside(schema: &Schema, value: &Value) -> Vec<(String, String)> {
    let mut found = Vec::new();
    walk(schema, schema, value, String::new(), &mut found);
    found
}

/// Notes the numbers of a value at a path, by the schema of this place in a file of the schema `whole`.
fn walk(
    whole: &Schema,
    schema: &Schema,
    value: &Value,
    path: String,
    found: &mut Vec<(String, String)>,
) {
    if let Some(name) = schema["$ref"].as_str() {
        let definition = &whole["$defs"][name.trim_start_matches("#/$defs/")];
        return walk(whole, definition, value, path, found);
    }
    for way in ["anyOf", "oneOf"].into_iter().filter_map(|key| schema[key].as_array()).flatten() {
        walk(whole, way, value, path.clone(), found);
    }
    match value {
        Value::Mapping(keys) => {
            for (key, value) in keys {
                let Some(key) = key.as_str() else { continue };
                let of_key =
                    schema["properties"].get(key).unwrap_or(&schema["additionalProperties"]);
                let path = if path.is_empty() { key.to_string() } else { format!("{path}.{key}") };
                walk(whole, of_key, value, path, found);
            }
        }
        Value::Sequence(items) => {
            for (i, item) in items.iter().enumerate() {
                walk(whole, &schema["items"], item, format!("{path}[{i}]"), found);
            }
        }
        _ => found.extend(problem(schema, value).map(|problem| (path, problem))),
    }
}

/// A sentence about a number outside the range of its schema.
fn problem(schema: &Schema, value: &Value) -> Option<String> {
    let (low, high) = (schema["minimum"].as_f64()?, schema["maximum"].as_f64()?);
    let number = of_value(value).ok().filter(|number| !(low..=high).contains(number))?;
    Some(format!("{number} is out of range: {}", in_words(schema)?))
}

/// `1 to 8192`, the range of a schema; `None` if it has none.
pub fn in_words(schema: &Schema) -> Option<String> {
    let bound = |key| schema[key].as_number().map(written);
    Some(format!("{} to {}", bound("minimum")?, bound("maximum")?))
}

/// A number as people write it: large ones and tiny ones as `1e9`.
fn written(number: &serde_json::Number) -> String {
    let value = number.as_f64().unwrap_or_default();
    let is_round = value != 0.0 && !(1e-4..1e6).contains(&value.abs());
    let short = format!("{value:e}");
    match number.as_u64() {
        _ if is_round && short.len() < 8 => short,
        Some(whole) => whole.to_string(),
        None => value.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn a_number_outside_its_range_is_told_with_its_path_and_the_range() {
        let schema = json!({
            "properties": {
                "a": {"anyOf": [{"$ref": "#/$defs/A"}, {"type": "null"}]},
                "b": {"items": {"minimum": 1e-9, "maximum": 1}},
            },
            "$defs": {"A": {"properties": {"n": {"minimum": 1, "maximum": 1_000_000_000}}}},
        });
        let file = "{a: {n: 0, m: -1}, b: [0.5, 1e-10, 2, many], c: -1}";
        let found = outside(&schema, &serde_yaml::from_str(file).unwrap());
        let expected = [
            ("a.n", "0 is out of range: 1 to 1e9"),
            ("b[1]", "0.0000000001 is out of range: 1e-9 to 1"),
            ("b[2]", "2 is out of range: 1e-9 to 1"),
        ];
        assert_eq!(found, expected.map(|(path, problem)| (path.into(), problem.into())));
    }
}
