//! From records to laws, figures, predictions and a notebook, without training anything.

use std::fs;
use std::process::Command;

use serde_json::Value;

use super::support::{Place, lawful};

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

/// A place whose laws are fitted.
fn fitted() -> Place {
    let place = lawful();
    place
        .isoflop(&["run", "lawful.yaml"])
        .exits(0)
        .says("nothing to train")
        .does_not_say("no laws");
    place
}

#[test]
fn laws_recover_what_the_losses_were_made_from() {
    let laws = fitted().json("results/lawful/laws.json");
    let law = &laws["power_laws"]["params_nonvocab"];
    assert!((number(&law["exponent"]) - 0.5).abs() < 1e-6, "{law}");
    assert!((number(&law["log10_coefficient"]) + 1.0).abs() < 1e-5, "{law}");
    assert!((number(&laws["loss"]["log"]["slope_per_decade"]) + 0.5).abs() < 1e-6, "{laws}");
    assert_eq!(laws["flops_rule"], "openai");
    for key in ["minima", "vocab_from_nonvocab", "sensitivity"] {
        assert!(!laws[key].is_null(), "{key} is missing");
    }
}

#[test]
fn a_sweep_with_laws_has_their_figures_and_predictions() {
    let place = fitted();
    let figures = place.names("results/lawful/figures");
    for name in [
        "loss_vs_flops",
        "isoflop_parabolas",
        "loss_vs_vocab",
        "vocab_vs_nonvocab",
        "loss_vs_budget",
        "power_laws",
    ] {
        for extension in ["svg", "png", "pdf"] {
            assert!(figures.contains(&format!("{name}.{extension}")), "{name} not in {figures:?}");
        }
    }
    let prediction = &place.json("results/lawful/prediction.json")[0];
    let raw = number(&prediction["raw"]["params_nonvocab"]);
    assert!((raw / (0.1 * 1e12f64.sqrt()) - 1.0).abs() < 1e-4, "{raw}");
    for key in [
        "budget_flops",
        "law",
        "params_nonvocab",
        "params_vocab",
        "n_vocab",
        "tokens",
        "loss_normalised",
        "ci95",
        "spends_flops",
        "budget_ratio",
        "extrapolation_factor",
        "shape",
        "warnings",
    ] {
        assert!(prediction.get(key).is_some(), "{key} is missing in {prediction}");
    }
}

#[test]
fn a_prediction_needs_no_more_than_the_laws() {
    let place = fitted();
    fs::create_dir(place.path("alone")).unwrap();
    fs::copy(place.path("results/lawful/laws.json"), place.path("alone/laws.json")).unwrap();
    let expected = place.json("results/lawful/prediction.json");
    for law in ["alone", "alone/laws.json", "results/lawful"] {
        let found = place.isoflop(&["predict", "1e12", "--law", law, "--json"]).exits(0).json();
        assert_eq!(found, expected, "{law}");
    }
    let two = place.isoflop(&["predict", "1e12", "1e13", "--law", "alone", "--json"]).exits(0);
    assert_eq!(two.json()[0], expected[0]);
}

#[test]
fn figures_are_drawn_again_from_table_and_laws_alone_byte_for_byte() {
    let place = fitted();
    fs::create_dir_all(place.path("copy/lawful")).unwrap();
    for name in ["runs.parquet", "laws.json"] {
        let from = place.path(&format!("results/lawful/{name}"));
        fs::copy(from, place.path(&format!("copy/lawful/{name}"))).unwrap();
    }
    let drawn = |folder: &str| -> Vec<(String, Vec<u8>)> {
        place.isoflop(&["plot", folder]).exits(0);
        let names = place.names(&format!("{folder}/figures")).into_iter();
        names.map(|n| (n.clone(), place.read(&format!("{folder}/figures/{n}")))).collect()
    };
    let by_run = place
        .names("results/lawful/figures")
        .into_iter()
        .map(|n| (n.clone(), place.read(&format!("results/lawful/figures/{n}"))))
        .collect::<Vec<_>>();
    assert_eq!(by_run.len(), 6 * 3, "six figures, each as SVG, PNG and PDF");
    assert!(drawn("results/lawful") == by_run, "`plot` draws other bytes than `run`");
    assert!(drawn("copy/lawful") == by_run, "the copy's figures differ");
}

