//! Do predictions at ten times the largest budget hold the truth, where the truth is not of the form of
//! any law? `docs/coverage.md` has the table that this prints.

use isoflop::laws::{FitOptions, IsoFlopPoint, Laws, MinimumMethod, fit};
use isoflop::predict::{PredictOptions, Prediction, predict};
use rayon::prelude::*;

use crate::truths::{ASKED, Truth, on_test_split};

const SWEEPS: u64 = 400;
/// Where a row is told by fewer.
const FEWER: u64 = 100;

/// What sweeps are made of.
#[derive(Clone, Copy)]
struct Made<'a> {
    truth: Truth,
    shares: &'a [f64],
    /// By how much test splits differ, and whether the runs tell their parts.
    test_split: (f64, bool),
}

impl<'a> Made<'a> {
    fn of(truth: Truth) -> Self {
        Self { truth, shares: &[1.0], test_split: (0.0, false) }
    }

    fn points(&self, seed: u64) -> Vec<IsoFlopPoint> {
        let (sd, told) = self.test_split;
        let mut points = self.truth.points(self.shares, seed);
        if sd > 0.0 {
            points = on_test_split(points, sd, seed);
        }
        if !told {
            points.iter_mut().for_each(|point| point.about.by_block.clear());
        }
        points
    }
}

fn laws(made: Made, seed: u64) -> Laws {
    let methods = vec![MinimumMethod::Argmin, MinimumMethod::Parabola, MinimumMethod::Cubic];
    let options = FitOptions { methods, bootstrap: 100, seed, ..FitOptions::default() };
    fit(&made.points(seed), &options).unwrap()
}

fn prediction(laws: &Laws) -> Prediction {
    predict(laws, ASKED, &PredictOptions::default()).unwrap()
}

/// Loss and N_nv by the laws together, or by the one that says it all.
fn together(prediction: &Prediction) -> (f64, f64) {
    match &prediction.together {
        Some(all) => (all.loss_normalised, all.params_nonvocab.unwrap()),
        None => alone(prediction),
    }
}

/// The same by the recommended law.
fn alone(prediction: &Prediction) -> (f64, f64) {
    (prediction.loss_normalised.unwrap(), prediction.params_nonvocab.unwrap())
}

fn root_mean_square(misses: impl ExactSizeIterator<Item = f64>) -> f64 {
    let n = misses.len() as f64;
    (misses.map(|miss| miss * miss).sum::<f64>() / n).sqrt()
}

fn holds(interval: Option<[f64; 2]>, value: f64) -> bool {
    interval.is_some_and(|[low, high]| low <= value && value <= high)
}

/// What intervals of one truth hold.
struct Held {
    truth: Truth,
    loss: f64,
    row: String,
}

fn held(made: Made, sweeps: u64) -> Held {
    let truth = made.truth;
    let (loss, size) = truth.optimum(ASKED);
    let fitted: Vec<Laws> = (0..sweeps).into_par_iter().map(|seed| laws(made, seed)).collect();
    let all: Vec<Prediction> = fitted.iter().map(prediction).collect();
    let share = |held: &dyn Fn(&Prediction) -> bool| {
        all.iter().filter(|p| held(p)).count() as f64 / all.len() as f64
    };
    let of_clips = |p: &Prediction| p.ci95.loss_on_other_clips.or(p.ci95.loss_normalised);
    let of_loss = share(&|p| holds(of_clips(p), loss));
    let of_size = share(&|p| holds(p.ci95.params_nonvocab, size));
    let widths = all.iter().filter_map(of_clips);
    let width = widths.map(|[low, high]| high - low).sum::<f64>() / all.len() as f64;
    let mut laws: Vec<&str> = fitted.iter().map(|laws| laws.recommended_law().name()).collect();
    laws.sort_unstable();
    let counts = laws.chunk_by(|a, b| a == b).map(|same| format!("{} {}", same.len(), same[0]));
    let counts = counts.collect::<Vec<_>>().join(", ");
    let missed = |said: fn(&Prediction) -> (f64, f64)| {
        let of_loss = root_mean_square(all.iter().map(|p| said(p).0 - loss));
        let of_size = root_mean_square(all.iter().map(|p| (said(p).1 / size).ln()));
        format!("{of_loss:.4}, {of_size:.2}")
    };
    let (together, of_one) = (missed(together), missed(alone));
    let row = format!(
        "| {truth:?} | {of_loss:.3} | {of_size:.2} | {width:.3} | {together} | {of_one} | {counts} |"
    );
    Held { truth, loss: of_loss, row }
}

const HEAD: &str = "| truth | loss held | N_nv held | mean width of the loss | the laws together miss the loss, \
                    N_nv by | the recommended law alone | recommended |\n| --- | --- | --- | --- | --- | --- | --- |";

#[test]
#[ignore = "some minutes"]
fn predictions_ten_times_beyond_hold_truths_of_no_fitted_form() {
    println!("{HEAD}");
    let all = Truth::ALL.map(|truth| held(Made::of(truth), SWEEPS));
    all.iter().for_each(|held| println!("{}", held.row));
    for Held { truth, loss, .. } in all {
        assert!((truth.fewest_held()..=0.98).contains(&loss), "{truth:?}: {loss}");
    }
}

#[test]
#[ignore = "some minutes"]
fn shares_of_the_data_let_sweeps_tell_what_repetition_is_worth() {
    println!("{HEAD}");
    let repeated = Truth::ALL.into_iter().filter(|truth| truth.repeats());
    let made = |truth| Made { shares: &[0.25, 0.5, 1.0], ..Made::of(truth) };
    let all: Vec<Held> = repeated.map(|truth| held(made(truth), FEWER)).collect();
    all.iter().for_each(|held| println!("{}", held.row));
}

#[test]
#[ignore = "some minutes"]
fn intervals_hold_what_another_test_split_would_give() {
    println!("{HEAD}");
    let made = |told| Made { test_split: (0.06, told), ..Made::of(Truth::HeavyTails) };
    let [untold, told] = [false, true].map(|told| held(made(told), FEWER));
    println!("{}\n{}", untold.row, told.row);
    assert!(untold.loss < 0.9 && told.loss >= 0.92, "{} and {}", untold.loss, told.loss);
}
