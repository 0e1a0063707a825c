//! Runs that a user's program trains: results, failures, stops, and no process left.

use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::time::Duration;

use isoflop::record::Measured;
use nix::sys::signal::Signal;
use serde_json::Value;

use super::support::processes::{end_within, kill_9, signal, wait_for, workers};
use super::support::{OWN, Place, records, worked_trainer};
use super::victim::PATIENCE;

/// The folder of the only run.
fn run_folder(place: &Place) -> String {
    let runs = place.names("results/own/runs");
    assert_eq!(runs.len(), 1, "{runs:?}");
    format!("results/own/runs/{}", runs[0])
}

/// Processes with this word on their command line.
fn processes_with(word: &str) -> Vec<PathBuf> {
    let entries = std::fs::read_dir("/proc").expect("a Linux system").flatten();
    let says = |place: &PathBuf| {
        let line = std::fs::read(place.join("cmdline")).unwrap_or_default();
        line.split(|byte| *byte == 0).any(|one| one == word.as_bytes())
    };
    entries.map(|entry| entry.path()).filter(says).collect()
}

fn assert_gone(word: &str) {
    let gone = wait_for(Duration::from_secs(20), || processes_with(word).is_empty().then_some(()));
    assert!(gone.is_some(), "still there: {:?}", processes_with(word));
}

fn is_custom(measured: &Measured) -> bool {
    measured.device.as_deref() == Some("custom") && measured.unique_tokens == Some(0)
}

#[test]
fn the_worked_example_finds_the_law_that_it_was_trained_by() {
    let Some(place) = worked_trainer() else { return };
    place.isoflop(&["run", "experiments/custom-trainer.yaml", "--jobs", "4"]).exits(0);
    let results = place.path("results/custom-trainer");
    let kept = records::timeless(&results);
    assert!(kept.len() > 100, "{} runs", kept.len());
    assert!(kept.values().all(|record| is_custom(&record.measured)));
    assert_eq!(records::column(&results, "device").len(), kept.len());
    assert!(!results.join("tokenizers").exists());

    let number = |value: &Value| value.as_f64().unwrap_or_else(|| panic!("{value}"));
    let laws = place.json("results/custom-trainer/laws.json");
    for (name, truth) in [("params_nonvocab", 6.0 / 11.0), ("params_vocab", 6.0 / 11.0)] {
        let found = number(&laws["power_laws"][name]["exponent"]);
        assert!((found - truth).abs() < 0.06, "{name}: {found} and not {truth}");
    }
    let fit = ["fit", "results/custom-trainer", "--law", "approach3-vocab", "--json"];
    let found = place.isoflop(&fit).exits(0).json()["parametric"].clone();
    for (name, truth) in [("alpha1", 0.35), ("alpha2", 0.35), ("beta", 0.42), ("E", 6.0)] {
        let value = number(&found[name]);
        assert!((value / truth - 1.0).abs() < 0.05, "{name}: {value} and not {truth}");
    }
}

#[test]
fn a_result_becomes_the_record_with_the_plans_values_where_it_is_silent() {
    let script = r#"echo '{"loss_nats": 3.5, "loss_normalised": -0.5, "wall_s": 2}' > "$2""#;
    let place = Place::trained_by(script);
    place.isoflop(&["run", "own.yaml"]).exits(0);
    let folder = run_folder(&place);
    let (record, spec) = (
        place.json(&format!("{folder}/record.json")),
        place.json(&format!("{folder}/trainer.json")),
    );
    let (planned, measured, metrics) =
        (&record["planned"], &record["measured"], &record["metrics"]);
    assert_eq!(metrics["loss_normalised"], -0.5);
    assert_eq!(metrics["nats_per_second"], 3.5 / 4.0 * 20.0);
    assert_eq!(measured["device"], "custom");
    assert_eq!(measured["wall_s"], 2.0);
    assert_eq!(measured["tokens"], spec["tokens"]);
    for name in ["steps", "batch_tokens", "n_vocab", "seed", "budget_flops"] {
        assert_eq!(planned[name], spec[name], "{name}");
    }
    assert_eq!(planned["lr"], spec["lr"]["peak"]);
    assert_eq!(planned["generator"], "autoregressive");
    assert!(planned["quantizer"].is_null() && planned["tokenizer_kind"].is_null());
    assert!(spec["codes"].is_null() && spec["out"].as_str().unwrap().starts_with('/'));
    assert!(!place.path(&format!("{folder}/checkpoint")).exists());

    place.isoflop(&["run", "own.yaml"]).exits(0).says("nothing to train");
    let edit = ["--set", "trainer.revision=2"];
    place.isoflop(&[&["run", "own.yaml"], &edit[..]].concat()).exits(0).says("1 jobs to do");
    let plan = place.isoflop(&["plan", "own.yaml", "--set", "trainer.revision=3", "--json"]);
    let stale = &plan.exits(0).json()["stale"];
    assert!(stale.to_string().contains("trainer.revision"), "{stale}");
}

