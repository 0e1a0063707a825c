//! What a fit answers of tables that tell little, or whose truth is known.

use std::path::{Path, PathBuf};

use isoflop_laws::laws::{FitOptions, IsoFlopPoint, Laws, MinimumMethod, Parameters, fit};
use isoflop_laws::predict::{PredictOptions, predict};
use isoflop_laws::table::{TableRequest, load, read};

fn points(path: &Path, columns: &str, filter: Option<String>) -> Vec<IsoFlopPoint> {
    let filters = filter.into_iter().collect();
    let request =
        TableRequest { columns: Some(columns.to_string()), filters, ..TableRequest::default() };
    load(&read(path).unwrap(), &request).unwrap().points
}

/// 140 runs of a trainer of one's own: `fixtures/own_trainer.py` has their truth.
fn own_trainer() -> Vec<IsoFlopPoint> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/own_trainer.csv");
    points(&path, "budget_flops=budget,n_vocab=vocab", None)
}

fn fitted(points: &[IsoFlopPoint]) -> Laws {
    fit(points, &FitOptions { bootstrap: 200, ..FitOptions::default() }).unwrap()
}

#[test]
fn exponents_of_a_coarse_grid_are_those_of_the_truth() {
    let laws = fitted(&own_trainer());
    let answer = laws.answer();
    let told = &answer.exponents;
    let truths =
        [(&told.params_nonvocab, 0.561), (&told.params_vocab, 0.585), (&told.tokens, 0.430)];
    for (exponent, truth) in truths {
        let exponent = exponent.as_ref().unwrap();
        let value = exponent.value.unwrap_or_else(|| panic!("{exponent:?}"));
        let [low, high] = exponent.ci95.unwrap();
        assert!(
            (value - truth).abs() < 0.15 && low <= truth && truth <= high,
            "{exponent:?}, {truth}"
        );
    }
}

#[test]
fn two_best_runs_of_one_cell_tell_no_exponent() {
    let options = FitOptions {
        bootstrap: 0,
        law_method: Some(MinimumMethod::Argmin),
        ..FitOptions::default()
    };
    let mut runs = own_trainer();
    runs.retain(|run| run.budget_flops < 5e14);
    let laws = fit(&runs, &options).unwrap();
    let sizes = laws.minima.iter().filter(|m| m.method == MinimumMethod::Argmin);
    let mut sizes: Vec<u64> = sizes.map(|m| m.params_nonvocab as u64).collect();
    sizes.dedup();
    assert!(sizes.len() < 3, "the table should have a tie: {sizes:?}");
    assert!(laws.power_laws.params_nonvocab.is_none(), "{:?}", laws.power_laws);
    assert!(laws.recommended_law().is_joint(), "{:?}", laws.recommended_law());
    predict(&laws, 1e15, &PredictOptions::default()).unwrap();
}

#[test]
fn a_constant_loss_tells_no_exponent() {
    let mut runs = own_trainer();
    runs.iter_mut().for_each(|run| run.loss = -1.5);
    match fit(&runs, &FitOptions { bootstrap: 100, ..FitOptions::default() }) {
        Err(error) => assert!(error.is_unidentifiable(), "{error}"),
        Ok(laws) => assert!(laws.answer().exponents.is_undetermined(), "{:?}", laws.answer()),
    }
}

#[test]
fn one_vocabulary_leaves_its_exponent_untold_and_the_others_told() {
    let mut runs = own_trainer();
    runs.retain(|run| run.n_vocab == 4096.0);
    let laws = fitted(&runs);
    let own = laws.answer().exponents;
    let vocab = own.params_vocab.unwrap();
    assert_eq!(vocab.value, None);
    assert!(vocab.reason.unwrap().contains("one vocabulary"));
    assert!(own.params_nonvocab.unwrap().value.is_some());
}

#[test]
fn an_answer_survives_its_file() {
    let laws = fitted(&own_trainer());
    let file: Laws = serde_json::from_str(&serde_json::to_string(&laws).unwrap()).unwrap();
    assert!(laws.answer.is_some());
    assert_eq!(file.answer, laws.answer);
}

/// The public tables, where they are present.
fn public() -> Vec<(&'static str, Vec<IsoFlopPoint>)> {
    let shared = "../../../shared/data/runs/isoflop_collection/isoflops.csv";
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join(shared);
    if !path.exists() {
        eprintln!("skipped: {} is absent", path.display());
        return Vec::new();
    }
    let names = [
        "epochai_chinchilla__massivetext__chinchilla",
        "ml_scalefit__massivetext__chinchilla",
        "marin_202603__comma__llama_2",
    ];
    let of = |name: &'static str| {
        let filter = format!("experiment == \"{name}\"");
        (name, points(&path, "budget_flops=budget", Some(filter)))
    };
    names.map(of).to_vec()
}

#[test]
fn no_minimum_of_a_public_table_lies_far_below_its_best_run() {
    for (name, runs) in public() {
        let options =
            FitOptions { bootstrap: 0, parameters: Parameters::Total, ..FitOptions::default() };
        let laws = fit(&runs, &options).unwrap();
        for minimum in laws.minima.iter().filter(|m| laws.fitted_budgets.contains(&m.budget_flops))
        {
            if minimum.method != laws.minima_method {
                continue;
            }
            let of_budget = runs.iter().filter(|run| run.budget_flops == minimum.budget_flops);
            let best = of_budget.map(|run| run.loss).fold(f64::INFINITY, f64::min);
            assert!(best - minimum.loss_normalised < 0.02, "{name}: {minimum:?} under {best}");
        }
    }
}
