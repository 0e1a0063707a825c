//! Every number of a sweep file at the bounds of its range and beyond them: planned, and trained at the low ones.

#[path = "ranges/trained.rs"]
mod trained;

use std::collections::BTreeMap;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use isoflop::data::{self, DataFacts};
use isoflop::plan::{Plan, demand, evaluator_peak_bytes, text_peak_bytes, tokenizer_peak_bytes};
use isoflop::sweep::{self, Sweep};
use rayon::prelude::*;
use serde_json::{Value, json};

/// Sections that between them read every key: each is laid over [`BASE`].
const KINDS: [&str; 8] = [
    "{}",
    "{generator: masked, tokenizer: {kind: patch, quantizer: {kind: residual}}}",
    "{generator: scalewise, tokenizer: {kind: patch, window: 256, quantizer: {kind: multiscale}}}",
    "{tokenizer: {kind: transformer, language: {}}, evaluator: {kind: matching}}",
    "{tokenizer: {kind: patch, loss: features, mirror: true}, evaluator: {}, scores: {}}",
    "{tokenizer: {kind: vq}, train: {schedule: {kind: cosine}}, flops: {rule: exact}}",
    "{train: {schedule: {share: true}}, tokenizer: {kind: patch, schedule: step}}",
    "{data: {source: none}, trainer: 't {spec} {out}'}",
];

const BASE: &str = "{name: t, data: {clips: 8, val_clips: 2, test_clips: 2}, grid: {models: \
                    [{n_layer: 1, n_head: 1, d_model: 16}], vocab: [64], budgets: [1e9]}, train: {min_steps: 1}}";

/// A step to a number: a key, with the keys that its section must have, or the entry of a list.
#[derive(Clone, Debug)]
enum Step {
    Key(String, Value),
    Entry,
}

/// A number that may stand in a sweep file.
#[derive(Clone, Debug)]
struct Number {
    path: Vec<Step>,
    bounds: [f64; 2],
    is_whole: bool,
}

/// What must stand in a section, each the least that may.
fn least(whole: &Value, schema: &Value) -> Value {
    if let Some(name) = schema["$ref"].as_str() {
        return least(whole, &whole["$defs"][name.trim_start_matches("#/$defs/")]);
    }
    if let Some(ways) = schema["anyOf"].as_array() {
        return least(whole, &ways[0]);
    }
    match schema["type"].as_str() {
        Some("object") => {
            let required = schema["required"].as_array().into_iter().flatten();
            let of_key = |key: &Value| {
                let key = key.as_str()?;
                Some((key.to_string(), least(whole, &schema["properties"][key])))
            };
            required.filter_map(of_key).collect::<serde_json::Map<_, _>>().into()
        }
        Some("array") => json!([least(whole, &schema["items"])]),
        Some("integer" | "number") => schema["minimum"].clone(),
        _ => json!("t {spec} {out}"),
    }
}

/// All numbers of a schema.
fn numbers(whole: &Value, schema: &Value, path: &[Step], found: &mut Vec<Number>) {
    if let Some(name) = schema["$ref"].as_str() {
        return numbers(whole, &whole["$defs"][name.trim_start_matches("#/$defs/")], path, found);
    }
    for way in ["anyOf", "oneOf"].iter().filter_map(|key| schema[key].as_array()).flatten() {
        numbers(whole, way, path, found);
    }
    for (key, of_key) in schema["properties"].as_object().into_iter().flatten() {
        let step = Step::Key(key.clone(), least(whole, schema));
        numbers(whole, of_key, &[path, &[step]].concat(), found);
    }
    if schema["items"].is_object() {
        numbers(whole, &schema["items"], &[path, &[Step::Entry]].concat(), found);
    }
    let kind = &schema["type"];
    let kinds = kind.as_array().map_or(std::slice::from_ref(kind), Vec::as_slice);
    let is = |name: &str| kinds.iter().any(|kind| kind == name);
    if (is("integer") || is("number")) && !is("string") {
        let bound = |key: &str| {
            let bound = schema[key].as_f64();
            bound.unwrap_or_else(|| panic!("a number without a {key}: {path:?}"))
        };
        let bounds = ["minimum", "maximum"].map(bound);
        found.push(Number { path: path.to_vec(), bounds, is_whole: is("integer") });
    }
}

fn put(at: &mut Value, path: &[Step], number: &Value) {
    match path.split_first() {
        None => *at = number.clone(),
        Some((Step::Entry, rest)) => {
            if at.get(0).is_none() {
                *at = json!([null]);
            }
            put(&mut at[0], rest, number);
        }
        Some((Step::Key(key, beside), rest)) => {
            if !at.is_object() {
                *at = beside.clone();
            }
            put(&mut at[key], rest, number);
        }
    }
}

