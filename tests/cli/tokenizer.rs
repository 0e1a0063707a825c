//! `isoflop tokenizer`: training without runs, and the comparison with k-means.

use std::fs;

use serde_json::Value;

use super::generate::{made, run_of_kind};
use super::support::{Place, records};

#[test]
fn tokenizers_are_trained_alone_compared_and_not_trained_again_by_run() {
    let place = Place::with("mini.yaml");
    let words = ["tokenizer", "train", "mini.yaml"];
    let patches = ["--set", "tokenizer={kind: patch, width: 8, steps: 3, batch: 2, pool_clips: 8}"];
    let train = [&words[..], &patches].concat();
    let ended = place.isoflop(&train).exits(0).says("0 of 8 runs finished or failed before");
    let table = ended.stdout();
    assert!(table.contains("k-means on test") && table.contains("patch vq"), "{table}");
    assert!(table.lines().all(|line| line.chars().count() <= 80), "{table}");
    let tokenizers = || {
        let folders = fs::read_dir(place.path("results/mini/tokenizers")).expect("trained");
        let metrics = folders.map(|folder| folder.expect("listed").path().join("metrics.json"));
        metrics.map(|path| fs::metadata(path).and_then(|m| m.modified()).expect("there"))
    };
    let trained: Vec<_> = tokenizers().collect();
    assert!(!place.path("results/mini/runs.parquet").exists());
    place.isoflop(&[&["run", "mini.yaml"][..], &patches].concat()).exits(0);
    assert!(trained.into_iter().eq(tokenizers()), "run trained them again");
    let document = place.isoflop(&["tokenizer", "eval", "results/mini", "--json"]).exits(0).json();
    let first = &document["tokenizers"][0];
    for name in ["mpjpe_mm", "mpjpe_heading_mm", "val_mpjpe_mm", "frames_per_code"] {
        assert!(first[name].as_f64().is_some_and(|mm| mm > 0.0), "{document:#}");
    }
    assert!(first["kmeans_mpjpe_mm"].is_number(), "{document:#}");
    for name in ["boundary_step_ratio", "jerk_ratio", "root_end_error"] {
        assert!(first["continuity"][name].is_number(), "{document:#}");
    }
    assert!(first["continuity_by_source"].is_null() && table.contains("boundary"), "{document:#}");
}

/// Runs a sweep to its laws, and gives the metrics of its tokenizers and the columns of its runs.
fn laws_of(sweep: &str) -> (Place, Vec<Value>) {
    let place = Place::with(&format!("{sweep}.yaml"));
    place.isoflop(&["run", &format!("{sweep}.yaml")]).exits(0);
    let results = format!("results/{sweep}");
    let laws = fs::read_to_string(place.path(&format!("{results}/laws.json"))).expect("fitted");
    let laws: Value = serde_json::from_str(&laws).expect("JSON");
    assert!(laws["minima"].as_array().is_some_and(|minima| !minima.is_empty()), "{laws:#}");
    let document = place.isoflop(&["tokenizer", "eval", &results, "--json"]).exits(0).json();
    let tokenizers = document["tokenizers"].as_array().expect("a list").clone();
    (place, tokenizers)
}

fn column(place: &Place, sweep: &str, name: &str) -> Vec<String> {
    let mut values = records::column(&place.path(&format!("results/{sweep}")), name);
    values.sort();
    values.dedup();
    values
}

#[test]
fn a_sweep_on_residual_codes_runs_to_its_laws() {
    let (place, tokenizers) = laws_of("residual");
    let of_three = |v: usize| (3 * v).to_string();
    assert_eq!(column(&place, "residual", "n_vocab"), [of_three(8), of_three(16)]);
    assert_eq!(column(&place, "residual", "quantizer"), ["residual"]);
    for tokenizer in tokenizers {
        let scales = tokenizer["scales"].as_array().expect("one a layer");
        let total: u64 = scales.iter().filter_map(|scale| scale["n_vocab"].as_u64()).sum();
        assert_eq!((scales.len(), Some(total)), (3, tokenizer["n_vocab"].as_u64()));
        assert!(scales.iter().all(|scale| scale["utilisation"].as_f64() > Some(0.0)));
        assert_eq!(tokenizer["frames_per_code"], 4);
        assert!(tokenizer["kmeans_mpjpe_mm"].is_number(), "{tokenizer:#}");
    }
}

#[test]
fn a_sweep_on_codes_of_several_lengths_runs_to_its_laws() {
    let (place, tokenizers) = laws_of("multiscale");
    // Codebooks of half of 8 to three halves of it: 4, 7, 9 and 12; twice that for 16.
    assert_eq!(column(&place, "multiscale", "n_vocab"), ["32", "64"]);
    for loss in column(&place, "multiscale", "loss_normalised") {
        assert!(loss.parse::<f64>().is_ok_and(f64::is_finite), "{loss}");
    }
    for tokenizer in tokenizers {
        let scales = tokenizer["scales"].as_array().expect("one a scale");
        assert_eq!(scales.len(), 4);
        assert!(tokenizer["frames_per_code"].is_null() && tokenizer["kmeans_mpjpe_mm"].is_null());
    }
    // 16 clips of 15 codes each, and no end token.
    assert_eq!(column(&place, "multiscale", "unique_tokens"), ["240"]);
}

