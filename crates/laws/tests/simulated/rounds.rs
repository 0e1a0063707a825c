//! How many FLOPs do rounds take to reach the interval of the full grid? `docs/rounds.md` has the
//! table that this prints.

use std::path::Path;

use isoflop_laws::laws::{
    DesignGoal, FitOptions, IsoFlopPoint, MinimumMethod, OpenRun, fit, next_runs,
};
use isoflop_laws::predict::{PredictOptions, predict};
use isoflop_laws::table::{TableRequest, load, read};
use rayon::prelude::*;

use crate::truths::{ASKED, Truth};

const SWEEPS: u64 = 32;
/// The share of the grid's FLOPs that a round spends at least.
const SHARE: f64 = 0.03;

/// The interval of the loss that is predicted, and whether forecasts of the laws were tested.
struct Told {
    interval: [f64; 2],
    is_tested: bool,
}

impl Told {
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
) -> (Vec<IsoFlopPoint>, Option<Told>) {
    let (mut trained, mut left) = (Vec::new(), all.to_vec());
    let mut told: Option<Told> = None;
    while !left.is_empty()
        && told.as_ref().is_none_or(|told| !told.is_tested || told.width() > width)
    {
        let open: Vec<OpenRun> = left.iter().map(OpenRun::of).collect();
        let goal = DesignGoal { budget_flops: asked, spend_flops: SHARE * flops(all) };
        let chosen = next_runs(&trained, &open, goal);
        trained.extend(chosen.iter().map(|i| left[*i].clone()));
        let mut place = 0..;
        left.retain(|_| place.next().is_none_or(|i| !chosen.contains(&i)));
        told = Told::by(&trained, asked, seed);
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
    let full = Told::by(&all, ASKED, seed).unwrap();
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
            (0..SWEEPS).into_par_iter().map(|seed| outcome(truth, loss, seed)).collect();
        let mut shares: Vec<f64> = outcomes.iter().map(|outcome| outcome.share).collect();
        shares.sort_by(f64::total_cmp);
        let at = |share: f64| shares[(share * (shares.len() - 1) as f64).round() as usize];
        let count = |is: fn(&Outcome) -> bool| outcomes.iter().filter(|o| is(o)).count();
        println!(
            "| {truth:?} | {:.2} | {:.2} to {:.2} | {} of {SWEEPS} | {} |",
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
        let full = Told::by(&all, asked, 0).unwrap();
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
