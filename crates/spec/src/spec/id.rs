//! Ids by content, and what differs between two specs.

use serde::Serialize;
use serde_json::Value;

/// The fields of two specs of a kind that differ, by path: `lr`, `model.d_ff`.
pub fn changed_fields<T: Serialize>(ours: &T, theirs: &T) -> Vec<String> {
    let value = |spec: &T| serde_json::to_value(spec).expect("specs are plain values");
    let mut changed = Vec::new();
    differences("", &value(ours), &value(theirs), &mut changed);
    changed
}

fn differences(path: &str, ours: &Value, theirs: &Value, changed: &mut Vec<String>) {
    match (ours, theirs) {
        (Value::Object(ours), Value::Object(theirs)) => {
            let only_theirs = theirs.keys().filter(|name| !ours.contains_key(*name));
            for name in ours.keys().chain(only_theirs) {
                let path = if path.is_empty() { name.clone() } else { format!("{path}.{name}") };
                let [ours, theirs] =
                    [ours, theirs].map(|keys| keys.get(name).unwrap_or(&Value::Null));
                differences(&path, ours, theirs, changed);
            }
        }
        _ if ours != theirs => changed.push(path.to_string()),
        _ => {}
    }
}

/// Sixteen hex digits of the blake3 hash of a value's JSON, whose fields stand in a fixed order.
pub fn content_id(value: &impl Serialize) -> String {
    let json = serde_json::to_string(value).expect("specs are plain values");
    blake3::hash(json.as_bytes()).to_hex()[..16].to_string()
}
