//! `isoflop generate`, and sweeps with generators as an axis.

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;

use super::support::{Place, records};

/// Makes motions with a sweep's runs; gives the elements of `motions.json`.
pub fn made(place: &Place, run: &str, more: &[&str]) -> Vec<Value> {
    let words = [&["generate", "A person  walks", "someone jumps", "--run", run], more].concat();
    place.isoflop(&words).exits(0);
    let out = more.iter().skip_while(|word| **word != "--out").nth(1).expect("--out is given");
    let motions = place.json(&format!("{out}/motions.json"));
    motions.as_array().expect("a list").clone()
}

/// A run of a generator in `results/NAME`, which is at `results`.
pub fn run_of_kind(results: &Path, kind: &str) -> String {
    let runs = fs::read_dir(results.join("runs")).expect("runs").flatten().map(|run| run.path());
    let is_kind = |run: &PathBuf| {
        let spec = fs::read_to_string(run.join("spec.json"));
        spec.is_ok_and(|spec| spec.contains(&format!("\"{kind}\"")))
    };
    let run = runs.into_iter().find(is_kind).expect("a run of each kind");
    let name = results.file_name().expect("a name").display();
    format!("results/{name}/runs/{}", run.file_name().expect("an id").display())
}

/// The metrics of a run in `results/NAME/runs/ID`.
fn metrics(place: &Place, run: &str) -> impl Fn(&str) -> f64 + use<> {
    let record = place.json(&format!("{run}/record.json"));
    move |name: &str| record["metrics"][name].as_f64().expect("a metric")
}

#[test]
fn motions_of_captions_are_written_whole_and_repeat() {
    let place = Place::with("mini.yaml");
    place.isoflop(&["run", "mini.yaml"]).exits(0);
    let run = "results/mini";
    let first = made(&place, run, &["--samples", "2", "--out", "a"]);
    assert_eq!(first.len(), 4);
    assert_eq!(first[0]["caption"], "A person  walks");
    for (n, motion) in first.iter().enumerate() {
        let frames = motion["length"].as_u64().expect("frames") as usize;
        let skate = motion["physics"]["foot_skate"].as_f64();
        assert_eq!(skate.is_some_and(|share| (0.0..=1.0).contains(&share)), frames >= 4);
        let codes = motion["codes"].as_array().expect("codes");
        assert_eq!((motion["seed"].as_u64(), codes.len() * 4), (Some(0), frames));
        let joints = place.read(&format!("a/{n}.joints.npy"));
        assert_eq!(joints.len(), 128 + 4 * frames * 22 * 3, "float32 after a header");
        for ending in ["features.npy", "bvh", "glb", "svg"] {
            assert!(!place.read(&format!("a/{n}.{ending}")).is_empty());
        }
    }
    assert!(place.read("a/sheet.png").starts_with(b"\x89PNG"));
    let again = made(&place, run, &["--samples", "2", "--out", "b"]);
    assert_eq!(again, first);
    assert_eq!(place.read("a/3.bvh"), place.read("b/3.bvh"));
    let other = made(&place, run, &["--samples", "2", "--seed", "1", "--out", "c"]);
    assert_ne!(other[0]["codes"], first[0]["codes"]);
    assert!(first.iter().all(|motion| motion.get("feet").is_none()), "only with --clean-feet");
    let cleaned = made(&place, run, &["--samples", "2", "--clean-feet", "--out", "f"]);
    for (motion, own) in cleaned.iter().zip(&first) {
        assert_eq!(motion["codes"], own["codes"]);
        assert_eq!(motion["feet"]["foot_skate_before"], own["physics"]["foot_skate"]);
        assert_eq!(motion["feet"]["jerk_after"], motion["physics"]["jerk"]);
        let moved = motion["feet"]["largest_mm"].as_f64().expect("millimetres");
        assert_eq!(moved > 0.0, motion["feet"]["contacts"].as_u64() > Some(0), "{motion}");
    }
    let timed = made(&place, run, &["--seconds", "2", "--out", "d"]);
    assert!(timed.iter().all(|motion| motion["length"] == 40 && motion["ended"] == true));
    let estimated = made(&place, run, &["--seconds", "auto", "--samples", "9", "--out", "e"]);
    let ends_where_told = |motion: &Value| {
        motion["ended"] == true && (40..=196).contains(&motion["length"].as_u64().expect("frames"))
    };
    assert!(estimated.iter().all(ends_where_told), "{estimated:?}");
    assert!(estimated.iter().any(|motion| motion["length"] != estimated[0]["length"]));
    let times = ["generate", "--run", run, "--times", "--seconds", "1"];
    let table = place.isoflop(&times).exits(0).stdout();
    assert!(table.contains("motions of 1.0 s on flex"), "{table}");
    assert!(table.lines().all(|line| line.chars().count() <= 80), "{table}");
    let document = place.isoflop(&[&times[..], &["--json"]].concat()).exits(0).json();
    let rows = document["times"].as_array().expect("a list");
    let batches: Vec<_> = rows.iter().map(|row| row["batch"].as_u64()).collect();
    assert_eq!(batches, [1, 4, 16, 64].map(Some), "without guidance alone");
    assert!(rows.iter().all(|row| row["seconds"].as_f64() > Some(0.0)));
    assert!(!place.path("results/mini/samples").exists(), "no files");
}

