//! What `isoflop run` leaves behind, and that running again repeats nothing.

use std::fs;

use super::support::{Place, finished_mini, records};

#[test]
fn a_finished_sweep_leaves_every_file_that_was_promised() {
    let place = finished_mini();
    let results = place.names("results/mini");
    for name in [
        "sweep.yaml",
        "plan.json",
        "runs.parquet",
        "runs.csv",
        "laws.json",
        "prediction.json",
        "tokenizers",
        "runs",
    ] {
        assert!(results.contains(&name.to_string()), "{name} is not in {results:?}");
    }
    let figures = place.names("results/mini/figures");
    for name in [
        "isoflop_parabolas",
        "loss_vs_budget",
        "loss_vs_flops",
        "loss_vs_vocab",
        "power_laws",
        "tokenizers",
        "vocab_vs_nonvocab",
    ] {
        for extension in ["svg", "png", "pdf"] {
            assert!(figures.contains(&format!("{name}.{extension}")), "{name} not in {figures:?}");
        }
    }
    let plan = place.json("results/mini/plan.json");
    let ids: Vec<&str> = plan["runs"]
        .as_array()
        .unwrap()
        .iter()
        .map(|run| run["run_id"].as_str().unwrap())
        .collect();
    assert_eq!(ids.len(), 8);
    for id in &ids {
        let names = place.names(&format!("results/mini/runs/{id}"));
        assert_eq!(
            names,
            ["log.jsonl", "log.txt", "model.safetensors", "record.json", "spec.json", "test.jsonl"]
        );
        let record = place.json(&format!("results/mini/runs/{id}/record.json"));
        assert_eq!(record["planned"]["run_id"], *id);
        let lines = |name: &str| {
            let text = place.read(&format!("results/mini/runs/{id}/{name}"));
            let text = String::from_utf8(text).unwrap();
            let line = |line| serde_json::from_str(line).expect("JSON lines");
            text.lines().map(line).collect::<Vec<serde_json::Value>>()
        };
        assert_eq!(lines("log.jsonl").len(), 2, "the sweep asks for two evaluations");
        loss_is_that_of_its_clips(&record["metrics"], &lines("test.jsonl"));
    }
    for tokenizer in place.names("results/mini/tokenizers") {
        let names = place.names(&format!("results/mini/tokenizers/{tokenizer}"));
        for name in ["metrics.json", "tokens", "weights.safetensors"] {
            assert!(names.contains(&name.to_string()), "{name} is not in {names:?}");
        }
    }
}

/// L_u is the mean over the test split's 16 clips, and each of them is a block of its own.
fn loss_is_that_of_its_clips(metrics: &serde_json::Value, clips: &[serde_json::Value]) {
    let number = |value: &serde_json::Value| value.as_f64().expect("a number");
    let sum = |name: &str| clips.iter().map(|clip| number(&clip[name])).sum::<f64>();
    let loss = (sum("nats") - sum("unigram_nats")) / sum("targets");
    assert!((loss - number(&metrics["loss_normalised"])).abs() < 1e-12);
    let own = |clip: &serde_json::Value| {
        (number(&clip["nats"]) - number(&clip["unigram_nats"])) / number(&clip["targets"])
    };
    let mut of_clips: Vec<f64> = clips.iter().map(own).collect();
    let block = |i: usize| number(&metrics[format!("loss_normalised_block_{:02}", i + 1)]);
    let mut of_blocks: Vec<f64> = (0..16).map(block).collect();
    of_clips.sort_by(f64::total_cmp);
    of_blocks.sort_by(f64::total_cmp);
    assert_eq!(of_blocks, of_clips);
    assert!(metrics.get("loss_normalised_block_17").is_none());
}