#[test]
fn each_way_to_fail_is_named_with_the_last_lines_of_the_output() {
    let good = r#"echo '{"loss_nats": 1, "loss_normalised": 1}' > "$2""#;
    for (script, words) in [
        ("echo half way; echo no memory >&2; exit 3".to_string(), "exit status: 3"),
        ("echo half way; kill -SEGV $$".to_string(), "signal: 11"),
        ("echo half way".to_string(), "left no result"),
        (format!("echo half way; {good}; echo , >> \"$2\""), "trailing characters"),
        ("echo half way; echo '{\"loss_nats\": NaN}' > \"$2\"".to_string(), "diverge"),
    ] {
        let place = Place::trained_by(&script);
        place.isoflop(&["run", "own.yaml"]).exits(1).says(words);
        let folder = run_folder(&place);
        let failure = place.json(&format!("{folder}/failure.json"));
        assert!(failure["reason"].as_str().unwrap().contains(words), "{failure}");
        assert!(failure["last_lines"].to_string().contains("half way"), "{failure}");
        assert!(!place.path(&format!("{folder}/record.json")).exists());
        place.isoflop(&["run", "own.yaml"]).exits(1).says("nothing to train");
        place.write("train.sh", good);
        place.isoflop(&["run", "own.yaml", "--retry-failed"]).exits(0);
    }
    let place = Place::new();
    place.write("own.yaml", OWN.replace("sh train.sh", "no-such-program"));
    place.isoflop(&["run", "own.yaml"]).exits(1).says("`no-such-program` cannot be started");
}

/// Sleeps in a child of its own session, as torchrun's workers do, and ends well the second time.
fn sleeper(seconds: &str) -> String {
    format!(
        r#"if [ -e "$3/begun" ]; then
  echo '{{"loss_nats": 2, "loss_normalised": 1}}' > "$2"; exit 0
fi
trap '' TERM HUP
setsid sleep {seconds} &
sleep {seconds} &
touch "$3/begun"
wait; wait; sleep {seconds}
"#
    )
}

#[test]
fn no_process_outlives_a_kill_or_a_stop_and_the_checkpoint_does() {
    // Durations that nobody else sleeps for.
    for (round, how) in ["kill -9 of all", "kill -9 of the scheduler", "stop"].iter().enumerate() {
        let seconds = format!("7{}.{round}5", std::process::id());
        let place = Place::trained_by(&sleeper(&seconds));
        let out = place.path("results");
        let start = || {
            let mut command = place.program(&["run", "own.yaml", "--out"]);
            command.arg(&out).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
            command.spawn().expect("the binary can be started")
        };
        let mut scheduler = start();
        let up = || (processes_with(&seconds).len() >= 2).then_some(());
        wait_for(PATIENCE, up).expect("the program starts its children");
        wait_for(PATIENCE, || {
            place.path(&format!("{}/checkpoint/begun", run_folder(&place))).exists().then_some(())
        })
        .expect("a checkpoint");
        match round {
            2 => signal(&scheduler, Signal::SIGTERM),
            _ => scheduler.kill().expect("a child of this process"),
        }
        if round == 0 {
            workers(&out.join("own")).into_iter().for_each(kill_9);
        }
        let status = end_within(PATIENCE, &mut scheduler);
        assert_eq!(status.code(), (round == 2).then_some(130), "{how}");
        // Started at once, so that it has to wait for what is left of the last program.
        assert_eq!(end_within(PATIENCE, &mut start()).code(), Some(0), "{how}");
        assert_gone(&seconds);
        assert_eq!(records::timeless(&out.join("own")).len(), 1);
        assert!(workers(&out.join("own")).is_empty());
    }
}

