//! `isoflop evaluator`, `isoflop evaluate`, and sweeps whose runs are scored.

use std::fs;

use serde_json::Value;

use super::humanml3d::write_set;
use super::support::{Place, records};

/// Scores of a sweep's folder, by run.
fn scores(place: &Place) -> Vec<Value> {
    let folders = fs::read_dir(place.path("results/scored/scores")).expect("scores");
    let read = |folder: fs::DirEntry| fs::read(folder.path().join("scores.json")).expect("whole");
    folders.flatten().map(|folder| serde_json::from_slice(&read(folder)).expect("JSON")).collect()
}

#[test]
fn one_file_leads_from_a_sweep_to_scores() {
    let place = Place::with("scored.yaml");
    let planned = place.isoflop(&["plan", "scored.yaml"]).exits(0);
    assert!(planned.stdout().contains("an evaluator, 4 runs scored"), "{}", planned.stdout());
    let ended = place.isoflop(&["run", "scored.yaml"]).exits(0);
    let text = ended.stdout();
    assert!(text.contains("scored runs") && text.contains("true motions: R@1"), "{text}");
    let last: Vec<&str> = text.lines().skip_while(|line| !line.contains("scored runs")).collect();
    assert!(last.iter().all(|line| line.chars().count() <= 80), "{text}");
    let csv = String::from_utf8(place.read("results/scored/scores.csv")).expect("text");
    assert_eq!(csv.lines().count(), 5, "{csv}");
    for file in ["scores.parquet", "figures/quality.svg", "figures/quality.png", "laws.json"] {
        assert!(place.path("results/scored").join(file).is_file(), "{file}");
    }
    let all = scores(&place);
    assert_eq!(all.len(), 4);
    for one in &all {
        let mean = |path: &str| one.pointer(path).and_then(Value::as_f64).expect("a number");
        assert!(mean("/truth/fid/mean") < 1e-6, "{one:#}");
        assert!(mean("/made/fid/mean") > mean("/halves_fid/mean"), "{one:#}");
        assert!(mean("/truth/precision/0/mean") > mean("/shuffled/precision/0/mean") + 0.2);
        let run = one["run_id"].as_str().expect("an id");
        let samples = place.names(&format!("results/scored/samples/{run}/scored"));
        assert_eq!(samples, ["0.features.npy", "1.features.npy", "motions.json"]);
    }
    // The page shows the true motion, what the tokenizer keeps of it, and the generated one side by side.
    place.isoflop(&["report", "results/scored", "--out", "page.html"]).exits(0);
    let page = String::from_utf8(place.read("page.html")).expect("text");
    let motions = page.split("id=\"motions\" type=\"application/json\">").nth(1).expect("motions");
    let motions: Value =
        serde_json::from_str(motions.split("</script>").next().unwrap()).expect("JSON");
    for sample in motions["samples"].as_array().expect("samples") {
        let bodies = sample["bodies"].as_array().expect("bodies");
        let names: Vec<&Value> = bodies.iter().map(|body| &body["name"]).collect();
        assert_eq!(names, ["true motion", "its reconstruction", "generated"]);
        // A number of base64 VLQ ends with a letter from A to f.
        let ends = |letter: &char| matches!(letter, 'A'..='Z' | 'a'..='f');
        let frames = |body: usize| {
            bodies[body]["mm"].as_str().expect("text").chars().filter(ends).count() / 66
        };
        assert!(frames(0) >= frames(1) && frames(0) < frames(1) + 4, "whole latents are kept");
    }
    // The same command again makes nothing, and says the same.
    let before: Vec<_> = records::bytes(&place.path("results/scored")).into_iter().collect();
    let again = place.isoflop(&["run", "scored.yaml"]).exits(0);
    assert_eq!(again.stdout(), text);
    assert_eq!(
        records::bytes(&place.path("results/scored")).into_iter().collect::<Vec<_>>(),
        before
    );
    // Scores by other settings stand in place of these, and not beside them.
    let others = ["--set", "scores.repeats=1", "--set", "scores.multimodal_captions=0"];
    place.isoflop(&[&["run", "scored.yaml"][..], &others].concat()).exits(0);
    assert_eq!(scores(&place).len(), 8, "both lie in the folder");
    let csv = String::from_utf8(place.read("results/scored/scores.csv")).expect("text");
    assert_eq!(csv.lines().count(), 5, "{csv}");
    // So do those by another evaluator, if it is worth anything.
    place.isoflop(&["run", "scored.yaml", "--set", "evaluator.seed=1"]).exits(0);
    let csv = String::from_utf8(place.read("results/scored/scores.csv")).expect("text");
    assert_eq!((csv.lines().count(), scores(&place).len()), (5, 12), "{csv}");
    place.isoflop(&["run", "scored.yaml"]).exits(0);
    let beside = place.isoflop(&["published", "results/scored", "--out", "tables"]).exits(0);
    assert!(beside.stdout().contains("trained by isoflop: not comparable"), "{}", beside.stdout());
    assert!(beside.stdout().lines().all(|line| line.chars().count() <= 80), "{}", beside.stdout());
    let csv = String::from_utf8(place.read("tables/published.csv")).expect("text");
    assert!(csv.lines().last().is_some_and(|line| line.starts_with("scored,scored,")), "{csv}");
    assert!(place.path("tables/published.parquet").is_file());
    // By hand, the same motions score the same.
    let run = format!("results/scored/runs/{}", all[0]["run_id"].as_str().expect("an id"));
    let by_hand = ["evaluate", "--run", &run, "--repeats", "2", "--no-multimodality", "--json"];
    let document = place.isoflop(&by_hand).exits(0).json();
    assert_eq!(document["made"], all[0]["made"]);
    assert_eq!(document["multimodality"], Value::Null);
}