#[test]
fn fitting_again_gives_the_same_laws_and_may_go_elsewhere() {
    let place = fitted();
    let laws = place.read("results/lawful/laws.json");
    let argmin = ["fit", "results/lawful", "--minima", "argmin", "--out", "argmin.json", "--json"];
    let mut printed = place.isoflop(&argmin).exits(0).json();
    let verdict = printed.as_object_mut().and_then(|document| document.remove("verdict"));
    assert!(verdict.is_some_and(|said| said.as_str().is_some_and(|said| said.contains("argmin"))));
    assert_eq!(printed, place.json("argmin.json"));
    assert_eq!(printed["minima_method"], "argmin");
    assert_eq!(
        place.read("results/lawful/laws.json"),
        laws,
        "--out leaves the folder's laws alone"
    );
    place.isoflop(&["fit", "results/lawful"]).exits(0);
    assert_eq!(place.read("results/lawful/laws.json"), laws);
}

#[test]
fn laws_by_another_count_of_flops_are_of_runs_at_equal_flops_by_it() {
    let place = fitted();
    let by = ["--flops", "6nd", "--hold-out", "3e10", "--save", "--json"];
    let laws = place.isoflop(&[&["fit", "results/lawful"], &by[..]].concat()).exits(0).json();
    assert_eq!(laws["flops_rule"], "6nd");
    let first = laws["warnings"][0].as_str().unwrap();
    assert!(first.contains("moved along its cell to equal FLOPs by 6nd"), "{first}");
    let minima = laws["minima"].as_array().unwrap();
    assert!(minima.len() >= 4, "{minima:#?}");
    for minimum in minima {
        let of = |key: &str| number(&minimum[key]);
        let spent = 6.0 * (of("params_nonvocab") + of("params_vocab")) * of("tokens");
        assert!((spent / of("budget_flops") - 1.0).abs() < 0.05, "{minimum:#}");
    }
    let figures = ["plot", "results/lawful", "--only", "isoflop_parabolas,power_laws"];
    place.isoflop(&figures).exits(0).does_not_say("left out");
}

#[test]
fn running_again_says_the_same_and_mends_what_was_changed_since() {
    let place = fitted();
    let files = || {
        let names = ["laws.json", "prediction.json", "runs.csv", "figures/power_laws.svg"];
        names.map(|name| place.read(&format!("results/lawful/{name}")))
    };
    let again = || {
        let ended = place.isoflop(&["run", "lawful.yaml"]).exits(0);
        (ended.stdout(), ended.stderr())
    };
    let (said, written) = (again(), files());
    assert!(said.1.contains("tokenizers is left out"), "warnings are repeated: {}", said.1);
    place.isoflop(&["fit", "results/lawful", "--minima", "argmin", "--save"]).exits(0);
    assert_ne!(files(), written, "`fit` writes other laws");
    assert_eq!((again(), files()), (said.clone(), written.clone()));
    fs::remove_file(place.path("results/lawful/prediction.json")).unwrap();
    place.write("results/lawful/runs.csv", "run_id\n");
    place.write("results/lawful/figures/power_laws.svg", "<svg/>");
    assert_eq!((again(), files()), (said, written));
}

#[test]
fn results_that_were_moved_speak_of_where_they_are() {
    let place = fitted();
    fs::rename(place.path("results"), place.path("moved")).unwrap();
    let args = ["run", "lawful.yaml", "--out", "moved", "--json"];
    let document = place.isoflop(&args).exits(0).says("nothing to train").json();
    assert_eq!(document["results"], "moved/lawful");
    assert!(document["figures"][0].as_str().unwrap().starts_with("moved/lawful/figures/"));
}

