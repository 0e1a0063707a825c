//! What a sweep file must have, where no preset or file below it may have it already.

use serde_json::{Map, Value, json};

/// Takes out of the schema what sections must have, and puts in its place the two ways to write a file: over
/// a preset or a file nothing is wanted, and without one all that was taken out.
pub fn two_ways(schema: &mut Value) {
    let written = schema.as_object_mut().and_then(|file| file.remove("required"));
    let mut whole = json!({ "required": written.unwrap_or_default() });
    for path in sections(schema, schema, &[]) {
        let wanted = at(schema, &path).and_then(|section| section.remove("required"));
        if let Some(wanted) = wanted {
            want(&mut whole, &path, wanted);
        }
    }
    schema["anyOf"] = json!([{ "required": ["preset"] }, { "required": ["include"] }, whole]);
}

/// Paths of the sections that a file's layers share, each after those around it. Entries of lists are of one
/// layer alone.
fn sections(schema: &Value, section: &Value, above: &[String]) -> Vec<Vec<String>> {
    let none = Map::new();
    let keys = section["properties"].as_object().unwrap_or(&none);
    let within = |(key, value): (&String, &Value)| {
        let path = [above, std::slice::from_ref(key)].concat();
        let inner = definition(value).map(|name| sections(schema, &schema["$defs"][name], &path));
        inner.map(|inner| [vec![path], inner].concat()).unwrap_or_default()
    };
    keys.iter().flat_map(within).collect()
}

/// The definition that a key's value has, itself or beside null.
fn definition(value: &Value) -> Option<&str> {
    let several = value["anyOf"].as_array().into_iter().flatten();
    let mut named = std::iter::once(value).chain(several).filter_map(|way| way["$ref"].as_str());
    named.next()?.strip_prefix("#/$defs/")
}

/// The definition of the section at a path.
fn at<'a>(schema: &'a mut Value, path: &[String]) -> Option<&'a mut Map<String, Value>> {
    let mut section: &Value = schema;
    let mut name = None;
    for key in path {
        name = definition(&section["properties"][key]);
        section = &schema["$defs"][name?];
    }
    let name = name?.to_string();
    schema["$defs"][&name].as_object_mut()
}

/// Adds what the section at a path must have.
fn want(whole: &mut Value, path: &[String], wanted: Value) {
    let mut place = whole;
    for key in path {
        place = &mut place["properties"][key];
    }
    place["required"] = wanted;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_sections_must_have_is_wanted_without_a_preset_alone() {
        let mut schema = json!({
            "required": ["grid"],
            "properties": {
                "grid": { "$ref": "#/$defs/Grid" },
                "trainer": { "anyOf": [{ "$ref": "#/$defs/Trainer" }, { "type": "null" }] },
                "name": { "type": "string" },
            },
            "$defs": {
                "Grid": {
                    "required": ["models"],
                    "properties": { "models": { "items": { "$ref": "#/$defs/Model" } } },
                },
                "Model": { "required": ["d_model"] },
                "Trainer": { "required": ["command"], "properties": {} },
            },
        });
        two_ways(&mut schema);
        let whole = json!({
            "required": ["grid"],
            "properties": {
                "grid": { "required": ["models"] },
                "trainer": { "required": ["command"] },
            },
        });
        assert_eq!(
            schema["anyOf"],
            json!([{ "required": ["preset"] }, { "required": ["include"] }, whole])
        );
        assert!(schema["$defs"]["Grid"].get("required").is_none());
        assert_eq!(schema["$defs"]["Model"]["required"], json!(["d_model"]));
    }
}
