//! Do predictions at ten times the largest budget hold the truth, where the truth is not of the form of
//! any law? `docs/coverage.md` has the table that this prints.

use isoflop::laws::{Candidate, FitOptions, Laws, MinimumMethod, fit};
use isoflop::predict::{PredictOptions, Prediction, predict};
use rayon::prelude::*;

use crate::truths::{ASKED, Truth};

const SWEEPS: u64 = 40;

fn laws(truth: Truth, seed: u64) -> Laws {
    let methods = vec![MinimumMethod::Argmin, MinimumMethod::Parabola, MinimumMethod::Cubic];
    let options = FitOptions { methods, bootstrap: 100, seed, ..FitOptions::default() };
    fit(&truth.points(seed), &options).unwrap()
}

fn prediction(laws: &Laws) -> Prediction {
    predict(laws, ASKED, &PredictOptions::default()).unwrap()
}

/// What the recommended law says of the loss by itself.
fn alone(prediction: &Prediction) -> f64 {
    let raw = prediction.raw;
    let loss = match prediction.recommended.unwrap() {
        Candidate::Log => raw.loss_log,
        Candidate::Floor => raw.loss_floor,
        Candidate::Joint | Candidate::JointRepeats => raw.loss_joint,
    };
    loss.unwrap()
}

fn root_mean_square(misses: impl ExactSizeIterator<Item = f64>) -> f64 {
    let n = misses.len() as f64;
    (misses.map(|miss| miss * miss).sum::<f64>() / n).sqrt()
}

fn holds(interval: Option<[f64; 2]>, value: f64) -> bool {
    interval.is_some_and(|[low, high]| low <= value && value <= high)
}

#[test]
#[ignore = "some minutes"]
fn predictions_ten_times_beyond_hold_truths_of_no_fitted_form() {
    println!(
        "| truth | loss held | N_nv held | mean width of the loss | the laws together miss the loss, N_nv by \
         | the recommended law alone | recommended |"
    );
    println!("| --- | --- | --- | --- | --- | --- | --- |");
    for truth in Truth::ALL {
        let (loss, size) = truth.optimum(ASKED);
        let fitted: Vec<Laws> = (0..SWEEPS).into_par_iter().map(|seed| laws(truth, seed)).collect();
        let all: Vec<Prediction> = fitted.iter().map(prediction).collect();
        let share = |held: &dyn Fn(&Prediction) -> bool| {
            all.iter().filter(|p| held(p)).count() as f64 / all.len() as f64
        };
        let of_loss = share(&|p| holds(p.ci95.loss_normalised, loss));
        let of_size = share(&|p| holds(p.ci95.params_nonvocab, size));
        let widths = all.iter().filter_map(|p| p.ci95.loss_normalised);
        let width = widths.map(|[low, high]| high - low).sum::<f64>() / all.len() as f64;
        let mut laws: Vec<&str> = fitted.iter().map(|laws| laws.recommended_law().name()).collect();
        laws.sort_unstable();
        let counts = laws.chunk_by(|a, b| a == b).map(|same| format!("{} {}", same.len(), same[0]));
        let counts = counts.collect::<Vec<_>>().join(", ");
        let size_of = |p: &Prediction| p.params_nonvocab.unwrap() / size;
        let together = root_mean_square(all.iter().map(|p| p.loss_normalised.unwrap() - loss));
        let size_together = root_mean_square(all.iter().map(|p| size_of(p).ln()));
        let of_one = root_mean_square(all.iter().map(|p| alone(p) - loss));
        let own_size = |p: &Prediction| p.raw.params_nonvocab.unwrap() / size;
        let size_of_one = root_mean_square(all.iter().map(|p| own_size(p).ln()));
        println!(
            "| {truth:?} | {of_loss:.2} | {of_size:.2} | {width:.3} | {together:.4}, {size_together:.2} \
             | {of_one:.4}, {size_of_one:.2} | {counts} |"
        );
        assert!(of_loss >= 0.92, "{truth:?}: {of_loss}");
    }
}