#[test]
fn laws_that_cannot_be_told_are_exit_code_3_and_no_older_ones_are_left() {
    let place = fitted();
    let one_budget = ["run", "lawful.yaml", "--set", "grid.budgets=[1e10]"];
    place.isoflop(&one_budget).exits(0).says("no laws").says("power_laws is left out");
    for name in ["laws.json", "prediction.json", "figures/power_laws.svg"] {
        assert!(!place.path(&format!("results/lawful/{name}")).exists(), "{name} is out of date");
    }
    place.isoflop(&["fit", "results/lawful"]).exits(3).says("a law in C needs two");
}

#[test]
fn a_notebook_finds_the_results_from_where_it_lies() {
    let place = fitted();
    for (out, way) in [("notebooks-export", "../results/lawful"), (".", "results/lawful")] {
        let args = ["export", "results/lawful", "--to", "notebook", "--out", out];
        place.isoflop(&args).exits(0);
        let notebook = place.json(&format!("{out}/lawful.ipynb"));
        assert_eq!(notebook["nbformat"], 4);
        let source = notebook["cells"].to_string();
        assert!(source.contains(&format!("\\\"{way}\\\"")), "{way} is not in {source}");
        assert!(place.path(out).join(way).join("runs.parquet").exists());
    }
}

#[test]
fn the_published_law_needs_no_files() {
    let place = Place::new();
    let predictions =
        place.isoflop(&["predict", "1e18", "--law", "scamo", "--json"]).exits(0).json();
    let prediction = &predictions[0];
    assert_eq!(prediction["law"], "scamo");
    assert!((number(&prediction["loss_normalised"]) + 5.277).abs() < 1e-3, "{prediction}");
    assert!((number(&prediction["spends_flops"]) / 1.66e18 - 1.0).abs() < 0.01, "{prediction}");
    assert!(!prediction["warnings"].as_array().unwrap().is_empty());
}

#[test]
fn one_figure_can_be_drawn_as_one_kind_of_file() {
    let place = fitted();
    fs::remove_dir_all(place.path("results/lawful/figures")).unwrap();
    let plot = ["plot", "results/lawful", "--only", "power_laws,loss_vs_flops", "--format", "pdf"];
    place.isoflop(&plot).exits(0);
    assert_eq!(place.names("results/lawful/figures"), ["loss_vs_flops.pdf", "power_laws.pdf"]);
    let drawn = place.read("results/lawful/figures/power_laws.pdf");
    place.isoflop(&plot).exits(0);
    assert_eq!(drawn, place.read("results/lawful/figures/power_laws.pdf"), "the same bytes");
    let slip = place.isoflop(&["plot", "results/lawful", "--only", "power_law"]);
    slip.exits(2).says("no figure is named \"power_law\"").says("vocab_vs_nonvocab");
}

#[test]
fn what_to_run_next_is_a_sweep_over_the_one_that_was_run() {
    let place = fitted();
    let fit = ["fit", "results/lawful", "--next", "next.yaml"];
    place.isoflop(&fit).exits(0).says("what to run next is next.yaml");
    let text = String::from_utf8(place.read("next.yaml")).unwrap();
    for part in
        ["isoflop run next.yaml --out results", "include: results/lawful/sweep.yaml", "also:"]
    {
        assert!(text.contains(part), "{part} is not in {text}");
    }
    let runs = |file: &str| {
        let plan = place.isoflop(&["plan", file, "--json"]).exits(0).json();
        let runs = plan["runs"].as_array().unwrap().clone();
        let done = runs.iter().filter(|run| run["state"] == "done").count();
        (runs.len(), done)
    };
    let ((before, done), (after, still)) = (runs("lawful.yaml"), runs("next.yaml"));
    assert!(after > before && done == before && still == done, "{before} {done} {after} {still}");
    let table = place.isoflop(&["fit", "results/lawful/runs.csv", "--next", "no.yaml"]);
    table.exits(2).says("--next wants a sweep's folder");
    assert!(!place.path("no.yaml").exists());
}