#[test]
fn published_scores_stand_beside_ones_own_and_are_not_compared() {
    let place = Place::with("scored.yaml");
    let missing = place.isoflop(&["published", "results/none"]).exits(2);
    assert!(missing.stderr().contains("`isoflop run` writes them"), "{}", missing.stderr());
    let all = place.isoflop(&["published"]).exits(0);
    assert!(all.stdout().lines().all(|line| line.chars().count() <= 80), "{}", all.stdout());
    let is_row =
        |line: &str| line.starts_with("MARDM ") && line.contains("0.500 ± 0.004  0.114 ± 0.007");
    assert!(all.stdout().lines().any(is_row), "{}", all.stdout());
    let kit = place.isoflop(&["published", "--dataset", "kit-ml", "--json"]).exits(0).json();
    let rows = kit["rows"].as_array().expect("rows");
    assert!(rows.len() > 10 && rows.iter().all(|row| row["dataset"] == "KIT-ML"));
    let table = place.isoflop(&["published", "--table", "scamo-1", "--out", "one"]).exits(0);
    assert!(table.stdout().starts_with("model,layers,heads,width\nScaMo-44M,8,8,512\n"));
    let csv = String::from_utf8(place.read("one/published.csv")).expect("text");
    assert!(csv.contains("\nscamo-1,\"\",\"\",ScaMo-44M,\"\",width,512.0,\n"), "{csv}");
    let unknown = place.isoflop(&["published", "--table", "scamo-9"]).exits(2);
    assert!(unknown.stderr().contains("scamo-"), "{}", unknown.stderr());
}

/// A sweep with an evaluator that was trained alone.
fn with_evaluator() -> Place {
    let place = Place::with("scored.yaml");
    let ended = place.isoflop(&["evaluator", "train", "scored.yaml"]).exits(0);
    let text = ended.stdout();
    assert!(text.contains("every required gate is passed"), "{text}");
    assert!(text.lines().all(|line| line.chars().count() <= 80), "{text}");
    assert!(!place.path("results/scored/runs.parquet").exists());
    place
}

