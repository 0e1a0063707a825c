//! `isoflop tokenizer`: training without runs, and the comparison with k-means.

use std::fs;

use super::support::Place;

#[test]
fn tokenizers_are_trained_alone_compared_and_not_trained_again_by_run() {
    let place = Place::with("mini.yaml");
    let words = ["tokenizer", "train", "mini.yaml"];
    let patches = ["--set", "tokenizer={kind: patch, width: 8, steps: 3, batch: 2, pool_clips: 8}"];
    let train = [&words[..], &patches].concat();
    let ended = place.isoflop(&train).exits(0).says("0 of 8 runs have ended already");
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
