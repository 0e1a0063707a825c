//! `isoflop run --rounds`: a part of the grid, until the prediction is as sharp as asked.

use nix::unistd::Pid;
use serde_json::Value;

use super::support::processes::{end_within, kill_9, wait_for};
use super::support::{Place, records, worked_trainer};
use super::victim::PATIENCE;

const SWEEP: &str = "experiments/custom-trainer.yaml";
const RESULTS: &str = "results/custom-trainer";
const BUDGETS: &str = "grid.budgets=[1e10, 2e10, 5e10, 1e11, 2e11]";

fn rounds<'a>(more: &[&'a str]) -> Vec<&'a str> {
    [&["run", SWEEP, "--set", BUDGETS, "--jobs", "4"][..], more].concat()
}

fn history(place: &Place) -> Vec<Value> {
    place.json(&format!("{RESULTS}/rounds.json"))["rounds"].as_array().unwrap().clone()
}

/// The runs of each round.
fn runs(place: &Place) -> Vec<Vec<Value>> {
    history(place).iter().map(|round| round["runs"].as_array().unwrap().clone()).collect()
}

#[test]
fn rounds_end_where_the_prediction_is_as_sharp_as_asked() {
    let Some(place) = worked_trainer() else { return };
    let words = rounds(&["--rounds", "20", "--until", "0.05"]);
    place.isoflop(&words).exits(0).says("round 1: 82 runs").says("of the grid's FLOPs");
    let history = history(&place);
    let last = &history[history.len() - 1]["known"];
    let number = |value: &Value| value.as_f64().unwrap();
    let half = 0.5 * (number(&last["loss_ci95"][1]) - number(&last["loss_ci95"][0]));
    assert_eq!(last["is_tested"], true);
    assert!(half / number(&last["loss_normalised"]).abs() <= 0.05, "{last}");
    let before = &history[history.len() - 2]["known"];
    assert!(before["is_tested"] == false || number(&before["loss_ci95"][0]) < -1.0, "{before}");
    let trained = records::timeless(&place.path(RESULTS));
    assert!((82..200).contains(&trained.len()), "{} runs", trained.len());
    assert_eq!(trained.len(), runs(&place).iter().map(Vec::len).sum::<usize>());
    assert_eq!(
        place.json(&format!("{RESULTS}/plan.json"))["runs"].as_array().unwrap().len(),
        trained.len()
    );

    // Said again, and nothing is trained.
    place.isoflop(&words).exits(0).says("rounds took").does_not_say("round 1:");
    assert_eq!(records::timeless(&place.path(RESULTS)).len(), trained.len());

    // The whole grid goes on from there.
    place.isoflop(&rounds(&[])).exits(0);
    let all = records::timeless(&place.path(RESULTS));
    assert_eq!(all.len(), 208);
    assert!(trained.iter().all(|(id, record)| all[id] == *record));
}

#[test]
fn a_killed_round_goes_on_to_the_same_rounds() {
    let (Some(place), Some(whole)) = (worked_trainer(), worked_trainer()) else { return };
    let words = rounds(&["--rounds", "3"]);
    whole.isoflop(&words).exits(0);
    let mut program = place.program(&words).spawn().unwrap();
    let folder = place.path(&format!("{RESULTS}/runs"));
    let begun = || {
        let done = std::fs::read_dir(&folder).into_iter().flatten().flatten();
        (done.filter(|run| run.path().join("record.json").exists()).count() > 5).then_some(())
    };
    wait_for(PATIENCE, begun).expect("runs are trained");
    kill_9(Pid::from_raw(program.id() as i32));
    end_within(PATIENCE, &mut program);
    place.isoflop(&words).exits(0);
    assert_eq!(runs(&place), runs(&whole));
    assert_eq!(runs(&place).len(), 3);
    let ids =
        |place: &Place| records::timeless(&place.path(RESULTS)).into_keys().collect::<Vec<_>>();
    assert_eq!(ids(&place), ids(&whole));
}

#[test]
fn what_is_trained_already_is_the_first_round() {
    let Some(place) = worked_trainer() else { return };
    place.isoflop(&rounds(&["--set", "grid.vocab=[256, 512]"])).exits(0);
    place.isoflop(&rounds(&["--rounds", "2"])).exits(0).says("round 2:");
    assert_eq!(runs(&place)[0].len(), 69);
}

#[test]
fn rounds_that_cannot_be_are_refused_in_a_sentence() {
    let place = Place::with("mini.yaml");
    let run = |more: &[&str]| place.isoflop(&[&["run", "mini.yaml"][..], more].concat()).exits(2);
    run(&["--until", "0.02"]).says("--rounds");
    run(&["--rounds", "0"]).says("--rounds");
    run(&["--rounds", "3", "--until", "2"]).says("not a fraction between 0 and 1");
    run(&["--rounds", "3", "--engine", "slurm"]).says("--engine local");
    run(&["--rounds", "3", "--set", "predict.budgets=[]"]).says("predict.budgets=[1e12]");
    std::fs::create_dir_all(place.path("results/mini")).unwrap();
    place.write("results/mini/rounds.json", r#"{"rounds": [{"runs": ["r0"], "flops": 1e9}]}"#);
    run(&["--rounds", "3"]).says("1 runs that this sweep does not plan");
    assert_eq!(place.names("results/mini"), ["rounds.json"], "nothing is trained");
}
