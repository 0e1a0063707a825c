//! What became of forecasts that runs have tested.

use crate::laws::Validated;
use crate::laws::text::count;

/// A sentence for each forecast with something outside its interval, and one for those that held.
pub(super) fn sentences(validations: &[Validated]) -> Vec<String> {
    let (held, missed): (Vec<_>, Vec<_>) =
        validations.iter().partition(|one| one.inside.is_whole());
    let held: Vec<&Validated> = held.into_iter().filter(|one| one.sentence().is_some()).collect();
    let missed = missed.into_iter().filter_map(Validated::sentence);
    match &held[..] {
        [] => missed.collect(),
        [one] => missed.chain(one.sentence()).collect(),
        several => missed.chain([together(several)]).collect(),
    }
}

fn together(held: &[&Validated]) -> String {
    let told = held.iter().filter_map(|one| {
        let [low, high] = one.predicted.loss_ci95?;
        let budget = count(one.budget_flops);
        Some(format!("{:.3} ({low:.3} to {high:.3}) at {budget}", one.measured.loss))
    });
    let told: Vec<String> = told.collect();
    format!("{} forecasts held, L_u measured (95 % forecast): {}.", held.len(), told.join(", "))
}