#[test]
fn a_law_of_repeated_data_is_asked_of_more_data() {
    let results = |name: &str| format!("{}/results/{name}", env!("CARGO_MANIFEST_DIR"));
    let place = Place::new();
    let asked = |more: &[&str]| {
        let study = results("motion-law");
        let words = [&["predict", "3.2e11", "--law", &study, "--json"], more].concat();
        place.isoflop(&words).exits(0).json()[0].clone()
    };
    let loss = |prediction: &Value| prediction["raw"]["loss_joint"].as_f64().unwrap();
    let [less, own, more] =
        [&["--unique-tokens", "4e4"][..], &[], &["--unique-tokens", "1e6"]].map(asked);
    assert!(loss(&less) > loss(&own) && loss(&own) > loss(&more), "{less} {own} {more}");
    let told = more["warnings"][0].as_str().unwrap();
    assert!(told.contains("1.000e6 distinct tokens are asked for"), "{told}");
    let shares = results("motion-shares");
    let laws = fs::read_to_string(format!("{shares}/laws.json")).unwrap();
    let mut laws: Value = serde_json::from_str(&laws).unwrap();
    laws["recommended"]["law"] = "floor".into();
    place.write("of-minima.json", laws.to_string());
    let asked = place.isoflop(&["predict", "3.2e11", "--law", "of-minima.json", "--json"]).exits(0);
    let told = asked.json()[0]["warnings"].to_string();
    assert!(told.contains("passes over the data (fit: "), "{told}");
    assert!(told.contains("the joint law, which models repeats, predicts "), "{told}");
    place.isoflop(&["predict", "3.2e11", "--law", &shares, "--unique-tokens", "1e6"]).exits(0);
    let fresh = results("procedural-law");
    let asked = ["predict", "3e12", "--law", &fresh, "--unique-tokens", "1e6"];
    place.isoflop(&asked).exits(2).says("whose runs repeat their data");
}

/// The exponents of an answer with their intervals, as a screen writes them.
fn exponents(answer: &Value) -> Vec<[String; 3]> {
    let number = |x: &Value| format!("{:.3}", x.as_f64().unwrap());
    let told = answer["exponents"].as_object().unwrap().values();
    told.filter(|own| own["value"].is_number())
        .map(|own| [&own["value"], &own["ci95"][0], &own["ci95"][1]].map(number))
        .collect()
}

/// Runs two cells of a notebook with stand-ins for what draws, and prints the titles of its charts.
const CELLS: &str = r#"
import json, math, sys
from pathlib import Path
from unittest.mock import MagicMock
RESULTS = Path(sys.argv[1])
laws = json.loads((RESULTS / "laws.json").read_text())
alt, pl, minima, log_x, log_y = (MagicMock() for _ in range(5))
cells = {cell["id"]: "".join(cell["source"]) for cell in json.loads(Path(sys.argv[2]).read_text())["cells"]}
exec(cells["power-laws"])
exec(cells["predict"])
for call in alt.layer.return_value.properties.call_args_list:
    print(call.kwargs["title"])
"#;

/// What a study's notebook prints and has in the titles of its charts; `None` without Python.
fn notebook(place: &Place, folder: &str, study: &str) -> Option<String> {
    place.isoflop(&["export", folder, "--to", "notebook", "--out", "."]).exits(0);
    place.write("cells.py", CELLS);
    let words = ["cells.py", folder, &format!("{study}.ipynb")];
    let Ok(ended) = Command::new("python3").args(words).current_dir(place.path("")).output() else {
        eprintln!("skipped: the notebook, since there is no python3");
        return None;
    };
    assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stderr));
    Some(String::from_utf8(ended.stdout).unwrap())
}

