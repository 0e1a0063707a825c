//! `isoflop export`: tables and TensorBoard.

use std::process::Command;

use super::support::{finished_mini, records};

/// Tags and steps of a folder of events, by TensorBoard itself.
const READ: &str = "
import sys
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator
events = EventAccumulator(sys.argv[1]).Reload()
for tag in sorted(events.Tags()['scalars']):
    print(tag, *(f'{e.step}:{e.value:.6f}' for e in events.Scalars(tag)))
";

#[test]
fn runs_are_exported_as_tables_and_for_tensorboard() {
    let place = finished_mini();
    place.isoflop(&["export", "results/mini", "--to", "csv", "--out", "csv"]).exits(0);
    assert_eq!(place.read("csv/runs.csv"), place.read("results/mini/runs.csv"));
    place.isoflop(&["export", "results/mini", "--to", "parquet"]).exits(0);
    let parquet = place.read("export/mini/runs.parquet");
    assert_eq!(parquet, place.read("results/mini/runs.parquet"));
    place.isoflop(&["export", "results/mini", "--to", "tensorboard", "--out", "tb"]).exits(0);
    let runs = place.names("tb");
    assert_eq!(runs.len(), records::bytes(&place.path("results/mini")).len());
    assert!(runs.iter().all(|run| run.starts_with("autoregressive-L")), "{runs:?}");
    let folder = place.path(&format!("tb/{}", runs[0]));
    let read = Command::new("python3").args(["-c", READ]).arg(&folder).output();
    let Some(read) = read.ok().filter(|ended| ended.status.success()) else {
        eprintln!("skipped: python3 has no tensorboard");
        return;
    };
    let said = String::from_utf8_lossy(&read.stdout).into_owned();
    let tags: Vec<&str> = said.lines().filter_map(|line| line.split(' ').next()).collect();
    let expected = [
        "test/loss_normalised",
        "train/loss_nats",
        "train/lr",
        "train/tokens",
        "val/loss_normalised",
    ];
    assert_eq!(tags, expected, "{said}");
    let id = &runs[0][runs[0].len() - 6..];
    let names = place.names("results/mini/runs");
    let run = names.iter().find(|name| name.starts_with(id)).expect("the run of the folder");
    let log = String::from_utf8(place.read(&format!("results/mini/runs/{run}/log.jsonl"))).unwrap();
    let first: serde_json::Value = serde_json::from_str(log.lines().next().unwrap()).unwrap();
    let loss = first["train_loss_nats"].as_f64().unwrap() as f32;
    assert!(said.contains(&format!("{}:{loss:.6}", first["step"])), "{said}");
}

#[test]
fn a_log_that_is_empty_cut_or_changed_is_told_and_its_whole_lines_are_exported() {
    let place = finished_mini();
    let runs = place.names("results/mini/runs");
    let log = |run: &String| format!("results/mini/runs/{run}/log.jsonl");
    let text = |run| String::from_utf8(place.read(&log(run))).expect("text");
    place.write(&log(&runs[0]), "");
    let whole = text(&runs[1]);
    place.write(&log(&runs[1]), &whole[..whole.len() - 20]);
    place.write(&log(&runs[2]), text(&runs[2]).replacen("\"step\":", "\"step\":1", 1));
    let ended = place.isoflop(&["export", "results/mini", "--to", "tensorboard"]).exits(0);
    for (run, damage) in runs.iter().zip([
        "is damaged (it is empty); lines of it that are exported: 0",
        "is damaged (1 of its 2 lines cannot be read); lines of it that are exported: 1",
        "is damaged (its bytes are not those that were written); lines of it that are exported: 2",
    ]) {
        let stderr = ended.stderr();
        assert!(stderr.contains(&format!("{} {damage}", log(run))), "{stderr}");
    }
    assert_eq!(ended.stderr().matches("is damaged").count(), 3, "{}", ended.stderr());
}
