//! What became of forecasts that runs have tested.

use crate::laws::file::validated::Validated;
use crate::laws::words::text::count;

/// One sentence for the forecasts that held.
pub(super) fn held(validations: &[Validated]) -> Option<String> {
    let held = validations.iter().filter(|one| one.inside.is_whole() && one.sentence().is_some());
    match &held.collect::<Vec<_>>()[..] {
        [] => None,
        [one] => one.sentence(),
        several => Some(together(several)),
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
