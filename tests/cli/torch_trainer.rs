//! ScaMo's transformer in PyTorch reaches the losses of the built-in one; where torch is installed.

use std::path::Path;
use std::process::Command;

use super::support::{Place, records};

/// Standard errors of the difference within which two means of three seeds are alike.
const WITHIN: f64 = 4.0;
/// Deviation of a seed that is taken at least: three seeds may agree by chance.
const LEAST: f64 = 0.01;

fn has_torch() -> bool {
    let asked = Command::new("python3").args(["-c", "import torch, numpy"]).output();
    asked.is_ok_and(|ended| ended.status.success())
}

fn losses(place: &Place, name: &str) -> Vec<f64> {
    let column = records::column(&place.path(&format!("results/{name}")), "loss_normalised");
    column.iter().map(|loss| loss.parse().expect("a number")).collect()
}

fn mean_and_variance(losses: &[f64]) -> (f64, f64) {
    let n = losses.len() as f64;
    let mean = losses.iter().sum::<f64>() / n;
    (mean, losses.iter().map(|loss| (loss - mean).powi(2)).sum::<f64>() / (n - 1.0))
}

#[test]
fn pytorch_reaches_the_losses_of_the_built_in_trainer() {
    if !has_torch() {
        eprintln!("skipped: python3 has no torch");
        return;
    }
    let place = Place::new();
    std::fs::create_dir(place.path("experiments")).expect("a writable directory");
    for file in ["torch_trainer.py", "torch-trainer.yaml"] {
        let from = Path::new(env!("CARGO_MANIFEST_DIR")).join("experiments").join(file);
        std::fs::copy(from, place.path("experiments").join(file)).expect("the example is there");
    }
    let small = ["seeds=[0, 1, 2]", "grid.models=[{n_layer: 2, n_head: 2, d_model: 16}]"];
    let small = [&small[..], &["grid.budgets=[1e10]", "data.clips=1024"]].concat();
    let mut run = vec!["run", "experiments/torch-trainer.yaml"];
    small.iter().for_each(|setting| run.extend(["--set", setting]));
    place.isoflop(&run).exits(0);
    place.isoflop(&[&run[..], &["--set", "trainer=null", "--set", "name=own"]].concat()).exits(0);
    let (torch, own) = (losses(&place, "torch-trainer"), losses(&place, "own"));
    assert_eq!((torch.len(), own.len()), (3, 3));
    let ((a, var_a), (b, var_b)) = (mean_and_variance(&torch), mean_and_variance(&own));
    let error = ((var_a + var_b) / 2.0).sqrt().max(LEAST) * (2.0f64 / 3.0).sqrt();
    assert!((a - b).abs() < WITHIN * error, "{torch:?} and {own:?}");
}