#[test]
fn a_sweep_says_how_its_motions_are_sampled_by_default() {
    let place = Place::with("mini.yaml");
    let sampling = ["--set", "sampling={temperature: 0, guidance: 3, detokenizer_guidance: 2}"];
    place.isoflop(&[&["run", "mini.yaml"][..], &sampling].concat()).exits(0);
    let codes = |more: &[&str]| {
        let more = [&["--out", "a", "--overwrite", "--frames", "60"], more].concat();
        made(&place, "results/mini", &more)[0]["codes"].clone()
    };
    let likeliest = codes(&[]);
    assert_eq!(codes(&["--seed", "1"]), likeliest);
    assert_ne!(codes(&["--seed", "1", "--temperature", "9"]), likeliest);
}

#[test]
fn what_cannot_be_made_is_told() {
    let place = Place::with("mini.yaml");
    place.isoflop(&["run", "mini.yaml"]).exits(0);
    let refused = |words: &[&str], sentence: &str| {
        let all = [&["generate"], words].concat();
        place.isoflop(&all).exits(2).says(sentence);
    };
    refused(&["--run", "results/mini"], "no caption");
    refused(&["walk", "--run", "results/nothing"], "does not exist");
    refused(&["walk", "--run", "results"], "is neither a run's folder nor a sweep's");
    refused(&["walk", "--run", "results/mini", "--frames", "900"], "ask for at most 2");
    refused(&["walk", "--run", "results/mini", "--frames", "3"], "ask for at least 4 frames");
    refused(&["walk", "--run", "results/mini", "--guidance", "2"], "every caption");
    refused(&["walk", "--run", "results/mini", "--temperature=-1"], "not a number from 0 on");
    refused(&["walk", "--run", "results/mini", "--seconds", "0"], "a number above 0, or auto");
    let times = ["walk", "--run", "results/mini", "--times", "--seconds", "auto"];
    refused(&times, "here give a number of seconds");
    let words = ["generate", "cartwheel", "Lasso, cartwheel", "--run", "results/mini"];
    let told = "\"cartwheel\" and \"lasso\" stand in no training caption";
    place.isoflop(&words).exits(0).says(told);
    refused(&["walk", "--run", "results/mini"], "holds motions already");
    place.isoflop(&["generate", "walk", "--run", "results/mini", "--overwrite"]).exits(0);
    let run = place.names("results/mini/runs").remove(0);
    let own = format!("results/mini/runs/{run}");
    place.isoflop(&["generate", "walk", "--run", &own, "--out", "own", "--json"]).exits(0);
    assert_eq!(place.json("own/motions.json")[0]["run"], run.as_str());
    fs::remove_file(place.path(&format!("{own}/record.json"))).expect("it was finished");
    refused(&["walk", "--run", &own, "--out", "e"], "has not ended");
}

