//! How well the laws predict budgets that they have not seen.

use super::law_set::LawSet;
use super::types::{PowerLaw, Validation, ValidationKind};
use crate::laws::input::options::FitOptions;
use crate::laws::input::point::Parameters;
use crate::laws::minima::grid::Grid;
use crate::laws::minima::select::n_vocabularies;
use crate::laws::minima::types::Minimum;

/// Fewest budgets that laws are fitted to; the floor law needs one more.
const FEWEST: usize = 2;

/// Every fitted budget predicted from all the others, and every budget but the smallest two
/// predicted from the smaller ones.
pub(in crate::laws) fn validate(
    used: &[Minimum],
    grids: &[Grid],
    options: &FitOptions,
) -> Vec<Validation> {
    let has_vocab_law = n_vocabularies(grids) > 1;
    let error = |kind, measured: &Minimum, from: &[Minimum]| {
        let mut row = predicted(kind, measured, from, grids, options)?;
        row.params_vocab_ratio = row.params_vocab_ratio.filter(|_| has_vocab_law);
        Some(row)
    };
    let left_out = used.iter().filter_map(|measured| {
        let others = used.iter().filter(|m| m.budget_flops != measured.budget_flops);
        let others: Vec<Minimum> = others.cloned().collect();
        error(ValidationKind::LeaveOneOut, measured, &others)
    });
    let rolled = (FEWEST..used.len())
        .filter_map(|i| error(ValidationKind::RollForward, &used[i], &used[..i]));
    left_out.chain(rolled).collect()
}

/// What the laws through `from` say of a budget, against what was measured there.
fn predicted(
    kind: ValidationKind,
    measured: &Minimum,
    from: &[Minimum],
    grids: &[Grid],
    options: &FitOptions,
) -> Option<Validation> {
    if from.len() < FEWEST {
        return None;
    }
    let laws = LawSet::through(from, grids, options)?;
    let floor = laws.floor.as_ref();
    let at = measured.budget_flops;
    let ratio = |law: &PowerLaw, measured: f64| law.value_at(at) / measured;
    let size = ratio(&laws.params_nonvocab, measured.params_nonvocab);
    let is_total = options.parameters == Parameters::Total;
    Some(Validation {
        kind,
        budget_flops: measured.budget_flops,
        n_fitted: from.len(),
        log_error: laws.log.loss_at(at) - measured.loss_normalised,
        floor_error: floor.map(|law| law.loss_at(at, laws.reference) - measured.loss_normalised),
        params_ratio: is_total.then_some(size),
        params_nonvocab_ratio: (!is_total).then_some(size),
        params_vocab_ratio: laws.params_vocab.as_ref().map(|l| ratio(l, measured.params_vocab)),
        tokens_ratio: ratio(&laws.tokens, measured.tokens),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::file::laws::Laws;
    use crate::laws::fit::fit;
    use crate::laws::simulated::{SWEEP, Simulated};

    fn laws(sweep: Simulated) -> Laws {
        let options = FitOptions { bootstrap: 0, ..FitOptions::default() };
        fit(&sweep.points(), &options).unwrap()
    }

    fn of(laws: &Laws, kind: ValidationKind) -> Vec<&Validation> {
        laws.validation.iter().filter(|row| row.kind == kind).collect()
    }

    #[test]
    fn the_last_step_forward_is_the_held_out_budget() {
        let laws = laws(SWEEP);
        let rolled = of(&laws, ValidationKind::RollForward);
        let budgets: Vec<f64> = rolled.iter().map(|row| row.budget_flops).collect();
        assert_eq!(budgets, [1e16, 3e16, 1e17]);
        assert_eq!(rolled.iter().map(|row| row.n_fitted).collect::<Vec<_>>(), [2, 3, 4]);
        let last = rolled[2];
        assert_eq!(Some(last.log_error), laws.loss.log.as_ref().unwrap().held_out_error);
        assert_eq!(last.floor_error, laws.loss.floor.as_ref().unwrap().held_out_error);
        assert!(rolled[0].floor_error.is_none() && rolled[1].floor_error.is_some());
    }

    #[test]
    fn every_fitted_budget_is_left_out_once_and_predicted_well() {
        let laws = laws(SWEEP);
        let left_out = of(&laws, ValidationKind::LeaveOneOut);
        let budgets: Vec<f64> = left_out.iter().map(|row| row.budget_flops).collect();
        assert_eq!(budgets, laws.fitted_budgets);
        for row in left_out {
            assert!((row.params_nonvocab_ratio.unwrap() - 1.0).abs() < 0.05, "{row:?}");
            assert!((row.tokens_ratio - 1.0).abs() < 0.05, "{row:?}");
            assert!(row.log_error.abs() < 0.15, "{row:?}");
        }
    }

    #[test]
    fn two_budgets_leave_nothing_to_validate() {
        assert_eq!(laws(Simulated { budgets: &[1e15, 1e16], ..SWEEP }).validation, []);
    }
}
