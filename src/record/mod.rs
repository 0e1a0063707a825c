//! Records of finished runs, and the table of all records.
//!
//! [`facts`] declares every fact once. Records and the table are derived from it: a new fact needs a line there, and a
//! value where records are made.
//!
//! # Example
//!
//! ```
//! use std::path::Path;
//!
//! use isoflop::record::table;
//!
//! let runs = table::read(Path::new("results/cmu-motion"))?;
//! let best = runs.iter().filter_map(|run| run.loss_normalised().ok()).fold(f64::INFINITY, f64::min);
//! println!("{} runs, the best L_u {best:.3} nats", runs.len());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod facts;
mod run_record;
mod scores;
mod selection;
pub mod table;

pub use facts::{Measured, Planned, block_metric};
pub use run_record::{FORMAT, Lacking, Metrics, RunRecord, flops_per_second};
pub use scores::{Quality, ScoredRun, read_scores, row_of_run, write_published, write_scores};
pub use selection::{Tuned, of_largest_share, sliced};

#[cfg(test)]
mod tests {
    use super::facts::{COLUMNS, LOSSES};
    use super::*;
    use crate::files::{FileError, read_if_there};
    use crate::laws::Metric;
    use crate::spec::FlopsRule::{Exact, OpenAi};
    use serde_json::{Map, Value, json};

    /// A record as builds of format 1 wrote it.
    const FORMAT_1: &str = include_str!("../../tests/fixtures/record-format-1.json");

    /// Facts that format 1 does not have.
    const NEW: [&str; 5] = ["generator", "tokenizer_kind", "quantizer", "varied", "share"];

    pub(super) fn of_format_1() -> RunRecord {
        serde_json::from_str(FORMAT_1).expect("the fixture reads")
    }

    /// A record that lacks nothing.
    pub(super) fn whole() -> RunRecord {
        let mut record = of_format_1();
        record.planned.generator = Some("autoregressive".to_string());
        record.planned.tokenizer_kind = Some("convolutional".to_string());
        record.planned.quantizer = Some("vq".to_string());
        record.planned.varied = Some("train.lr=0.001".to_string());
        record.planned.share = Some(0.5);
        record.metrics.set("fid", 0.25);
        record
    }

    fn flat() -> Value {
        serde_json::from_str(FORMAT_1).expect("the fixture is JSON")
    }

    fn nested() -> Value {
        serde_json::to_value(whole()).expect("plain values")
    }

    /// The objects of a record's file that hold facts.
    fn groups(file: &mut Value) -> Vec<&mut Map<String, Value>> {
        let object = file.as_object_mut().expect("an object");
        match object.contains_key("format") {
            true => object.values_mut().filter_map(Value::as_object_mut).collect(),
            false => vec![object],
        }
    }

    fn without(mut file: Value, names: &[&str]) -> Value {
        groups(&mut file).into_iter().for_each(|group| group.retain(|k, _| !names.contains(&&**k)));
        file
    }

    fn read(file: &Value) -> Result<RunRecord, FileError> {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("record.json");
        std::fs::write(&path, file.to_string()).unwrap();
        read_if_there(&path).map(|record| record.expect("it was just written"))
    }

    /// A fact or a metric of a record; null if it lacks it.
    fn cell(record: &RunRecord, name: &str) -> Value {
        let mut file = serde_json::to_value(record).expect("plain values");
        let groups = groups(&mut file);
        groups.into_iter().find_map(|group| group.get(name).cloned()).unwrap_or_default()
    }

    #[test]
    fn a_record_of_format_1_reads_equal_in_every_fact() {
        let (record, file) = (of_format_1(), flat());
        let facts = file.as_object().unwrap();
        assert_eq!(facts.len() + NEW.len(), COLUMNS.len());
        for (name, value) in facts {
            assert!(!value.is_null() && cell(&record, name) == *value, "{name} is not {value}");
        }
        assert!(NEW.iter().all(|name| cell(&record, name).is_null()));
    }

    #[test]
    fn a_record_is_written_in_the_newest_format_and_reads_back_equal() {
        for record in [whole(), of_format_1()] {
            let file = serde_json::to_value(&record).unwrap();
            assert_eq!(file["format"], FORMAT);
            assert_eq!(file["planned"]["run_id"], *record.planned.run_id);
            assert_eq!(read(&file).unwrap(), record);
        }
        assert_eq!(nested()["metrics"]["fid"], 0.25);
    }