#[test]
fn generators_are_an_axis_with_laws_of_their_own() {
    let place = Place::with("generators.yaml");
    let ended = place.isoflop(&["run", "generators.yaml"]).exits(0);
    let text = ended.stdout();
    assert!(text.contains("autoregressive") && text.contains("scalewise"), "{text}");
    assert!(text.lines().all(|line| line.chars().count() <= 80), "{text}");
    let results = place.path("results/generators");
    let mut names = records::column(&results, "generator");
    names.sort();
    names.dedup();
    assert_eq!(names.len(), 2, "{names:?}");
    for name in ["autoregressive", "scalewise"] {
        let own = format!("results/generators/generators/{name}");
        let laws = place.json(&format!("{own}/laws.json"));
        assert_eq!(laws["minima"].as_array().map(|minima| !minima.is_empty()), Some(true));
        place.isoflop(&["predict", "1e11", "--law", &own]).exits(0);
    }
    let words = ["predict", "1e11", "--law", "results/generators"];
    place.isoflop(&words).exits(2).says("laws for each of its generators");
    let several = ["fit", "results/generators"];
    place.isoflop(&several).exits(2).says("has runs of several generators");
    for name in &names {
        let own = format!("results/generators/generators/{name}");
        let laws = place.json(&format!("{own}/laws.json"));
        // Two sizes at two budgets determine nothing.
        let fitted = place.isoflop(&["fit", &own, "--json"]).exits(3).json();
        assert_eq!(fitted["power_laws"], laws["power_laws"], "{name}");
    }
    let own = "results/generators/generators/scalewise";
    let validated = place.isoflop(&["validate", own, "--budget", "6e9", "--json"]).exits(0).json();
    assert_eq!(validated["budget_flops"], 6e9);
    let trained = place.path(&format!("{own}/validations/6e9"));
    let generators = records::column(&trained, "generator");
    assert!(!generators.is_empty() && generators.iter().all(|name| name == "scalewise"));
    let drawn = place.isoflop(&["plot", "results/generators"]).exits(0).stdout();
    assert!(drawn.contains("figures/generators.svg"), "{drawn}");
    assert!(drawn.contains("scalewise/figures/loss_vs_flops.svg"), "{drawn}");
    assert!(!results.join("figures/loss_vs_flops.svg").exists(), "no figure mixes generators");
    assert!(results.join("figures/generators.svg").exists());
    place.isoflop(&["report", "results/generators"]).exits(0);
    assert!(results.join("report.html").exists());
    let again = place.isoflop(&["run", "generators.yaml"]).exits(0);
    assert_eq!(again.stdout(), text);
    let best = "results/generators";
    let short = ["generate", "walk", "--run", best, "--frames", "3", "--out", "short"];
    place.isoflop(&short).exits(2).says("ask for at least 4 frames");
    let guided = ["--out", "made", "--guidance", "2", "--frames", "60"];
    let motions = made(&place, best, &guided[..2]);
    assert_eq!(motions.len(), 2);
    let run = run_of_kind(&results, "scalewise");
    let guided = [&["--overwrite"], &guided[..]].concat();
    let motions = made(&place, &run, &guided);
    assert!(motions.iter().all(|motion| motion["length"] == 60), "{motions:?}");
    assert!(motions.iter().all(|motion| motion["codes"].as_array().map(Vec::len) == Some(7)));
}

#[test]
fn a_generator_that_does_not_suit_the_codes_is_refused() {
    let place = Place::with("mini.yaml");
    let refused = |settings: &[&str], sentence: &str| {
        let words = [&["plan", "mini.yaml"], settings].concat();
        place.isoflop(&words).exits(2).says(sentence);
    };
    refused(&["--set", "generator=scalewise"], "the quantizer has one");
    let multiscale = "tokenizer={kind: patch, quantizer: {kind: multiscale}}";
    refused(&["--set", "generator=masked", "--set", multiscale], "has scales of several");
    refused(&["--set", "model.text_drop=1"], "1 is out of range: 0 to 0.999");
}