/// Clips of 40 to 196 frames, windows of 64: the longest are encoded in four pieces.
#[test]
fn a_sweep_on_a_fixed_number_of_latents_runs_and_makes_motions_of_any_length() {
    let place = Place::with("language.yaml");
    let fixed = ["--set", "tokenizer.latents=6", "--set", "grid.vocab=[8]"];
    place.isoflop(&[&["run", "language.yaml"][..], &fixed].concat()).exits(0);
    let own = place.json(&format!("{}/metrics.json", first_tokenizer(&place, "language")));
    assert!(own["frames_per_code"].is_null() && own["continuity"]["jerk_ratio"].is_number());
    for kind in ["autoregressive", "scalewise"] {
        let run = run_of_kind(&place.path("results/language"), kind);
        for frames in ["4", "24", "90", "196"] {
            let more = ["--frames", frames, "--out", "made", "--overwrite"];
            for motion in made(&place, &run, &more) {
                let codes = motion["codes"].as_array().expect("codes").len();
                let whole = frames.parse::<u64>().expect("a number") / 4 * 4;
                assert_eq!((codes, motion["length"].as_u64()), (7, Some(whole)), "{kind}");
            }
        }
    }
}

#[test]
fn impossible_scales_and_keys_of_another_quantizer_are_refused() {
    let place = Place::with("mini.yaml");
    let refused = |setting: &str, sentence: &str| {
        let setting = format!("tokenizer.quantizer={setting}");
        let patch = ["--set", "tokenizer={kind: patch}", "--set", &setting];
        place.isoflop(&[&["plan", "mini.yaml"][..], &patch].concat()).exits(2).says(sentence);
    };
    refused("{kind: vq, layers: 2}", "belongs to `kind: residual`");
    refused("{kind: residual, layers: 0}", "0 is out of range: 1 to 64");
    refused("{kind: residual, scales: full}", "belongs to `kind: multiscale`");
    refused("{kind: residual, iner: fsq}", "did you mean `inner`?");
    refused("{kind: multiscale, scales: []}", "must be one or more numbers above 0");
    refused("{kind: multiscale, scales: [4, 2]}", "each larger than the one before it");
    refused("{kind: multiscale, scales: ful}", "did you mean `full`?");
    let latents = |more: &str| {
        let tokenizer = format!("tokenizer={{kind: transformer, {more}}}");
        place.isoflop(&["plan", "mini.yaml", "--set", &tokenizer]).exits(2)
    };
    let scales = "quantizer: {kind: multiscale, scales: [1, 9]}";
    latents(&format!("latents: 8, {scales}")).says("which has 8 latents: set it to 9 or more");
    latents(&format!("latents: 65, {scales}")).says("a window has 64 frames");
    latents("latents: 49").says("belongs to `quantizer: {kind: multiscale}`");
    latents(&format!("latents: 0, {scales}")).says("0 is out of range: 1 to 16384");
    let short = ["--set", "tokenizer={kind: patch, window: 96, quantizer: {kind: multiscale}}"];
    let plan = [&["plan", "mini.yaml"][..], &short].concat();
    place.isoflop(&plan).exits(2).says("a scale of 49 codes is longer than a window");
}

#[test]
fn keys_of_the_other_kind_and_folders_without_tokenizers_are_refused() {
    let place = Place::with("mini.yaml");
    let refused = |setting: &str, sentence: &str| {
        place.isoflop(&["plan", "mini.yaml", "--set", setting]).exits(2).says(sentence);
    };
    refused("tokenizer={kind: patch, down: 2}", "is not of `kind: patch`");
    refused("tokenizer={latent: 8}", "belongs to `kind: patch`");
    refused("tokenizer={mix_arm: 0.5}", "belongs to `loss: joints`");
    refused("tokenizer={kind: patch, decay_at: 0.5}", "belongs to `schedule: step`");
    refused("tokenizer={kind: patch, position_weight: 1}", "belongs to `loss: features`");
    refused("tokenizer={kind: fsq, commitment: 1}", "belongs to VQ");
    refused("tokenizer={kind: patch, frames: 3}", "must be 1, 2 or 4");
    let features = "tokenizer={kind: patch, loss: features, quantizer: {kind: fsq}}";
    place.isoflop(&["plan", "mini.yaml", "--set", features]).exits(0);
    let engine = ["tokenizer", "train", "mini.yaml", "--engine", "slurm"];
    place.isoflop(&engine).exits(2).says("use `isoflop run`");
    place.isoflop(&["tokenizer", "eval", "results/none"]).exits(2).says("does not exist");
    fs::create_dir_all(place.path("results/empty")).expect("a writable folder");
    place.isoflop(&["tokenizer", "eval", "results/empty"]).exits(2).says("no tokenizer is trained");
}

