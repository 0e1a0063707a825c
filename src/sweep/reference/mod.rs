//! The page about sweep files and their JSON Schema, made from the descriptions and the defaults of their sections.

mod words;

use schemars::schema_for;
use serde_json::{Map, Value, json};

use super::sections::Sweep;
use words::{Kind, Node, Step, keys_at};

const HEAD: &str = "\
<!-- Made from src/sweep/sections and crates/spec/src/spec; written by
     ISOFLOP_BLESS=1 cargo test --release --test reference_page -->

# The sweep file

A sweep file is YAML. `name` and `grid` must be written, unless a preset has them ([presets.md](presets.md));
every other key may be left out. An unknown key and an impossible value are errors, shown at their place
with the nearest valid name.

- Each key has its section; a key of a section within a section is written `train.lr.max` here.
- Where the default is empty, nothing stands there unless it is written.
- Numbers may be written `1e6`, `0.5` or `1_000`; whole numbers too.
- `--set train.lr.max=0.01` writes one value over the file's.
- Editors that know YAML check a file as it is written by its first line, `# yaml-language-server:
  $schema=PATH`, where PATH is that of [sweep.schema.json](sweep.schema.json), which `isoflop schema` prints.
- `isoflop plan SWEEP.yaml` says what a sweep would do before anything runs.

## A complete example

[experiments/quickstart.yaml](../experiments/quickstart.yaml):

```yaml
";

const EXAMPLE: &str = include_str!("../../../experiments/quickstart.yaml");

/// The JSON Schema of sweep files, `docs/sweep.schema.json`; keys of a preset are optional.
pub fn schema() -> Value {
    let mut schema = schema_for!(Sweep).to_value();
    two_ways(&mut schema);
    schema
}

/// The page about sweep files, `docs/sweep-file.md`.
pub fn reference() -> String {
    let schema = schema_for!(Sweep).to_value();
    let mut page = Page { text: format!("{HEAD}{}```\n", code(EXAMPLE)), above: Vec::new() };
    page.section(Node::of_file(&schema), &[]);
    page.text
}

/// A file without the comments at its head.
fn code(file: &str) -> String {
    let lines = file.lines().skip_while(|line| line.starts_with('#'));
    lines.map(|line| format!("{line}\n")).collect()
}

struct Page {
    text: String,
    /// The sections around the one that is written: their names, and the lines of their tables.
    above: Vec<(String, Vec<String>)>,
}

impl Page {
    /// A section: its table, its words, and the sections within.
    fn section(&mut self, section: Node<'_>, path: &[Step]) {
        let Kind::Section(mut keys) = section.kind() else { return };
        let declared = keys_at(path);
        keys.sort_by_key(|(key, _)| declared.iter().position(|name| name == key));
        let name = dotted(path);
        self.heading(section, path, &name);

        let lines: Vec<String> = keys.iter().map(|(key, node)| line(section, key, *node)).collect();
        let same = self.above.iter().find(|(_, above)| lines.iter().all(|l| above.contains(l)));
        if let Some((above, _)) = same {
            let keys: Vec<String> = keys.iter().map(|(key, _)| format!("`{key}`")).collect();
            self.text += &format!("The same as in `{above}`: {}.\n", keys.join(", "));
            return;
        }
        self.text += "| key | value | default | meaning |\n| --- | --- | --- | --- |\n";
        self.text.extend(lines.iter().map(String::as_str));

        self.above.push((name, lines));
        let below = |key: &str| [path, &[Step::Key(key.to_string())]].concat();
        for (key, node) in &keys {
            self.words(*node, &below(key), &mut Vec::new());
        }
        for (key, node) in keys {
            self.sections(node, &below(key));
        }
        self.above.pop();
    }

