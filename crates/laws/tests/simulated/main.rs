//! Tests of intervals and of rounds on simulated sweeps. Minutes each, so not by default:
//!
//! `cargo test --release -p isoflop-laws --test simulated -- --ignored --nocapture`

mod truths;

use std::path::Path;

use isoflop_laws::laws::{
    DesignGoal, FitOptions, IsoFlopPoint, Laws, MinimumMethod, OpenRun, fit, next_runs,
};
use isoflop_laws::predict::{PredictOptions, Prediction, predict};
use isoflop_laws::table::{TableRequest, load, read};
use rayon::prelude::*;

use truths::{ASKED, Truth, on_test_split};

// Do predictions at ten times the largest budget hold the truth, where the truth is not of the form of
// any law? `docs/coverage.md` has the table that this prints.

const SWEEPS: u64 = 200;
/// Where a row is told by fewer.
const FEWER: u64 = 100;

/// The settings of sweeps.
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
    let told = predict(laws, ASKED, &PredictOptions::default());
    told.unwrap_or_else(|error| panic!("{error}: {:?}", laws.answer()))
}

fn root_mean_square(misses: impl ExactSizeIterator<Item = f64>) -> f64 {
    let n = misses.len() as f64;
    (misses.map(|miss| miss * miss).sum::<f64>() / n).sqrt()
}

fn holds(interval: Option<[f64; 2]>, value: f64) -> bool {
    interval.is_some_and(|[low, high]| low <= value && value <= high)
}

/// An estimate and its interval.
type Told = (f64, Option<[f64; 2]>);

/// What intervals of one quantity of one truth hold.
struct Held {
    share: f64,
    /// Mean half width over 1.96 root mean squares of what the estimate misses the truth by.
    width: f64,
    /// The root mean square of these misses.
    missed: f64,
}

impl Held {
    /// Of estimates with their intervals; one without an interval holds nothing.
    fn of(told: &[Told], truth: f64) -> Self {
        let n = told.len() as f64;
        let missed = root_mean_square(told.iter().map(|(value, _)| value - truth));
        let widths = told.iter().filter_map(|(_, interval)| *interval);
        let widths: Vec<f64> = widths.map(|[low, high]| (high - low) / 2.0).collect();
        let mean = widths.iter().sum::<f64>() / widths.len() as f64;
        let held = told.iter().filter(|(_, interval)| holds(*interval, truth)).count();
        Self { share: held as f64 / n, width: mean / (1.96 * missed), missed }
    }
}

impl std::fmt::Display for Held {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:.3}, {:.1} ({:.3})", self.share, self.width, self.missed)
    }
}

/// What intervals of one truth hold.
struct Row {
    truth: Truth,
    loss: Held,
    exponents: [Held; 3],
    text: String,
}

fn held(made: Made, sweeps: u64) -> Row {
    let truth = made.truth;
    let (loss, size) = truth.optimum(ASKED);
    let fitted: Vec<Laws> = (0..sweeps).into_par_iter().map(|seed| laws(made, seed)).collect();
    let all: Vec<Prediction> = fitted.iter().map(prediction).collect();
    let of = |told: fn(&Prediction) -> Told, truth: f64| {
        Held::of(&all.iter().map(told).collect::<Vec<_>>(), truth)
    };
    let loss_told = |p: &Prediction| {
        (p.loss_normalised.unwrap(), p.ci95.loss_on_other_clips.or(p.ci95.loss_normalised))
    };
    let size_told = |p: &Prediction| {
        let interval = p.ci95.at.params_nonvocab.map(|ends| ends.map(f64::ln));
        (p.at.params_nonvocab.unwrap().ln(), interval)
    };
    let (of_loss, of_size) = (of(loss_told, loss), of(size_told, size.ln()));
    let true_exponents = truth.exponents();
    let exponents: [Held; 3] = std::array::from_fn(|i| {
        let told = |laws: &Laws| {
            let own = laws.answer().exponents;
            let own = [own.params_nonvocab, own.params_vocab, own.tokens][i].clone()?;
            Some((own.value?, own.ci95))
        };
        let told: Vec<_> = fitted.iter().filter_map(told).collect();
        Held::of(&told, true_exponents[i])
    });
    let mut laws: Vec<&str> = fitted.iter().map(|laws| laws.recommended_law().name()).collect();
    laws.sort_unstable();
    let counts = laws.chunk_by(|a, b| a == b).map(|same| format!("{} {}", same.len(), same[0]));
    let counts = counts.collect::<Vec<_>>().join(", ");
    let [n, v, d] = &exponents;
    let text = format!("| {truth:?} | {of_loss} | {of_size} | {n} | {v} | {d} | {counts} |");
    Row { truth, loss: of_loss, exponents, text }
}