#[test]
fn a_sweep_whose_tokenizers_all_fail_says_so_and_is_no_usage_error() {
    let place = Place::with("mini.yaml");
    let words = ["tokenizer", "train", "mini.yaml", "--set", "tokenizer.lr=1e30"];
    place.isoflop(&words).exits(1).says("failed [diverged]").says("lower tokenizer.lr");
}

#[test]
fn transformers_that_see_captions_run_to_laws_and_once() {
    let place = Place::with("mini.yaml");
    let language = "tokenizer={kind: transformer, width: 8, heads: 2, window: 32, steps: 3, batch: 2, \
                    pool_clips: 8, language: {at: [tokenizer, detokenizer], drop: 0.1}}";
    let alone = ["tokenizer", "train", "mini.yaml", "--set", language];
    let trained = place.isoflop(&alone).exits(0).says("3 jobs to do");
    assert!(trained.stdout().contains("transformer vq"), "{}", trained.stdout());
    let words = ["run", "mini.yaml", "--set", language];
    place.isoflop(&words).exits(0);
    assert!(place.path("results/mini/runs.parquet").exists());
    place.isoflop(&words).exits(0).says("8 of 8 runs finished or failed before");
    let folders = fs::read_dir(place.path("results/mini/tokenizers")).expect("trained");
    let text = fs::read_dir(place.path("results/mini/text")).expect("made").next();
    let text = text.expect("one").expect("listed").file_name();
    for folder in folders {
        let job =
            fs::read_to_string(folder.expect("listed").path().join("job.json")).expect("there");
        let job: Value = serde_json::from_str(&job).expect("a job");
        assert_eq!(job["text_id"].as_str(), text.to_str(), "{job:#}");
        assert_eq!(job["spec"]["architecture"]["language"]["dim"], 16, "that of the text section");
    }
}

/// The folder of a tokenizer of a sweep.
fn first_tokenizer(place: &Place, sweep: &str) -> String {
    let id = place.names(&format!("results/{sweep}/tokenizers")).remove(0);
    format!("results/{sweep}/tokenizers/{id}")
}

#[test]
fn codes_are_counted_and_drawn_scale_by_scale() {
    for sweep in ["multiscale", "residual", "mini"] {
        let place = Place::with(&format!("{sweep}.yaml"));
        place.isoflop(&["run", &format!("{sweep}.yaml")]).exits(0);
        let own = first_tokenizer(&place, sweep);
        let words = ["tokenizer", "codes", "--tokenizer", &own];
        let document = place.isoflop(&[&words[..], &["--json"]].concat()).exits(0).json();
        assert_eq!(document["scales"], place.json(&format!("{own}/metrics.json"))["scales"]);
        let explained = document["explained"].as_array().expect("two shares");
        let sum: f64 = explained.iter().filter_map(Value::as_f64).sum();
        assert!(explained.len() == 2 && (0.0..1.0 + 1e-6).contains(&sum), "{document:#}");
        for figure in document["figures"].as_array().expect("paths") {
            let path = figure.as_str().expect("a path");
            assert!(fs::metadata(path).is_ok_and(|file| file.len() > 1000), "{path}");
        }
        let text = place.isoflop(&words).exits(0).stdout();
        assert!(text.lines().all(|line| line.chars().count() <= 80), "{text}");
    }
}

#[test]
fn codes_that_were_never_made_are_told() {
    let place = Place::with("mini.yaml");
    place.isoflop(&["tokenizer", "train", "mini.yaml"]).exits(0);
    let own = first_tokenizer(&place, "mini");
    let ended = place.isoflop(&["tokenizer", "codes", "--tokenizer", &own]).exits(2);
    ended.says("`isoflop run` makes the codes of the data");
}

#[test]
fn without_guidance_the_reconstruction_is_that_of_the_metrics() {
    let place = Place::with("language.yaml");
    place.isoflop(&["tokenizer", "train", "language.yaml"]).exits(0);
    let own = first_tokenizer(&place, "language");
    let words = ["tokenizer", "guidance", "--tokenizer", &own, "--at", "0,3", "--json"];
    let document = place.isoflop(&words).exits(0).json();
    let metrics = place.json(&format!("{own}/metrics.json"));
    let [without, with] = [0, 1].map(|i| &document["guidances"][i]["made"]);
    for name in ["mpjpe_mm", "mpjpe_heading_mm", "reconstruction_l1"] {
        assert_eq!(without[name], metrics[name], "{name}");
        assert_ne!(with[name], metrics[name], "{name}");
    }
    let refused = ["tokenizer", "guidance", "--tokenizer", &own, "--at=-1"];
    place.isoflop(&refused).exits(2).says("not a number from 0 on");
}

#[test]
fn a_detokenizer_that_reads_nothing_has_no_guidance() {
    let place = Place::with("mini.yaml");
    place.isoflop(&["tokenizer", "train", "mini.yaml"]).exits(0);
    let own = first_tokenizer(&place, "mini");
    let ended = place.isoflop(&["tokenizer", "guidance", "--tokenizer", &own]).exits(2);
    ended.says("reads no captions");
}
