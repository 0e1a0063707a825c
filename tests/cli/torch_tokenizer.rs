//! Tokenizers that the trainer in PyTorch trains, in a sweep.

use serde_json::Value;

use super::support::Place;
use super::torch;

const TORCH: [&str; 2] = ["--set", "tokenizer.trainer=torch"];

/// The tokenizers of a sweep of this name, by their vocabularies.
fn tokenizers(place: &Place, name: &str) -> Vec<Value> {
    let results = format!("results/{name}");
    let document = place.isoflop(&["tokenizer", "eval", &results, "--json"]).exits(0).json();
    let mut found = document["tokenizers"].as_array().expect("a list").clone();
    found.sort_by_key(|tokenizer| tokenizer["n_vocab"].as_u64());
    found
}

#[test]
fn a_sweep_with_tokenizers_of_pytorch_is_that_of_the_built_in_ones() {
    let Some(python) = torch::python() else { return };
    let place = Place::with("mini.yaml");
    let run = ["run", "mini.yaml", "--set", "tokenizer.kind=vq"];
    place.isoflop(&[&run[..], &["--set", "name=own"]].concat()).exits(0);
    let mut program = place.program(&[&run[..], &TORCH].concat());
    let ended =
        torch::with_package(program.env("ISOFLOP_PYTHON", python)).output().expect("started");
    assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stderr));
    let (own, torch) = (tokenizers(&place, "own"), tokenizers(&place, "mini"));
    assert_eq!((own.len(), torch.len()), (2, 2));
    for (own, torch) in own.iter().zip(&torch) {
        assert_ne!(own["tokenizer_id"], torch["tokenizer_id"]);
        for name in ["mpjpe_mm", "val_mpjpe_mm", "reconstruction_l1", "kmeans_mpjpe_mm"] {
            let [a, b] = [own, torch].map(|of| of[name].as_f64().expect("a number"));
            assert!((a - b).abs() < 1e-3 * a, "{name}: {a} and {b}");
        }
    }
}

#[test]
fn a_tokenizer_that_pytorch_cannot_train_is_a_problem_of_the_sweep() {
    let place = Place::with("mini.yaml");
    let patch = ["plan", "mini.yaml", "--set", "tokenizer={kind: patch, trainer: torch}"];
    place.isoflop(&patch).exits(2).says("`torch` trains no patches");
    let plateau = ["plan", "mini.yaml", "--set", "tokenizer.plateau={evaluations: 2}"];
    place.isoflop(&[&plateau[..], &TORCH].concat()).exits(2).says("leave tokenizer.plateau out");
}

#[test]
fn a_missing_interpreter_is_told() {
    let place = Place::with("mini.yaml");
    let mut program = place.program(&[&["tokenizer", "train", "mini.yaml"][..], &TORCH].concat());
    let ended = program.env("ISOFLOP_PYTHON", "/nowhere/python3").output().expect("started");
    let said = String::from_utf8_lossy(&ended.stderr);
    assert_eq!(ended.status.code(), Some(1), "{said}");
    assert!(said.contains("the trainer `/nowhere/python3` cannot be started"), "{said}");
}