#[test]
fn every_exponent_has_one_value_on_the_screen_in_figures_in_the_report_in_the_notebook_and_in_files()
 {
    for study in ["procedural-law", "motion-law", "two-frames"] {
        let own = format!("{}/results/{study}", env!("CARGO_MANIFEST_DIR"));
        let place = Place::new();
        fs::create_dir_all(place.path("results")).unwrap();
        let copied = Command::new("cp").args(["-r", &own]).arg(place.path("results")).status();
        assert!(copied.unwrap().success());
        let folder = format!("results/{study}");
        let screen = place.isoflop(&["fit", &folder, "--save"]).exits(0).stdout();
        let full = place.isoflop(&["fit", &folder, "--full"]).exits(0).stdout();
        let printed = place.isoflop(&["fit", &folder, "--json"]).exits(0).json();
        let kept = place.json(&format!("{folder}/laws.json"));
        assert_eq!(printed["answer"], kept["answer"]);
        place.isoflop(&["plot", &folder]).exits(0);
        place.isoflop(&["report", &folder]).exits(0);
        let read = |file: &str| {
            String::from_utf8(place.read(&format!("{folder}/{file}")))
                .unwrap()
                .replace('\u{2212}', "-")
        };
        let (figure, report) = (read("figures/power_laws.svg"), read("report.html"));
        let told = exponents(&kept["answer"]);
        assert!(!told.is_empty(), "{study}: {:#}", kept["answer"]);
        for number in told.iter().flatten() {
            for (place, text) in
                [("screen", &screen), ("full", &full), ("figure", &figure), ("report", &report)]
            {
                assert!(text.contains(number.as_str()), "{study}: {number} is not in the {place}");
            }
        }
        let notebook = notebook(&place, &folder, study);
        for number in told.iter().flatten() {
            let is_in = |text: &String| text.contains(number.as_str());
            assert!(notebook.as_ref().is_none_or(is_in), "{study}: {number}: {notebook:?}");
        }
        let formula = kept["answer"]["formula"].as_str().unwrap();
        assert!(notebook.as_ref().is_none_or(|text| text.contains(formula)), "{study}: {formula}");
        let words = |text: &str| text.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(words(&screen).contains(formula), "{study}: {formula}");
        assert!(words(&report).contains(formula), "{study}: {formula}");
        // What a prediction reads at the largest fitted budget is the end of the path.
        let path = kept["answer"]["path"].as_array().unwrap();
        let last = path.last().unwrap();
        let budget = format!("{:e}", last["budget_flops"].as_f64().unwrap());
        let asked = place.isoflop(&["predict", &budget, "--law", &folder, "--json"]).exits(0);
        let predicted = asked.json()[0]["loss_normalised"].as_f64().unwrap();
        let along = last["loss"]["value"].as_f64().unwrap();
        assert!((predicted - along).abs() < 1e-6, "{study}: {predicted} and {along}");
        // The predictions that the folder keeps, as a screen and the notebook write them.
        for one in place.json(&format!("{folder}/prediction.json")).as_array().unwrap() {
            let budget = format!("{:e}", one["budget_flops"].as_f64().unwrap());
            let screen = place.isoflop(&["predict", &budget, "--law", &folder]).exits(0).stdout();
            let loss = format!("{:.4}", one["loss_normalised"].as_f64().unwrap());
            assert!(screen.contains(&loss), "{study}: {loss} is not in {screen}");
            let near = format!("{:.3}", one["loss_normalised"].as_f64().unwrap());
            let is_in = |text: &String| text.contains(near.trim_end_matches('0'));
            assert!(notebook.as_ref().is_none_or(is_in), "{study}: {near}: {notebook:?}");
            // Sizes and tokens: 1.863e4 on the screen and in the report, 1.863e+04 in the notebook.
            for field in ["params_nonvocab", "tokens"] {
                let written = format!("{:.3e}", one[field].as_f64().unwrap());
                let (digits, power) = written.split_once('e').unwrap();
                let digits = digits.trim_end_matches('0').trim_end_matches('.');
                let shown = format!("{digits}e{power}");
                for (place, text) in [("screen", &screen), ("report", &report)] {
                    assert!(
                        text.contains(&shown),
                        "{study}: {field} {shown} is not in the {place}"
                    );
                }
                let power: i32 = power.parse().unwrap();
                let told = format!("{digits}e+{power:02}");
                let is_in = |text: &String| power < 4 || text.contains(&told);
                assert!(notebook.as_ref().is_none_or(is_in), "{study}: {told}: {notebook:?}");
            }
        }
    }
}