#[test]
fn an_evaluator_is_trained_alone_and_scores_motions_of_files() {
    let place = with_evaluator();
    let gates = place.isoflop(&["evaluator", "gates", "results/scored", "--json"]).exits(0).json();
    assert_eq!(gates["evaluators"][0]["passes"], true);
    let evaluate = |files: &[&str]| {
        let words = [&["evaluate"], files, &["--evaluator", "results/scored"]].concat();
        place.isoflop(&words)
    };
    fs::create_dir(place.path("motions")).expect("a folder");
    place.write("motions/walk.txt", "a person walks\n");
    place.write("motions/walk.npy", npy(&[40, 263], 0.1));
    let one = evaluate(&["motions"]).exits(0);
    let one = one.says("motions/walk.npy: the legs are 0.000 times as long");
    let text = one.stdout();
    for words in [
        "1 motion, 1 with a caption, beside 192 true ones",
        "FID needs 2 motions in each set or more, there are 1",
        "R-precision needs 32 pairs of text and motion or more, there are 1",
        "diversity needs 2 motions or more, there are 1",
    ] {
        assert!(text.contains(words), "{text}");
    }
    assert!(text.lines().all(|line| line.chars().count() <= 80), "{text}");
    for (name, file, words) in [
        ("thin.npy", npy(&[40, 251], 0.0), "where [frames, 263] is needed"),
        ("holes.npy", npy(&[40, 263], f32::NAN), "not finite, the first at [0, 0]"),
        ("short.npy", npy(&[3, 263], 0.0), "3 frames is too short: the evaluator sees 4 as one"),
        ("odd.bvh", b"HIERARCHY".to_vec(), "the line MOTION"),
    ] {
        place.write(name, file);
        let ended = evaluate(&["motions/walk.npy", name]).exits(2);
        assert!(ended.stderr().contains(words), "{}", ended.stderr());
    }
    fs::create_dir(place.path("empty")).expect("a folder");
    evaluate(&["empty"]).exits(2).says("empty holds no .npy and no .bvh");
    place.write("two.txt", "a\nb\n");
    let texts = ["motions/walk.npy", "--texts", "two.txt"];
    evaluate(&texts).exits(2).says("two.txt has 2 captions for 1 motions");
    place.isoflop(&["evaluate", "motions"]).exits(2).says("--evaluator");
    place
        .isoflop(&["evaluate", "motions", "--evaluator", "motions"])
        .exits(2)
        .says("no trained evaluator");
}

/// An array of one value.
fn npy(shape: &[usize], value: f32) -> Vec<u8> {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("a.npy");
    let values = vec![value; shape.iter().product()];
    isoflop::data::write_npy(&path, shape, &values).expect("a writable folder");
    fs::read(path).expect("written")
}

#[test]
fn an_evaluator_that_fails_a_gate_scores_nothing() {
    let place = Place::with("scored.yaml");
    let words = ["run", "scored.yaml", "--set", "evaluator.steps=1", "--set", "grid.budgets=[1e9]"];
    let ended = place.isoflop(&words).exits(1);
    let told = ended.stderr();
    assert!(told.contains("scores nothing: it fails R@1 of true motions"), "{told}");
    assert!(place.path("results/scored/runs.parquet").is_file(), "the runs are there all the same");
    assert!(!place.path("results/scored/scores.parquet").exists());
    let gates = place.isoflop(&["evaluator", "gates", "results/scored"]).exits(0);
    assert!(gates.stdout().contains("FAILS R@1 of true motions"), "{}", gates.stdout());
    assert!(gates.stdout().contains("it scores nothing"), "{}", gates.stdout());
}