    #[test]
    fn a_record_without_a_required_fact_is_damaged() {
        let required: Vec<&str> =
            COLUMNS.iter().filter(|column| column.is_required).map(|column| column.name).collect();
        let few =
            ["run_id", "n_vocab", "budget_flops", "params_nonvocab", "params_vocab", "tokens"];
        assert_eq!(required, few);
        for file in [flat(), nested()] {
            for name in &required {
                let error = read(&without(file.clone(), &[name])).unwrap_err();
                assert!(matches!(error, FileError::Damaged { .. }), "{name}: {error}");
                assert!(error.to_string().contains(&format!("missing field `{name}`")), "{error}");
            }
            let error = read(&without(file.clone(), LOSSES)).unwrap_err();
            assert!(error.to_string().contains("none of the losses loss_nats, "), "{error}");
        }
    }

    #[test]
    fn a_fact_that_an_older_record_lacks_is_null() {
        for (file, record) in [(flat(), of_format_1()), (nested(), whole())] {
            for column in COLUMNS.iter().filter(|column| !column.is_required) {
                let read = read(&without(file.clone(), &[column.name])).unwrap();
                assert_eq!(cell(&read, column.name), Value::Null, "{}", column.name);
                let others = COLUMNS.iter().filter(|other| other.name != column.name);
                for other in others {
                    assert_eq!(cell(&read, other.name), cell(&record, other.name));
                }
            }
        }
    }

    #[test]
    fn what_a_newer_build_adds_is_passed_over() {
        for (file, record) in [(flat(), of_format_1()), (nested(), whole())] {
            let mut newer = file.clone();
            groups(&mut newer).into_iter().for_each(|group| {
                group.insert("a_new_fact".to_string(), json!(1.5));
            });
            let mut read = read(&newer).unwrap();
            let new_metric = read.metrics.get("a_new_fact");
            assert_eq!(new_metric, file["format"].is_number().then_some(1.5));
            if new_metric.is_some() {
                read.metrics = record.metrics.clone();
            }
            assert_eq!(read, record);
        }
        let mut newer = nested();
        newer["format"] = json!(FORMAT + 1);
        newer["a_new_group"] = json!({"of": ["any", "kind"]});
        assert_eq!(read(&newer).unwrap(), whole());
    }

    #[test]
    fn a_fact_of_another_type_is_damage() {
        for (name, wrong) in [("lr", json!("fast")), ("n_vocab", Value::Null), ("steps", json!(-1))]
        {
            for mut file in [flat(), nested()] {
                groups(&mut file).into_iter().for_each(|group| {
                    group.entry(name).and_modify(|value| *value = wrong.clone());
                });
                assert!(matches!(read(&file), Err(FileError::Damaged { .. })), "{name}");
            }
        }
    }

    #[test]
    fn distinct_tokens_that_a_trainer_does_not_tell_are_unknown() {
        let mut record = whole();
        let mut of = |unique_tokens| {
            record.measured.unique_tokens = unique_tokens;
            record.point(OpenAi, &Metric::default()).unwrap().about.unique_tokens
        };
        assert_eq!([Some(7), Some(0), None].map(&mut of), [Some(7.0), None, None]);
    }

    #[test]
    fn a_point_says_which_metric_its_loss_is_and_a_record_which_it_lacks() {
        let mut record = of_format_1();
        let point = record.point(OpenAi, &Metric::default()).unwrap();
        assert_eq!((point.metric.name(), point.loss), ("loss_normalised", -0.08920798223131962));
        let point = record.point(OpenAi, &Metric::new("nats_per_frame")).unwrap();
        assert_eq!((point.metric.name(), point.loss), ("nats_per_frame", 0.10944534658960392));
        let lacking = record.point(OpenAi, &Metric::new("fid")).unwrap_err();
        assert_eq!(lacking.to_string(), "its record has no fid");
        record.measured.flops_exact = None;
        let lacking = record.point(Exact, &Metric::default()).unwrap_err();
        assert_eq!(lacking.to_string(), "its record has no flops_exact");
    }

    #[test]
    fn the_rate_of_runs_is_that_of_those_whose_time_is_known() {
        let (mut known, mut unknown) = (whole(), whole());
        (known.planned.budget_flops, known.measured.wall_s) = (6.0, Some(2.0));
        unknown.measured.wall_s = None;
        assert_eq!(flops_per_second([known, unknown.clone()]), Some(3.0));
        assert_eq!(flops_per_second([unknown]), None);
    }
}
