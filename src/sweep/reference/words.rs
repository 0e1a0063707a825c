//! A JSON schema described for users, and the order of keys, which a schema does not keep.

use serde_json::Value;
use serde_yaml::{Mapping, Value as Yaml};

use crate::sweep::sections::Sweep;
use crate::units::ranges::in_words;

/// A schema, and the definitions that its references lead to.
#[derive(Clone, Copy)]
pub struct Node<'a> {
    schema: &'a Value,
    definitions: &'a Value,
}

/// The values that a schema allows.
pub enum Kind<'a> {
    /// Keys that are known.
    Section(Vec<(&'a str, Node<'a>)>),
    /// Free keys, and their values.
    Names(Node<'a>),
    /// A list, and its items.
    List(Node<'a>),
    /// Words.
    Choice(Vec<Node<'a>>),
    /// Several ways to write it.
    Ways(Vec<Node<'a>>),
    /// A text or a number, in words: one of it, and several.
    Plain([&'static str; 2]),
}

impl<'a> Node<'a> {
    /// The schema of a whole file.
    pub fn of_file(schema: &'a Value) -> Self {
        Self { schema, definitions: &schema["$defs"] }
    }

    fn with(self, schema: &'a Value) -> Self {
        Self { schema, ..self }
    }

    /// The target of a schema's reference, or the schema itself; `null` is ignored.
    fn target(self) -> Self {
        if let Some(name) = self.schema["$ref"].as_str() {
            let name = name.trim_start_matches("#/$defs/");
            return self.with(&self.definitions[name]).target();
        }
        match self.alternatives("anyOf")[..] {
            [only] => only.target(),
            _ => self,
        }
    }

    fn alternatives(self, key: &str) -> Vec<Self> {
        let all = self.schema[key].as_array().into_iter().flatten();
        all.filter(|schema| schema["type"] != "null").map(|schema| self.with(schema)).collect()
    }

    /// The values that it allows.
    pub fn kind(self) -> Kind<'a> {
        let node = self.target();
        let schema = node.schema;
        let referred = self.schema.get("$ref").map(|_| self.own_keys());
        let keys: Vec<_> = referred.into_iter().flatten().chain(node.own_keys()).collect();
        if !keys.is_empty() {
            return Kind::Section(keys);
        }
        if schema["additionalProperties"].is_object() {
            return Kind::Names(node.with(&schema["additionalProperties"]));
        }
        if schema["items"].is_object() {
            return Kind::List(node.with(&schema["items"]));
        }
        let one_of = node.alternatives("oneOf");
        if schema["enum"].is_array() || schema.get("const").is_some() {
            return Kind::Choice(vec![node]);
        }
        if !one_of.is_empty() && one_of.iter().all(|way| matches!(way.kind(), Kind::Choice(_))) {
            return Kind::Choice(one_of);
        }
        let any_of = node.alternatives("anyOf");
        match (one_of.is_empty(), any_of.is_empty()) {
            (false, _) => Kind::Ways(one_of),
            (_, false) => Kind::Ways(any_of),
            _ => Kind::Plain(plain(&schema["type"])),
        }
    }

    /// The keys that it names, in addition to those of its reference.
    fn own_keys(self) -> impl Iterator<Item = (&'a str, Self)> {
        let properties = self.schema["properties"].as_object().into_iter().flatten();
        properties.map(move |(key, of)| (key.as_str(), self.with(of)))
    }

    /// ``with `kind: fsq` `` of a section that is one of several and says so in a key.
    pub fn tag(self) -> Option<String> {
        let Kind::Section(keys) = self.kind() else { return None };
        let tag = keys.iter().find_map(|(key, of)| Some((key, of.schema["const"].as_str()?)));
        tag.map(|(key, word)| format!("with `{key}: {word}`"))
    }

    /// The words of a [`Kind::Choice`]: undocumented ones are grouped.
    pub fn words(self) -> Vec<&'a str> {
        let constant = self.schema.get("const").into_iter();
        let several = self.schema["enum"].as_array().into_iter().flatten();
        constant.chain(several).filter_map(Value::as_str).collect()
    }

    /// Its own description, or its type's.
    pub fn description(self) -> String {
        self.remark().unwrap_or_else(|| self.type_description())
    }

    /// Its own description, if it has one.
    pub fn remark(self) -> Option<String> {
        self.schema["description"].as_str().map(about)
    }

    /// The description of its type.
    pub fn type_description(self) -> String {
        about(self.target().schema["description"].as_str().unwrap_or_default())
    }

    /// Whether a key must be written.
    pub fn requires(self, key: &str) -> bool {
        let required = |node: Self| node.schema["required"].as_array().into_iter().flatten();
        required(self).chain(required(self.target())).any(|name| name == key)
    }

    /// Its default as YAML.
    pub fn default(self) -> Option<String> {
        yaml(self.schema.get("default")?)
    }

    /// The allowed values in words.
    pub fn in_words(self) -> String {
        self.counted(false)
    }

    fn counted(self, several: bool) -> String {
        match self.kind() {
            Kind::Section(_) => {
                let section = if several { "sections" } else { "section" };
                self.tag().map_or(section.to_string(), |tag| format!("{section} {tag}"))
            }
            Kind::Names(of) => format!("{} for each name", of.in_words()),
            Kind::List(of) => {
                let list = if several { "lists" } else { "list" };
                format!("{list} of {}", of.counted(true))
            }
            Kind::Choice(ways) => {
                let words: Vec<String> = ways
                    .iter()
                    .flat_map(|way| way.words())
                    .map(|word| format!("`{word}`"))
                    .collect();
                or(&words)
            }
            Kind::Ways(ways) => {
                or(&ways.iter().map(|way| way.counted(several)).collect::<Vec<_>>())
            }
            Kind::Plain(words) => {
                let range = in_words(self.target().schema);
                let range = range.map(|range| format!(" from {range}")).unwrap_or_default();
                format!("{}{range}", words[usize::from(several)])
            }
        }
    }
}

fn plain(kind: &Value) -> [&'static str; 2] {
    let kinds = kind.as_array().map_or(std::slice::from_ref(kind), Vec::as_slice);
    let has = |name: &str| kinds.iter().any(|kind| kind == name);
    if has("array") {
        return ["list of values", "lists of values"];
    }
    match (has("string"), has("number"), has("integer"), has("boolean")) {
        (true, true, ..) => ["text or number", "texts or numbers"],
        (true, ..) => ["text", "texts"],
        (_, true, ..) => ["number", "numbers"],
        (_, _, true, _) => ["whole number", "whole numbers"],
        (.., true) => ["`true` or `false`"; 2],
        _ => ["anything"; 2],
    }
}

fn or(words: &[String]) -> String {
    match words {
        [all @ .., one, other] => {
            let all: String = all.iter().map(|word| format!("{word}, ")).collect();
            format!("{all}{one} or {other}")
        }
        _ => words.concat(),
    }
}

/// A default as it is written in a sweep file; `None` for nothing and for whole sections.
fn yaml(value: &Value) -> Option<String> {
    match value {
        Value::Null | Value::Object(_) => None,
        Value::String(text) => Some(text.clone()),
        Value::Number(number) => {
            let text = number.to_string();
            Some(text.strip_suffix(".0").unwrap_or(&text).to_string())
        }
        Value::Bool(yes) => Some(yes.to_string()),
        Value::Array(values) => {
            let values: Vec<String> = values.iter().filter_map(yaml).collect();
            Some(format!("[{}]", values.join(", ")))
        }
    }
}

/// A description of the source for readers of a page: without links into the source, and without
/// saying that a section is one.
fn about(text: &str) -> String {
    let mut rest = text;
    let mut headless = false;
    if let Some(section) = text.strip_prefix("The `")
        && let Some((_, after)) = section.split_once("` section")
        && after.starts_with([':', '.'])
    {
        headless = true;
        rest = after[1..].trim_start();
    }
    let mut plain = String::new();
    while let Some((before, after)) = rest.split_once("[`") {
        let Some((name, after)) = after.split_once("`]") else { break };
        plain += &format!("{before}`{name}`");
        let link = after.strip_prefix('(').and_then(|link| link.split_once(')'));
        rest = link.map_or(after, |(_, after)| after);
    }
    plain += rest;
    let paragraphs: Vec<String> =
        plain.split("\n\n").map(|lines| lines.replace('\n', " ")).collect();
    let text = paragraphs.join("\n\n");
    let mut chars = text.chars();
    match chars.next() {
        Some(first) if headless => first.to_uppercase().chain(chars).collect(),
        _ => text,
    }
}

// The keys of a section in the order in which they are declared.

/// A step from the whole file to a part of it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Step {
    /// A key of a section.
    Key(String),
    /// An entry of a list.
    Entry,
    /// A free key.
    AnyKey,
}

/// A key that no section has.
const UNKNOWN: &str = "?";

/// The valid keys at a place, as listed by the error of an unknown key. Empty if any key is valid.
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
fn with_unknown_key(path: &[Step], depth: usize) -> Yaml {
    let mapping = |key: &str, value| Yaml::Mapping(Mapping::from_iter([(key.into(), value)]));
    let end = mapping(UNKNOWN, Yaml::Null);
    (0..depth).rev().fold(end, |below, at| match &path[at] {
        Step::Key(key) => mapping(key, below),
        Step::Entry => Yaml::Sequence(vec![below]),
        Step::AnyKey => {
            let known = keys_at(&path[..at]);
            mapping(known.first().map_or(UNKNOWN, String::as_str), below)
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn types_are_told_in_words() {
        let schema = json!({"$defs": {"Kind": {"oneOf": [
            {"const": "a", "description": "The first."}, {"enum": ["b", "c"]},
        ]}}});
        let told = |schema: Value| Node::of_file(&schema).in_words();
        assert_eq!(told(json!({"type": ["integer", "null"]})), "whole number");
        let list =
            json!({"type": "array", "items": {"type": "array", "items": {"type": "number"}}});
        assert_eq!(told(list), "list of lists of numbers");
        let mut choice = schema.clone();
        choice["anyOf"] = json!([{"$ref": "#/$defs/Kind"}, {"type": "null"}]);
        assert_eq!(told(choice), "`a`, `b` or `c`");
        let mut ways = schema;
        ways["anyOf"] =
            json!([{"$ref": "#/$defs/Kind"}, {"type": "array", "items": {"type": "string"}}]);
        assert_eq!(told(ways), "`a`, `b` or `c` or list of texts");
        let tagged = json!({"$defs": {"Sizes": {"properties": {"width": {"type": "integer"}}}}, "oneOf": [
            {"properties": {"kind": {"const": "a"}}, "$ref": "#/$defs/Sizes"},
            {"properties": {"kind": {"const": "b"}}},
        ]});
        assert_eq!(told(tagged), "section with `kind: a` or section with `kind: b`");
        let names = json!({"type": "object", "additionalProperties": {"type": "boolean"}});
        assert_eq!(told(names), "`true` or `false` for each name");
    }

    #[test]
    fn descriptions_lose_their_links_and_what_a_heading_says() {
        assert_eq!(about("The `fit` section."), "");
        assert_eq!(about("The `fit` section: what is\nfitted."), "What is fitted.");
        assert_eq!(about("See [`Sweep`](crate::sweep::Sweep), [`X`]."), "See `Sweep`, `X`.");
    }

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
