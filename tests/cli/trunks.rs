//! Sweeps whose runs share their beginnings: `schedule: {kind: wsd, share: true}`.

use std::collections::BTreeMap;

use super::support::{Place, records};

const WSD: [&str; 4] =
    ["--set", "train.schedule.kind=wsd", "--set", "grid.budgets=[1e9, 1.5e9, 2.2e9]"];
const SHARE: [&str; 2] = ["--set", "train.schedule.share=true"];

fn with<'a>(command: &'a str, settings: &[&'a str]) -> Vec<&'a str> {
    [&[command, "mini.yaml"][..], &WSD, settings].concat()
}

/// The test loss of each run, by id.
fn losses(place: &Place) -> BTreeMap<String, u64> {
    let records = records::timeless(&place.path("results/mini"));
    records
        .into_iter()
        .map(|(id, record)| (id, record.loss("loss_nats").unwrap().to_bits()))
        .collect()
}

#[test]
fn a_shared_trunk_gives_the_bits_of_runs_trained_alone() {
    // Alone, the budgets of a cell would have batches and warm-ups of their own.
    let same = ["train.batch.min=64", "train.batch.max=64", "train.schedule.warmup=0"];
    let same: Vec<&str> = same.iter().flat_map(|setting| ["--set", setting]).collect();
    let (shared, alone) = (Place::with("mini.yaml"), Place::with("mini.yaml"));
    let settings = [&SHARE[..], &same].concat();
    shared.isoflop(&with("run", &settings)).exits(0);
    alone.isoflop(&with("run", &same)).exits(0);
    assert!(!alone.path("results/mini/trunks").exists());
    assert_eq!(losses(&shared), losses(&alone));
    let plan = shared.isoflop(&[&with("plan", &settings)[..], &["--json"]].concat()).exits(0);
    let plan = plan.json();
    assert_eq!((&plan["jobs"]["trunk"], &plan["jobs"]["run"]), (&12.into(), &12.into()));
    let flops = |name: &str| plan[name].as_f64().expect("a number");
    assert!(flops("trained_flops") < 0.75 * flops("total_flops"));
}

#[test]
fn a_larger_budget_goes_on_from_the_trunks_that_are_there() {
    let place = Place::with("mini.yaml");
    let pinned = ["--set", "train.batch.min=64", "--set", "train.batch.max=64"];
    let settings = [&SHARE[..], &pinned].concat();
    place.isoflop(&with("run", &settings)).exits(0);
    let before = records::bytes(&place.path("results/mini"));
    let wider = [&settings[..], &["--set", "grid.budgets=[1e9, 1.5e9, 2.2e9, 3e9]"]].concat();
    place
        .isoflop(&with("run", &wider))
        .exits(0)
        .says("8 jobs to do, 12 of 16 runs finished or failed before");
    let after = records::bytes(&place.path("results/mini"));
    assert_eq!(after.len(), 16);
    assert!(before.iter().all(|(id, bytes)| after.get(id) == Some(bytes)));
}

#[test]
fn sharing_where_nothing_can_be_shared_is_refused() {
    let place = Place::with("mini.yaml");
    let cosine = ["--set", "train.schedule.kind=cosine"];
    let plan = ["plan", "mini.yaml", SHARE[0], SHARE[1]];
    place.isoflop(&[&plan[..], &cosine].concat()).exits(2).says("kind: wsd");
}