#[test]
fn codes_and_text_are_there_where_the_sweep_has_data() {
    let check = r#"for key in codes text tokenizer; do
  path=$(sed -n "s/^  \"$key\": \"\(.*\)\",*$/\1/p" "$1"); [ -e "$path" ] || { echo no $key; exit 1; }
done
echo '{"loss_nats": 1, "loss_normalised": 1}' > "$2""#;
    let place = Place::with("mini.yaml");
    place.write("train.sh", check);
    let trainer = "trainer={command: 'sh train.sh {spec} {out}'}";
    place.isoflop(&["run", "mini.yaml", "--set", trainer]).exits(0);
    let kept = records::timeless(&place.path("results/mini"));
    assert_eq!(kept.len(), 8);
    assert!(kept.values().all(|record| record.measured.epochs > Some(0.0)));
}

#[test]
fn the_time_that_a_program_takes_is_unknown_until_a_run_of_it_is_done() {
    let place = Place::trained_by(
        r#"echo '{"loss_nats": 1, "loss_normalised": 1, "wall_s": 7200}' > "$2""#,
    );
    let plan = |more: &[&str]| place.isoflop(&[&["plan", "own.yaml"], more].concat()).exits(0);
    assert_eq!(plan(&["--json"]).json()["hours"], Value::Null);
    let said = plan(&[]).stdout();
    assert!(said.contains("time unknown before the trainer's first"), "{said}");
    let of_the_built_in = ["of memory", "on disk", "side by side"];
    assert!(of_the_built_in.iter().all(|words| !said.contains(words)), "{said}");
    assert_eq!(plan(&["--json"]).json()["runs"][0]["peak_bytes"], Value::Null);
    plan(&["--gpu", "h100"]).says("as engine.mfu, as in").does_not_say("do not fit");
    place.isoflop(&["run", "own.yaml"]).exits(0);
    let more = ["--set", "grid.budgets=[1e9, 3e9]", "--jobs", "1", "--json"];
    let hours = plan(&more).json()["hours"].as_f64().expect("a time");
    assert!((hours - 6.0).abs() < 0.1, "{hours}");
}

#[test]
fn a_trainer_without_tokenizers_has_the_vocabularies_as_they_are_written() {
    let place = Place::trained_by("exit 3");
    let sizes = [256, 1024, 2048, 4096, 32_000, 50_257];
    let vocab = format!("grid.vocab={sizes:?}");
    let plan = ["plan", "own.yaml", "--set", &vocab, "--set", "grid.budgets=[1e11]"];
    let document = place.isoflop(&[&plan[..], &["--json"]].concat()).exits(0).json();
    let runs = document["runs"].as_array().unwrap();
    assert_eq!(runs.iter().map(|run| run["n_vocab"].clone()).collect::<Vec<_>>(), sizes);
    assert_eq!(document["vocabularies"], serde_json::json!([]));
    assert!(!place.isoflop(&plan).exits(0).stdout().contains("FSQ"));
}

#[test]
fn a_trainer_that_says_too_much_fills_no_disk() {
    let place = Place::trained_by(
        r#"echo begun; yes "a long line of nothing" | head -c 30000000
yes "and of errors" | head -c 30000000 >&2; printf 'no end of line'; echo ; echo over
echo '{"loss_nats": 1, "loss_normalised": 1}' > "$2""#,
    );
    place.isoflop(&["run", "own.yaml"]).exits(0);
    let log = place.read(&format!("{}/log.txt", run_folder(&place)));
    assert!(log.len() <= 16 << 20, "{} bytes", log.len());
    let log = String::from_utf8(log).expect("UTF-8");
    assert!(log.starts_with("begun\n") && log.contains("over\n"));
    let left_out = log.split("[isoflop left out ").nth(1).expect("it says so");
    let bytes: usize = left_out.split(' ').next().unwrap().parse().unwrap();
    let all = bytes + log.len();
    // Uncounted is only what the trainer writes at the moment of a cut; a busy machine makes that moment long.
    assert!((50_000_000..60_001_000).contains(&all), "{all} bytes");
}

#[test]
fn a_trainer_that_takes_its_checkpoints_away_is_done() {
    let script = r#"rm -r "$3"; echo '{"loss_nats": 1, "loss_normalised": 1}' > "$2""#;
    let place = Place::trained_by(script);
    place.isoflop(&["run", "own.yaml"]).exits(0).does_not_say("warning: the run is done");
    let folder = run_folder(&place);
    assert!(!place.path(&format!("{folder}/failure.json")).exists());
    place.isoflop(&["run", "own.yaml"]).exits(0).says("nothing to train");
}

