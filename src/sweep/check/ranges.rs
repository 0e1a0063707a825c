//! Numbers outside of their ranges, which stand in the schema of the sections, at their fields.

use std::sync::LazyLock;

use schemars::schema_for;
use serde_json::Value as Schema;
use serde_yaml::Value;

use crate::sweep::problem::Problem;
use crate::sweep::sections::{SlurmSection, Sweep};
use crate::units::number::of_value;

static SWEEP: LazyLock<Schema> = LazyLock::new(|| schema_for!(Sweep).to_value());
static PROFILE: LazyLock<Schema> = LazyLock::new(|| schema_for!(SlurmSection).to_value());

/// Those of a sweep file, or of a part of one, as it is written.
pub fn of_sweep(keys: &Value) -> Vec<Problem> {
    problems(&SWEEP, &SWEEP, keys, String::new())
}

/// Those of a profile.
pub fn of_profile(keys: &Value) -> Vec<Problem> {
    problems(&PROFILE, &PROFILE, keys, String::new())
}

/// Those of a value at a path, by the schema of what may stand there in a file of the schema `whole`.
fn problems(whole: &Schema, schema: &Schema, value: &Value, path: String) -> Vec<Problem> {
    if let Some(name) = schema["$ref"].as_str() {
        let definition = &whole["$defs"][name.trim_start_matches("#/$defs/")];
        return problems(whole, definition, value, path);
    }
    let ways = ["anyOf", "oneOf"].into_iter().filter_map(|key| schema[key].as_array()).flatten();
    let mut found: Vec<Problem> =
        ways.flat_map(|way| problems(whole, way, value, path.clone())).collect();
    match value {
        Value::Mapping(keys) => {
            for (key, value) in keys {
                let Some(key) = key.as_str() else { continue };
                let of_key =
                    schema["properties"].get(key).unwrap_or(&schema["additionalProperties"]);
                let path = if path.is_empty() { key.to_string() } else { format!("{path}.{key}") };
                found.extend(problems(whole, of_key, value, path));
            }
        }
        Value::Sequence(items) => {
            for (i, item) in items.iter().enumerate() {
                found.extend(problems(whole, &schema["items"], item, format!("{path}[{i}]")));
            }
        }
        _ => found.extend(outside(schema, value).map(|message| Problem::value(path, message))),
    }
    found
}

/// A sentence about a number outside of the range of its schema.
fn outside(schema: &Schema, value: &Value) -> Option<String> {
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
    if is_round && short.len() < 8 { short } else { number.to_string().replace(".0", "") }
}