#[test]
fn a_masked_generator_runs_to_its_laws_and_makes_motions() {
    let place = Place::with("mini.yaml");
    place.isoflop(&["run", "mini.yaml", "--set", "generator=masked"]).exits(0);
    assert!(place.path("results/mini/laws.json").exists());
    let motions = made(&place, "results/mini", &["--out", "made", "--guidance", "1"]);
    assert!(motions.iter().all(|motion| motion["length"].as_u64() >= Some(40)), "{motions:?}");
    let captions = place.names("results/mini/text").remove(0);
    let file = place.path(&format!("results/mini/text/{captions}/vectors.safetensors"));
    let mut bytes = fs::read(&file).expect("captions");
    // As an older version wrote it: without an estimator.
    for name in ["\"lengths.hidden\"", "\"digest\""] {
        let at = bytes.windows(name.len()).position(|part| part == name.as_bytes());
        bytes[at.expect("a column of this name") + 1] = b'_';
    }
    fs::write(&file, bytes).expect("it was there");
    let words = ["generate", "walk", "--run", "results/mini", "--out", "none"];
    place.isoflop(&words).exits(2).says("its column `lengths.hidden` is missing").says("--seconds");
    fs::remove_file(file).expect("it was there");
    place.isoflop(&words).exits(2).says("vectors.safetensors").says("--seconds");
    place.isoflop(&[&words[..], &["--seconds", "3"]].concat()).exits(0);
}

#[test]
fn residual_codes_are_made_one_after_another_or_in_two_stages() {
    let place = Place::with("residual.yaml");
    let kinds = ["--set", "generator=[autoregressive, masked]", "--set", "seeds=[0]"];
    place.isoflop(&[&["run", "residual.yaml"][..], &kinds].concat()).exits(0);
    let results = place.path("results/residual");
    let names = records::column(&results, "generator");
    assert_eq!(names.iter().filter(|name| *name == "masked").count() * 2, names.len());
    assert!(results.join("generators/masked/laws.json").exists());
    for kind in ["autoregressive", "masked"] {
        let metric = metrics(&place, &run_of_kind(&results, kind));
        let used = "likeliest_exponential_entropy";
        let layers = [1, 2, 3].map(|layer| metric(&format!("{used}_scale_{layer}")));
        assert!(layers.iter().all(|used| (1.0..=64.0).contains(used)), "{kind}: {layers:?}");
        assert!((layers.iter().sum::<f64>() / 3.0 - metric(used)).abs() < 1e-9, "{kind}");
    }
    let run = run_of_kind(&results, "masked");
    let metric = metrics(&place, &run);
    let layers = [1, 2, 3].map(|layer| metric(&format!("loss_normalised_scale_{layer}")));
    let mean = layers.iter().sum::<f64>() / 3.0;
    assert!((mean - metric("loss_normalised")).abs() < 1e-9, "layers are alike: {layers:?}");
    let motions = made(&place, &run, &["--out", "made", "--frames", "60", "--guidance", "1"]);
    for motion in &motions {
        assert_eq!(motion["length"], 60);
        assert_eq!(motion["codes"].as_array().map(Vec::len), Some(3 * 15));
    }
    let again = made(&place, &run, &["--out", "again", "--frames", "60", "--guidance", "1"]);
    assert_eq!(again, motions);
    let words = ["generate", "walk", "--run", &run, "--frames", "900", "--out", "long"];
    place.isoflop(&words).exits(2).says("ask for at most 2");
    let words = ["generate", "walk", "--run", &run, "--frames", "3", "--out", "short"];
    place.isoflop(&words).exits(2).says("ask for at least 4 frames");
}