#[test]
fn the_table_has_the_promised_columns_and_a_row_a_run() {
    let place = finished_mini();
    let table = fs::read_to_string(place.path("results/mini/runs.csv")).unwrap();
    let columns: Vec<&str> = table.lines().next().unwrap().split(',').collect();
    for column in [
        "run_id",
        "seed",
        "n_layer",
        "n_head",
        "d_model",
        "d_ff",
        "n_ctx",
        "n_vocab",
        "budget_flops",
        "flops_openai",
        "flops_6nd",
        "flops_exact",
        "params_nonvocab",
        "params_vocab",
        "params_text",
        "tokens",
        "unique_tokens",
        "steps",
        "batch_tokens",
        "lr",
        "loss_nats",
        "loss_normalised",
        "nats_per_second",
        "wall_s",
        "tokens_per_s",
        "peak_bytes",
        "tokenizer_id",
        "device",
        "git_revision",
        "generator",
        "tokenizer_kind",
        "quantizer",
    ] {
        assert!(columns.contains(&column), "{column} is not in {columns:?}");
    }
    assert_eq!(table.lines().count(), 1 + 8);
    let from_parquet = isoflop::record::table::read(&place.path("results/mini")).unwrap();
    let losses: Vec<String> =
        from_parquet.iter().map(|r| r.loss_normalised().unwrap().to_string()).collect();
    assert_eq!(records::column(&place.path("results/mini"), "loss_normalised"), losses);
}

#[test]
fn a_second_run_says_there_is_nothing_to_do_and_changes_no_result() {
    let place = finished_mini();
    let results = place.path("results/mini");
    let (records, table) = (records::bytes(&results), place.read("results/mini/runs.csv"));
    let parquet = place.read("results/mini/runs.parquet");
    place.isoflop(&["run", "mini.yaml"]).exits(0).says("nothing to train");
    assert_eq!(records::bytes(&results), records);
    assert_eq!(place.read("results/mini/runs.csv"), table);
    assert_eq!(place.read("results/mini/runs.parquet"), parquet);
}

#[test]
fn one_worker_gives_the_same_bits_as_three() {
    let three = finished_mini();
    let one = Place::with("mini.yaml");
    one.isoflop(&["run", "mini.yaml", "--jobs", "1"]).exits(0);
    let [one, three] = [one, three].map(|place| records::timeless(&place.path("results/mini")));
    assert_eq!(three.len(), 8);
    assert_eq!(one, three);
}

#[test]
fn a_changed_setting_makes_new_runs_and_leaves_the_old_ones_alone() {
    let place = finished_mini();
    let before = records::bytes(&place.path("results/mini"));
    let laws = place.read("results/mini/laws.json");
    let cell = ["--set", "grid.vocab=[16]", "--set", "grid.budgets=[1e9]"];
    let change = ["--set", "train.lr.coefficient=0.01"];
    let args = [&["run", "mini.yaml"], &cell[..], &change].concat();
    let ended =
        place.isoflop(&args).exits(0).says("2 jobs to do, 0 of 2 runs finished or failed before");
    ended.says("held laws of 8 runs, of which this sweep does not have 8: they are kept in");
    assert_eq!(place.read("results/mini/earlier-1/laws.json"), laws);
    assert_eq!(place.json("results/mini/earlier-1/plan.json")["runs"].as_array().unwrap().len(), 8);
    place.isoflop(&["predict", "1e11", "--law", "results/mini/earlier-1"]).exits(0);
    let after = records::bytes(&place.path("results/mini"));
    assert_eq!(after.len(), 8 + 2);
    assert!(before.iter().all(|(id, bytes)| after.get(id) == Some(bytes)));
    let rates = records::column(&place.path("results/mini"), "lr");
    assert_eq!(rates.len(), 2, "the table holds the runs of the sweep as it is now");
    place.isoflop(&args).exits(0).does_not_say("they are kept in");
    place.isoflop(&["run", "mini.yaml"]).exits(0).says("nothing to train");
    place.isoflop(&args).exits(0).says("earlier-2");
    assert_eq!(place.read("results/mini/earlier-1/laws.json"), laws);
}

#[test]
fn another_name_for_the_folder_changes_no_id() {
    let place = Place::with("mini.yaml");
    let ids = |args: &[&str]| {
        let plan =
            place.isoflop(&[&["plan", "mini.yaml", "--json"], args].concat()).exits(0).json();
        let runs = plan["runs"].as_array().unwrap().iter();
        runs.map(|run| run["run_id"].clone()).collect::<Vec<_>>()
    };
    assert_eq!(ids(&[]), ids(&["--out", "elsewhere", "--set", "train.checkpoint_s=9"]));
}