#[test]
fn what_cannot_be_scored_is_refused_before_anything_is_trained() {
    let place = Place::with("mini.yaml");
    place.isoflop(&["evaluator", "train", "mini.yaml"]).exits(2).says("names no evaluator");
    for (setting, words) in [
        ("scores={}", "no evaluator to score by"),
        ("evaluator={heads: 3}", "RoPE turns pairs"),
        ("evaluator={width: 0}", "0 is out of range: 2 to 8192"),
        ("evaluator={sight: 3}", "unknown name `sight`"),
    ] {
        place.isoflop(&["plan", "mini.yaml", "--set", setting]).exits(2).says(words);
    }
    let both = ["--set", "evaluator={}", "--set"];
    for (setting, words) in [
        ("scores={only: [\"width > 3\"]}", "unknown name `width`; valid: n_layer"),
        ("scores={top_p: 2}", "2 is out of range: 1e-6 to 1"),
        ("scores={multimodal_motions: 1}", "at least 2"),
    ] {
        let words_of = [&["plan", "mini.yaml"], &both[..], &[setting]].concat();
        place.isoflop(&words_of).exits(2).says(words);
    }
    let some =
        [&["plan", "mini.yaml"], &both[..], &["scores={only: [\"d_model == 16\"]}"]].concat();
    let planned = place.isoflop(&some).exits(0).stdout();
    assert!(planned.contains("an evaluator, 4 runs scored"), "{planned}");
    place.isoflop(&["evaluator", "gates", "nowhere"]).exits(2).says("nowhere does not exist");
}

/// A small sweep on a folder of clips whose texts have parts of speech, scored by networks that others trained.
const LOADED: &str = "name: loaded
data: {source: humanml3d, path: data, mirror: false}
text: {dim: 16, max_tokens: 12}
tokenizer: {width: 8, depth: 1, steps: 10, batch: 4, window: 40}
evaluator: {weights: finest}
scores: {repeats: 1, multimodal_captions: 0, samples: 0}
grid:
  models: [{n_layer: 1, n_head: 1, d_model: 8}]
  vocab: [16]
  budgets: [2e8]
train: {min_steps: 5, batch: {min: 32}}
";

#[test]
fn runs_are_scored_by_an_evaluator_that_others_trained() {
    let place = Place::new();
    place.write("loaded.yaml", LOADED);
    write_set(&place, "data", 5, [16, 4, 64]);
    let run = ["run", "loaded.yaml"];
    place.isoflop(&run).exits(2).says("experiments/convert_evaluator.py made: evaluator.json");
    place.isoflop(&["plan", "loaded.yaml"]).exits(0).says("ids are provisional");
    let made = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/fixtures/evaluator/guo");
    for file in ["evaluator.json", "words.json", "weights.safetensors"] {
        let bytes = fs::read(format!("{made}/{file}")).expect("a fixture");
        fs::create_dir_all(place.path("finest")).expect("a folder");
        place.write(&format!("finest/{file}"), bytes);
    }
    let gates = place.isoflop(&["evaluator", "train", "loaded.yaml"]).exits(0);
    let text = gates.stdout();
    assert!(text.contains("64 test clips, loaded as `guo`"), "{text}");
    assert!(text.contains("gates bar no loaded evaluator") && !text.contains("FAILS"), "{text}");
    assert!(text.lines().all(|line| line.chars().count() <= 80), "{text}");
    place.isoflop(&run).exits(0);
    let csv = String::from_utf8(place.read("results/loaded/scores.csv")).expect("text");
    assert_eq!(csv.lines().count(), 2, "{csv}");
    // The folder of results has all that scores need.
    fs::remove_dir_all(place.path("finest")).expect("a folder");
    let by_hand = ["evaluate", "--run", "results/loaded", "--repeats", "1", "--no-multimodality"];
    let by_hand = place.isoflop(&by_hand).exits(0);
    let text = by_hand.stdout();
    assert!(text.contains("rows of `guo` in `isoflop published`"), "{text}");
    assert!(text.lines().all(|line| line.chars().count() <= 80), "{text}");
    let published = ["published", "results/loaded"];
    let beside = place.isoflop(&published).exits(0);
    let text = beside.stdout();
    assert!(text.contains("the same evaluator as in tables of `guo`"), "{text}");
    assert!(text.lines().all(|line| line.chars().count() <= 80), "{text}");
    let rows = place.isoflop(&[&published[..], &["--json"]].concat()).exits(0).json();
    let last = rows["rows"].as_array().and_then(|rows| rows.last()).expect("rows");
    assert_eq!((&last["table"], &last["evaluator"]), (&"loaded".into(), &"guo".into()));
    assert!(last["scores"]["fid"].is_object() && last["scores"]["cosine"].is_null(), "{last}");
}