const HEAD: &str = "| truth | L_u at 10 times | ln N_nv at 10 times | exponent of N_nv | of N_v | of D | \
                    recommended |\n| --- | --- | --- | --- | --- | --- | --- |";

#[test]
#[ignore = "some minutes"]
fn predictions_ten_times_beyond_hold_truths_of_no_fitted_form() {
    println!("{HEAD}");
    let all = Truth::ALL.map(|truth| held(Made::of(truth), SWEEPS));
    all.iter().for_each(|held| println!("{}", held.text));
    for Row { truth, loss, exponents, .. } in all {
        let fewest = truth.fewest_held();
        assert!((fewest..=1.0).contains(&loss.share), "{truth:?}: {loss}");
        for exponent in exponents.iter().filter(|_| truth.tells_exponents()) {
            assert!((0.92..=1.0).contains(&exponent.share), "{truth:?}: {exponent}");
        }
    }
}

#[test]
#[ignore = "some minutes"]
fn shares_of_the_data_let_sweeps_tell_what_repetition_is_worth() {
    println!("{HEAD}");
    let repeated = Truth::ALL.into_iter().filter(|truth| truth.repeats());
    let made = |truth| Made { shares: &[0.25, 0.5, 1.0], ..Made::of(truth) };
    let all: Vec<Row> = repeated.map(|truth| held(made(truth), FEWER)).collect();
    all.iter().for_each(|held| println!("{}", held.text));
}

#[test]
#[ignore = "some minutes"]
fn intervals_hold_what_another_test_split_would_give() {
    println!("{HEAD}");
    let made = |told| Made { test_split: (0.06, told), ..Made::of(Truth::HeavyTails) };
    let [untold, told] = [false, true].map(|told| held(made(told), FEWER));
    println!("{}\n{}", untold.text, told.text);
    assert!(
        untold.loss.share < 0.9 && told.loss.share >= 0.92,
        "{} and {}",
        untold.loss,
        told.loss
    );
}

// How many FLOPs do rounds take to reach the interval of the full grid? `docs/rounds.md` has the
// table that this prints.

const SWEEPS_OF_ROUNDS: u64 = 32;
/// The share of the grid's FLOPs that a round spends at least.
const SHARE: f64 = 0.03;

/// The interval of the loss that is predicted, and whether forecasts of the laws were tested.
struct Forecast {
    interval: [f64; 2],
    is_tested: bool,
}

impl Forecast {
    fn by(points: &[IsoFlopPoint], asked: f64, seed: u64) -> Option<Self> {
        let methods = vec![MinimumMethod::Argmin, MinimumMethod::Parabola, MinimumMethod::Cubic];
        let options = FitOptions { methods, bootstrap: 100, seed, ..FitOptions::default() };
        let laws = fit(points, &options).ok()?;
        let prediction = predict(&laws, asked, &PredictOptions::default()).ok()?;
        let is_tested = laws.judgement.forecast_error.is_some_and(|error| error.tested > 0);
        Some(Self { interval: prediction.ci95.loss_normalised?, is_tested })
    }

    fn width(&self) -> f64 {
        self.interval[1] - self.interval[0]
    }

    fn holds(&self, loss: f64) -> bool {
        self.interval[0] <= loss && loss <= self.interval[1]
    }
}

fn flops(points: &[IsoFlopPoint]) -> f64 {
    points.iter().map(|point| point.flops).sum()
}