    fn heading(&mut self, section: Node<'_>, path: &[Step], name: &str) {
        let (tag, about) = match section.tag() {
            Some(tag) => (format!(" {tag}"), section.description()),
            None => (String::new(), section.type_description()),
        };
        self.text += &match path.len() {
            0 => "\n## All keys\n\n".to_string(),
            1 => format!("\n## `{name}`{tag}\n\n"),
            _ => format!("\n### `{name}`{tag}\n\n"),
        };
        if !about.is_empty() {
            self.text += &format!("{about}\n\n");
        }
        if let Some((Step::AnyKey, above)) = path.split_last() {
            let names: Vec<String> =
                keys_at(above).iter().map(|name| format!("`{name}`")).collect();
            if !names.is_empty() {
                self.text += &format!("`*` is one of {}.\n\n", names.join(", "));
            }
        }
    }

    /// The sections within a value.
    fn sections(&mut self, node: Node<'_>, path: &[Step]) {
        match node.kind() {
            Kind::Section(_) => self.section(node, path),
            Kind::Names(of) => self.sections(of, &[path, &[Step::AnyKey]].concat()),
            Kind::List(of) => self.sections(of, &[path, &[Step::Entry]].concat()),
            Kind::Ways(ways) => ways.into_iter().for_each(|way| self.sections(way, path)),
            Kind::Choice(_) | Kind::Plain(_) => {}
        }
    }

    /// The meaning of a value's words, and its notations; `told` are already described ones.
    fn words(&mut self, node: Node<'_>, path: &[Step], told: &mut Vec<String>) {
        match node.kind() {
            Kind::Names(of) => self.words(of, &[path, &[Step::AnyKey]].concat(), told),
            Kind::List(of) => self.words(of, &[path, &[Step::Entry]].concat(), told),
            Kind::Choice(words) => {
                if !told.contains(&node.in_words()) {
                    // Words without a description are listed together.
                    let own = |word: &Node<'_>| word.remark().filter(|_| word.words().len() == 1);
                    let meaning = |word| own(word).unwrap_or_default();
                    let meanings = words.iter().map(|word| (word.in_words(), meaning(word)));
                    self.list(path, meanings.collect());
                    told.push(node.in_words());
                }
            }
            Kind::Ways(ways) => {
                let own = ways.iter().filter_map(|way| Some((way.in_words(), way.remark()?)));
                let own: Vec<_> = own.collect();
                told.extend(own.iter().map(|(way, _)| way.clone()));
                self.list(path, own);
                ways.into_iter().for_each(|way| self.words(way, path, told));
            }
            Kind::Section(_) | Kind::Plain(_) => {}
        }
    }

    fn list(&mut self, path: &[Step], ways: Vec<(String, String)>) {
        if !ways.is_empty() {
            self.text += &format!("\n`{}` is\n\n", dotted(path));
        }
        for (way, meaning) in ways {
            self.text += &format!("- {way}: {meaning}\n");
        }
    }
}

/// The line of a key in the table of its section.
fn line(section: Node<'_>, key: &str, node: Node<'_>) -> String {
    let default = match node.default() {
        _ if section.requires(key) => "required".to_string(),
        Some(default) => format!("`{default}`"),
        None => String::new(),
    };
    let cells = [format!("`{key}`"), node.in_words(), default, node.description()];
    let cells = cells.map(|cell| cell.replace("\n\n", " ").replace('|', "\\|"));
    format!("| {} |\n", cells.join(" | "))
}

/// `grid.models[].d_model`, and `*` for a free key.
fn dotted(path: &[Step]) -> String {
    let text: String = path
        .iter()
        .map(|step| match step {
            Step::Key(key) => format!(".{key}"),
            Step::Entry => "[]".to_string(),
            Step::AnyKey => ".*".to_string(),
        })
        .collect();
    text.trim_start_matches('.').to_string()
}

// Required keys of a sweep file without a preset or included file.

/// Moves the required keys of sections into two alternatives: over a preset or a file nothing is required; without
/// one, all of them are.
fn two_ways(schema: &mut Value) {
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

/// The definition of a key's value, alone or with null.
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

/// Adds the required keys of the section at a path.
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