#[test]
fn commands_that_cannot_work_are_shown_where_they_stand() {
    for (command, words) in [
        ("''", "an empty command trains nothing"),
        ("sh {spec} {ouf}", "unknown placeholder `{ouf}`"),
        ("sh {spec} {ouf}", "did you mean `out`?"),
        ("sh {spec}", "`{out}` is missing"),
        ("sh \\\" {spec} {out}", "a quote is not closed"),
    ] {
        let place = Place::new();
        place.write("own.yaml", OWN.replace("sh train.sh {spec} {out} {checkpoint}", command));
        let ended = place.isoflop(&["run", "own.yaml"]).exits(2).says(words);
        ended.says("own.yaml:3:20").says("^^^^");
    }
    let place = Place::new();
    let lines = OWN.lines().filter(|line| !line.starts_with("trainer"));
    place.write("own.yaml", lines.collect::<Vec<_>>().join("\n"));
    place.isoflop(&["plan", "own.yaml"]).exits(2).says("name a `trainer`");
}

#[test]
fn without_a_trainer_ids_are_what_they_always_were() {
    let place = Place::with("lawful.yaml");
    let plan = place.isoflop(&["plan", "lawful.yaml", "--json"]).exits(0).json();
    let runs = plan["runs"].as_array().unwrap();
    assert_eq!(runs[0]["run_id"], "4a64e517ce74754e");
    assert_eq!(runs[71]["run_id"], "e710ce994508b5d9");
}

/// Six runs of one trainer.
const SEVERAL: [&str; 4] =
    ["--set", "grid.vocab=[16, 64, 256]", "--set", "grid.budgets=[1e9, 2e9]"];