/// A file with sections laid over it, key by key.
fn laid(below: &mut Value, own: Value) {
    match (below, own) {
        (Value::Object(below), Value::Object(own)) => {
            for (key, value) in own {
                laid(below.entry(key).or_insert(Value::Null), value);
            }
        }
        (below, own) => *below = own,
    }
}

fn yaml(text: &str) -> Value {
    serde_yaml::from_str(text).expect("YAML")
}

/// Facts of the data that were opened, by the section and what is asked of it: most numbers change neither.
static FACTS: Mutex<BTreeMap<String, DataFacts>> = Mutex::new(BTreeMap::new());

/// The plan of a sweep.
fn planned(sweep: &Sweep) -> Plan {
    let demand = demand(sweep);
    let asked = format!("{:?} {demand:?}", sweep.data);
    let known = FACTS.lock().expect("no other test failed").get(&asked).cloned();
    let facts = known.unwrap_or_else(|| match data::open(&sweep.data, demand.as_ref()) {
        Ok(source) => DataFacts::of(&*source),
        Err(error) => DataFacts::absent(error.to_string()),
    });
    FACTS.lock().expect("no other test failed").insert(asked, facts.clone());
    Plan::new(sweep, facts)
}

/// Everything that `isoflop plan` makes of a sweep, counted.
fn plan(sweep: &Sweep) -> usize {
    let plan = planned(sweep);
    let tokenizers = plan.tokenizers.iter().map(|job| tokenizer_peak_bytes(&job.spec, &plan.data));
    let evaluator = plan.evaluator.iter().map(|job| evaluator_peak_bytes(&job.spec, &plan.data));
    let bytes = tokenizers
        .chain(evaluator)
        .chain([text_peak_bytes(&sweep.text, &plan.data), plan.disk_bytes()]);
    let bytes = bytes.fold(0, u64::saturating_add);
    plan.warnings().len() + plan.runs.len() + usize::from(bytes > 0)
}

/// What becomes of a file of this text: a plan, or the sentences about it.
fn outcome(text: &str) -> Result<usize, String> {
    sweep::parse("t.yaml", text, &[])
        .map(|sweep| plan(&sweep))
        .map_err(|errors| errors.render(false))
}

impl Number {
    /// Its keys, as a path.
    fn name(&self) -> String {
        let keys = self.path.iter().filter_map(|step| match step {
            Step::Key(key, _) => Some(key.as_str()),
            Step::Entry => None,
        });
        keys.collect::<Vec<_>>().join(".")
    }

    fn written(&self, value: f64) -> String {
        if self.is_whole && value < 1e19 { format!("{value:.0}") } else { format!("{value:e}") }
    }

    /// The file of these layers, with the number set.
    fn file(&self, layers: &[&str], value: f64) -> String {
        let mut file = yaml(BASE);
        layers.iter().for_each(|layer| laid(&mut file, yaml(layer)));
        put(&mut file, &self.path, &json!("NUMBER"));
        file.to_string().replace("\"NUMBER\"", &self.written(value))
    }
}

fn all_numbers() -> Vec<Number> {
    let (schema, mut all) = (sweep::schema(), Vec::new());
    numbers(&schema, &schema, &[], &mut all);
    assert!(all.len() > 100, "{}", all.len());
    all
}

#[test]
fn every_number_plans_within_its_range_and_is_told_beyond_it() {
    let (all, planned) = (all_numbers(), AtomicUsize::new(0));
    all.par_iter().for_each(|number| {
        let (name, [low, high]) = (number.name(), number.bounds);
        let next = if number.is_whole { 1.0 } else { low.abs() * 1e-3 + 1e-15 };
        let inside = [low, 1f64.clamp(low, high), high];
        let beyond = [low - next, high + next.max(high.abs() * 1e-9)];
        for kind in KINDS {
            for value in inside {
                match outcome(&number.file(&[kind], value)) {
                    Ok(_) => planned.fetch_add(1, Ordering::Relaxed),
                    Err(told) => {
                        assert!(!told.contains("out of range"), "{name} = {value}: {told}");
                        0
                    }
                };
            }
            for value in beyond {
                let told = outcome(&number.file(&[kind], value)).err();
                let told = told.unwrap_or_else(|| panic!("{name} = {value} is planned"));
                let said = told.contains("is out of range: ") || told.contains("expected a ");
                assert!(said && told.contains("t.yaml:1:"), "{name} = {value}: {told}");
            }
        }
    });
    assert!(planned.into_inner() > 3 * all.len(), "most numbers plan with some kind");
}
