//! Which law predicts the largest budget of runs that others made: `docs/which-law.md` has the table
//! that this prints.

use std::path::Path;

use isoflop_laws::laws::{Candidate, FitOptions, HoldOut, IsoFlopPoint, Laws, Score, fit};
use isoflop_laws::predict::{PredictOptions, predict};
use isoflop_laws::table::{self, TableRequest};

/// The public IsoFLOP sets, by the name of their experiment.
const EXPERIMENTS: [&str; 3] = [
    "epochai_chinchilla__massivetext__chinchilla",
    "ml_scalefit__massivetext__chinchilla",
    "marin_202603__comma__llama_2",
];

fn points(path: &Path, experiment: &str) -> (Vec<IsoFlopPoint>, isoflop_laws::laws::Parameters) {
    let request = TableRequest {
        columns: Some("params=params,tokens=tokens,budget_flops=budget,loss=loss".into()),
        filters: vec![format!("experiment == \"{experiment}\""), "not outlier".into()],
        ..TableRequest::default()
    };
    let loaded = table::load(&table::read(path).unwrap(), &request).unwrap();
    (loaded.points, loaded.parameters)
}

fn laws(
    points: &[IsoFlopPoint],
    parameters: isoflop_laws::laws::Parameters,
    hold_out: HoldOut,
) -> Laws {
    let options = FitOptions { parameters, hold_out, bootstrap: 0, ..FitOptions::default() };
    fit(points, &options).unwrap()
}

/// The miss at the largest budget by the law that saw all the others.
fn at_largest(score: &Score) -> f64 {
    let last = score.misses.iter().max_by_key(|miss| miss.n_fitted).unwrap();
    last.minimum.unwrap().loss.abs()
}

fn scores(laws: &Laws) -> &[Score] {
    &laws.judgement.recommended.as_ref().unwrap().scores
}

#[test]
fn the_recommended_law_predicts_the_largest_budget_of_public_runs() {
    let path = Path::new("../../../shared/data/runs/isoflop_collection/isoflops.csv");
    if !path.exists() {
        eprintln!("skipped: {} is not here", path.display());
        return;
    }
    println!("| runs | law | root mean square, nats | at the largest | recommended without it |");
    println!("| --- | --- | --- | --- | --- |");
    for experiment in EXPERIMENTS {
        let (points, parameters) = points(path, experiment);
        let all = laws(&points, parameters, HoldOut::LargestBudget);
        let largest = points.iter().map(|point| point.budget_flops).fold(0.0, f64::max);
        let smaller: Vec<IsoFlopPoint> =
            points.iter().filter(|p| p.budget_flops < 0.99 * largest).cloned().collect();
        let without = laws(&smaller, parameters, HoldOut::None);
        let blind: Candidate = without.recommended_law();
        for score in scores(&all) {
            let mark = if score.law == blind { "yes" } else { "" };
            println!(
                "| {experiment} | {} | {:.4} | {:.4} | {mark} |",
                score.law.name(),
                score.rms,
                at_largest(score)
            );
        }
        let measured = all.held_out.as_ref().unwrap().minimum.loss_normalised;
        let forecast = predict(&without, largest, &PredictOptions::default()).unwrap();
        let own = forecast.loss_normalised.unwrap();
        let together = forecast.together.map_or(own, |all| all.loss_normalised) - measured;
        println!("| {experiment} | together |  | {together:.4} |  |");
        let best = scores(&all).iter().map(at_largest).fold(f64::INFINITY, f64::min);
        let chosen = scores(&all).iter().find(|score| score.law == blind).unwrap();
        assert!(
            at_largest(chosen) <= 1.5 * best + 1e-3,
            "{experiment}: {} missed by {}, the best by {best}",
            blind.name(),
            at_largest(chosen)
        );
        let mut misses: Vec<f64> = scores(&all).iter().map(at_largest).collect();
        misses.sort_by(f64::total_cmp);
        assert!(
            together.abs() <= misses[1] + 1e-3,
            "{experiment}: the laws together missed by {together}, single ones by {misses:?}"
        );
    }
}