#[test]
fn a_broken_trainer_is_stopped_after_one_run() {
    let place = Place::trained_by("echo half way; exit 3");
    let run = [&["run", "own.yaml", "--jobs", "2"], &SEVERAL[..]].concat();
    let ended = place.isoflop(&run).exits(1);
    let said = ended.stderr();
    let failures = said.lines().filter(|line| line.contains("failed [trainer]")).count();
    assert_eq!(failures, 1, "{said}");
    assert!(said.contains("and 4 more were not started: the run that tries the trainer"), "{said}");
    assert!(said.contains("6 of 6 runs have no result (1 failed, 5 not started)"), "{said}");
    for of_results in ["laws", "figure", "vocab_vs_nonvocab", "is left out"] {
        assert!(!said.contains(of_results), "{of_results}: {said}");
    }
    assert!(ended.stdout().contains("no run is done yet"), "{}", ended.stdout());
    let status = place.isoflop(&["status", "results/own", "--json"]).exits(0).json();
    let counts = ["failed", "missing", "blocked"].map(|state| status["runs"][state].clone());
    assert_eq!(counts, [1, 5, 5]);
    let status = place.isoflop(&["status", "results/own"]).exits(0).stdout();
    assert!(status.contains("5 runs not started"), "{status}");
    let tried = |place: &Place| {
        let runs = place.names("results/own/runs");
        let has = |id: &&String| place.path(&format!("results/own/runs/{id}/log.txt")).exists();
        runs.iter().filter(has).count()
    };
    assert_eq!(tried(&place), 1);
    // Mended, the canary goes first again, then the others.
    place.write("train.sh", r#"echo '{"loss_nats": 1, "unigram_nats": 3}' > "$2""#);
    place.isoflop(&[&run[..], &["--retry-failed"]].concat()).exits(0);
    assert_eq!(tried(&place), 6);
    let place = Place::trained_by("exit 3");
    place.isoflop(&[&run[..], &["--set", "trainer.canary=false"]].concat()).exits(1);
    assert_eq!(tried(&place), 6);
}

#[test]
fn a_file_of_the_trainer_that_changes_trains_its_runs_again() {
    let script = r#"echo '{"loss_nats": 1, "loss_normalised": -1, "params_vocab": 640}' > "$2""#;
    let place = Place::trained_by(script);
    let run = ["run", "own.yaml", "--set", "trainer.inputs=[train.sh]"];
    place.isoflop(&run).exits(0);
    assert_eq!(records::column(&place.path("results/own"), "params_vocab"), ["640"]);
    place.isoflop(&run).exits(0).says("nothing to train");
    place.write("train.sh", format!("# Another.\n{script}"));
    place.isoflop(&run).exits(0).says("1 jobs to do");
    let gone = ["run", "own.yaml", "--set", "trainer.inputs=[no-such.py]"];
    place.isoflop(&gone).exits(2).says("no-such.py, which trainer.inputs names");
}

#[test]
fn runs_side_by_side_see_gpus_of_their_own() {
    let script = r#"sleep 0.5; echo "gpus $CUDA_VISIBLE_DEVICES"; echo '{"loss_nats": 1, "loss_normalised": 0}' > "$2""#;
    let place = Place::trained_by(script);
    let gpus = ["--jobs", "2", "--set", "trainer.gpus=4"];
    place.isoflop(&[&["run", "own.yaml"], &SEVERAL[..], &gpus[..]].concat()).exits(0);
    let runs = place.names("results/own/runs");
    let log = |id: &String| place.read(&format!("results/own/runs/{id}/log.txt"));
    let logs: Vec<String> = runs.iter().map(|id| String::from_utf8(log(id)).unwrap()).collect();
    let seen = |list: &str| logs.iter().filter(|log| log.contains(list)).count();
    let (first, second) = (seen("gpus 0,1"), seen("gpus 2,3"));
    assert!(first + second == 6 && first >= 2 && second >= 2, "{first} {second}: {logs:?}");
}

/// One run on codes of 16 test clips.
fn with_codes(script: &str) -> Place {
    let place = Place::trained_by(script);
    let codes = "data: {source: procedural, clips: 16, val_clips: 4, test_clips: 16}\n\
                 text: {dim: 16, max_tokens: 12}\n\
                 tokenizer: {width: 8, depth: 1, steps: 20, batch: 8}";
    place.write("own.yaml", OWN.replace("data: {source: none}", codes));
    place
}

#[test]
fn what_a_trainer_says_beside_its_losses_is_used() {
    if Command::new("python3").arg("--version").output().is_err() {
        eprintln!("skipped: python3 is not installed");
        return;
    }
    let place = with_codes(
        r#"python3 - "$1" "$2" <<'END'
import json, sys
spec = json.load(open(sys.argv[1]))
assert spec["version"] == 2 and spec["generator"]["kind"] == "autoregressive", spec
assert spec["grid"]["end_token"] and spec["precision"] == "f32" and spec["clips"] is None, spec
clips = [{"nats": 4.0 + i, "unigram_nats": 5.0, "targets": 2} for i in range(16)]
line = {"step": 1, "tokens": 64, "lr": 0.1, "train_loss_nats": 2.0, "val_loss_normalised": -0.5}
result = {"loss_nats": 3, "loss_normalised": -1, "clips": clips, "log": [line], "device": "abacus"}
json.dump(result, open(sys.argv[2], "w"))
END"#,
    );
    place.isoflop(&["run", "own.yaml"]).exits(0);
    let folder = run_folder(&place);
    let record = place.json(&format!("{folder}/record.json"));
    assert_eq!(record["measured"]["device"], "abacus");
    let blocks = record["metrics"].as_object().expect("by name").keys();
    assert_eq!(blocks.filter(|name| name.contains("block")).count(), 16);
    let lines =
        |name: &str| place.read(&format!("{folder}/{name}")).split(|b| *b == b'\n').count() - 1;
    assert_eq!((lines("test.jsonl"), lines("log.jsonl")), (16, 1));
}

#[test]
fn what_a_trainer_says_is_checked_against_its_codes_and_its_model() {
    let result =
        |more: &str| format!(r#"echo '{{"loss_nats": 3, "loss_normalised": -1, {more}}}' > "$2""#);
    let cases = [
        (
            result(r#""clips": [{"nats": 1, "unigram_nats": 2, "targets": 3}]"#),
            "and the test split 16",
        ),
        (result(r#""weights": "none.safetensors""#), "the trainer's weights"),
    ];
    for (script, words) in cases {
        let place = with_codes(&script);
        place.isoflop(&["run", "own.yaml"]).exits(1).says(words);
    }
}

#[test]
fn a_trainer_may_say_why_it_has_no_result() {
    let script =
        r#"echo '{"error": "the loss is nan at step 3", "kind": "diverged"}' > "$2"; exit 1"#;
    let place = Place::trained_by(script);
    place.isoflop(&["run", "own.yaml"]).exits(1).says("the loss is nan at step 3");
    let failure = place.json(&format!("{}/failure.json", run_folder(&place)));
    assert_eq!(failure["kind"], "diverged");
}

#[test]
fn first_weights_are_written_where_a_command_asks_for_them() {
    let place = Place::trained_by(
        r#"test -s "$3" && echo '{"loss_nats": 3, "loss_normalised": -1}' > "$2""#,
    );
    let command = "trainer.command=sh train.sh {spec} {out} {init}";
    place.isoflop(&["run", "own.yaml", "--set", command]).exits(0);
    assert!(!place.path(&run_folder(&place)).join("init.safetensors").exists());
}
