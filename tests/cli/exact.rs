//! Budgets that are spent by the exact count of FLOPs.

use std::collections::HashMap;

use super::support::{Place, records};

/// What the runs of a sweep spent over what was planned for them, by the exact count.
fn spent_over_planned(sweep: &str, name: &str, settings: &[&str]) -> Vec<f64> {
    let place = Place::with(sweep);
    let exact =
        ["--set", "flops.rule=exact", "--set", "data.clips=1024", "--set", "grid.budgets=[5e9]"];
    let settings =
        [&exact[..], &["--set", "grid.vocab=[16]", "--set", "train.batch.min=32"], settings]
            .concat();
    let plan = place.isoflop(&[&["plan", sweep, "--json"][..], &settings].concat()).exits(0).json();
    let runs = plan["runs"].as_array().expect("runs").iter();
    let planned = runs.map(|run| {
        let ratio = run["achieved_ratio"].as_f64().expect("a ratio");
        (run["run_id"].as_str().expect("an id").to_string(), 5e9 * ratio)
    });
    let planned: HashMap<String, f64> = planned.collect();
    place.isoflop(&[&["run", sweep][..], &settings].concat()).exits(0);
    let results = place.path(&format!("results/{name}"));
    let ids = records::column(&results, "run_id");
    let spent = records::column(&results, "flops_exact");
    let spent = spent.iter().map(|flops| flops.parse::<f64>().expect("a number"));
    ids.iter().zip(spent).map(|(id, flops)| flops / planned[id]).collect()
}

fn met_within_a_hundredth(ratios: &[f64]) {
    assert!(
        ratios.len() >= 2 && ratios.iter().all(|ratio| (ratio - 1.0).abs() < 0.01),
        "{ratios:?}"
    );
}

#[test]
fn a_budget_by_the_exact_count_is_met_on_clips_of_their_own_lengths() {
    met_within_a_hundredth(&spent_over_planned("mini.yaml", "mini", &[]));
}

#[test]
fn it_is_met_by_every_kind_of_generator() {
    let kinds = "generator=[masked]";
    met_within_a_hundredth(&spent_over_planned("mini.yaml", "mini", &["--set", kinds]));
    met_within_a_hundredth(&spent_over_planned("residual.yaml", "residual", &["--set", kinds]));
    met_within_a_hundredth(&spent_over_planned("generators.yaml", "generators", &[]));
}

#[test]
fn it_is_met_where_runs_share_their_beginnings() {
    let schedule = ["--set", "train.schedule={kind: wsd, share: true}"];
    met_within_a_hundredth(&spent_over_planned("mini.yaml", "mini", &schedule));
}