/// The points that are trained until the interval is as narrow as that of all of them.
fn until(
    all: &[IsoFlopPoint],
    asked: f64,
    width: f64,
    seed: u64,
) -> (Vec<IsoFlopPoint>, Option<Forecast>) {
    let (mut trained, mut left) = (Vec::new(), all.to_vec());
    let mut told: Option<Forecast> = None;
    while !left.is_empty()
        && told.as_ref().is_none_or(|told| !told.is_tested || told.width() > width)
    {
        let open: Vec<OpenRun> = left.iter().map(OpenRun::of).collect();
        let goal = DesignGoal { budget_flops: asked, spend_flops: SHARE * flops(all) };
        let chosen = next_runs(&trained, &open, goal);
        trained.extend(chosen.iter().map(|i| left[*i].clone()));
        let mut place = 0..;
        left.retain(|_| place.next().is_none_or(|i| !chosen.contains(&i)));
        told = Forecast::by(&trained, asked, seed);
    }
    (trained, told)
}

struct Outcome {
    share: f64,
    held: bool,
    held_by_grid: bool,
}

fn outcome(truth: Truth, loss: f64, seed: u64) -> Outcome {
    let all = truth.points(&[1.0], seed);
    let full = Forecast::by(&all, ASKED, seed).unwrap();
    let (trained, told) = until(&all, ASKED, full.width(), seed);
    Outcome {
        share: flops(&trained) / flops(&all),
        held: told.is_some_and(|told| told.holds(loss)),
        held_by_grid: full.holds(loss),
    }
}

#[test]
#[ignore = "a minute"]
fn rounds_reach_the_interval_of_the_grid_with_half_its_flops() {
    println!("| truth | FLOPs, median | quartiles | held by rounds | by the grid |");
    println!("| --- | --- | --- | --- | --- |");
    let mut medians = Vec::new();
    for truth in Truth::HELD {
        let (loss, _) = truth.optimum(ASKED);
        let outcomes: Vec<Outcome> =
            (0..SWEEPS_OF_ROUNDS).into_par_iter().map(|seed| outcome(truth, loss, seed)).collect();
        let mut shares: Vec<f64> = outcomes.iter().map(|outcome| outcome.share).collect();
        shares.sort_by(f64::total_cmp);
        let at = |share: f64| shares[(share * (shares.len() - 1) as f64).round() as usize];
        let count = |is: fn(&Outcome) -> bool| outcomes.iter().filter(|o| is(o)).count();
        println!(
            "| {truth:?} | {:.2} | {:.2} to {:.2} | {} of {SWEEPS_OF_ROUNDS} | {} |",
            at(0.5),
            at(0.25),
            at(0.75),
            count(|outcome| outcome.held),
            count(|outcome| outcome.held_by_grid),
        );
        medians.push((truth, at(0.5)));
    }
    for (truth, median) in medians {
        assert!(median <= 0.5, "{truth:?}: {median}");
    }
}

/// The trained studies: the budget that is predicted is ten times their largest.
const STUDIES: [&str; 4] = ["procedural-law", "two-frames", "own-frames", "two-frames-fixed"];

#[test]
#[ignore = "some seconds"]
fn rounds_of_trained_runs_reach_the_interval_of_most_grids_with_half_their_flops() {
    println!("| study | FLOPs | L_u by rounds | L_u by the grid |");
    println!("| --- | --- | --- | --- |");
    let share = |study: &&str| {
        let runs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../results").join(study);
        let columns = Some("loss=loss_normalised".to_string());
        let request = TableRequest { columns, ..TableRequest::default() };
        let all = load(&read(&runs.join("runs.csv")).unwrap(), &request).unwrap().points;
        let asked = 10.0 * all.iter().map(|point| point.budget_flops).fold(0.0, f64::max);
        let full = Forecast::by(&all, asked, 0).unwrap();
        let (trained, told) = until(&all, asked, full.width(), 0);
        let share = flops(&trained) / flops(&all);
        let [low, high] = told.unwrap().interval;
        let [grid_low, grid_high] = full.interval;
        println!(
            "| {study} | {share:.2} | {low:.3} to {high:.3} | {grid_low:.3} to {grid_high:.3} |"
        );
        share
    };
    let mut shares: Vec<f64> = STUDIES.iter().map(share).collect();
    shares.sort_by(f64::total_cmp);
    assert!(shares[STUDIES.len() / 2] <= 0.5, "{shares:?}");
}
