//! What follows from the quantities given.
//!
//! | quantity | where it is not given | unit |
//! | --- | --- | --- |
//! | N_v | V·d, else N − N_nv | parameters |
//! | V | N_v/d; N_v where d is unknown | codes |
//! | N_nv | N − N_v | parameters |
//! | D | C/(6 N), C being the declared budget | tokens |
//! | C | 6 N D | FLOPs |
//! | FLOPs spent | 6 N D | FLOPs |
//! | seed, weight | 0, 1 | |
//! | share of the data, distinct tokens | not known | , tokens |
//!
//! N = N_nv + N_v. Where only N is given it stands in the place of N_nv, and N_v and V are 0.
//! 6 N D counts the multiplications and additions of one forward and one backward pass (Kaplan et
//! al. 2020, without attention).

use super::columns::Named;
use super::model::{model_sizes, zip};
use super::{Quantity, Table, TableError};
use crate::laws::{Metric, Parameters};

/// Budgets beyond this factor of 6 N D are a slip of the unit rather than another FLOP rule.
const LIKELY_SLIP: f64 = 3.0;
/// Every quantity of a point, a value a row; NaN where something it follows from is missing.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Derived {
    pub parameters: Parameters,
    pub budget_declared: bool,
    /// The column or expression that gives the loss.
    pub metric: Metric,
    /// N_nv is under the name of N if that is all that is known.
    pub columns: Vec<(Quantity, Vec<f64>)>,
    pub notes: Vec<String>,
    /// Sentences on what is likely wrong with all rows.
    pub doubts: Vec<String>,
}

/// Fills in what is not given; `table` is named in errors.
pub(super) fn derive(named: &Named, table: &Table) -> Result<Derived, TableError> {
    let n_rows = named.run_ids.len();
    let missing = |what, remedy| TableError::Missing { what, remedy, columns: table.listed() };
    let given = |quantity| named.numbers.get(&quantity).map(Vec::as_slice);
    let loss = given(Quantity::Loss).ok_or_else(|| missing("loss", "`loss`"))?;
    let (mut notes, mut doubts) = (Vec::new(), Vec::new());
    let model = model_sizes(named, &mut notes).map_err(|(what, remedy)| missing(what, remedy))?;
    let params = zip(&model.nonvocab, &model.vocab, |a, b| a + b);
    let (budget, tokens) = (given(Quantity::BudgetFlops), given(Quantity::Tokens));
    let (budget_flops, tokens) = match (budget, tokens) {
        (Some(c), Some(d)) => (c.to_vec(), d.to_vec()),
        (Some(c), None) => (c.to_vec(), zip(c, &params, |c, n| c / (6.0 * n))),
        (None, Some(d)) => (flops_6nd(&params, d), d.to_vec()),
        (None, None) => return Err(missing("tokens", "`tokens`, or `budget_flops`,")),
    };
    if budget.is_some() && given(Quantity::Tokens).is_some() {
        doubts.extend(unit_slip(&budget_flops, &flops_6nd(&params, &tokens)));
    }
    let all =
        |quantity, otherwise| given(quantity).map_or(vec![otherwise; n_rows], <[f64]>::to_vec);
    let flops = given(Quantity::Flops).map_or_else(|| flops_6nd(&params, &tokens), <[f64]>::to_vec);
    Ok(Derived {
        parameters: model.parameters,
        budget_declared: budget.is_some(),
        metric: named.sources.get(&Quantity::Loss).map_or_else(Metric::default, |m| Metric::new(m)),
        columns: vec![
            (Quantity::Loss, loss.to_vec()),
            (size(model.parameters), model.nonvocab),
            (Quantity::ParamsVocab, model.vocab),
            (Quantity::NVocab, model.n_vocab),
            (Quantity::Tokens, tokens),
            (Quantity::BudgetFlops, budget_flops),
            (Quantity::Flops, flops),
            (Quantity::Seed, all(Quantity::Seed, 0.0)),
            (Quantity::Weight, all(Quantity::Weight, 1.0)),
            (Quantity::Share, all(Quantity::Share, f64::NAN)),
            (Quantity::UniqueTokens, known(all(Quantity::UniqueTokens, f64::NAN))),
        ],
        notes,
        doubts,
    })
}

/// What a model's size is called.
pub(super) fn size(parameters: Parameters) -> Quantity {
    match parameters {
        Parameters::Split => Quantity::ParamsNonvocab,
        Parameters::Total => Quantity::Params,
    }
}

/// 0 is what a trainer writes that does not know.
fn known(mut values: Vec<f64>) -> Vec<f64> {
    values.iter_mut().filter(|value| **value == 0.0).for_each(|value| *value = f64::NAN);
    values
}

fn flops_6nd(params: &[f64], tokens: &[f64]) -> Vec<f64> {
    zip(params, tokens, |n, d| 6.0 * n * d)
}

/// A note where budgets and 6 N D differ by more than any FLOP rule explains.
fn unit_slip(budgets: &[f64], flops: &[f64]) -> Option<String> {
    let mut ratios: Vec<f64> =
        zip(budgets, flops, |c, f| c / f).into_iter().filter(|r| r.is_finite()).collect();
    ratios.sort_by(f64::total_cmp);
    let median = *ratios.get(ratios.len() / 2)?;
    let likely = !(1.0 / LIKELY_SLIP..=LIKELY_SLIP).contains(&median);
    likely.then(|| {
        format!(
            "budget_flops is {median:.3e} times 6 N D (median): check the units of params, tokens \
             and budget_flops, and scale them in --columns, as in params=millions*1e6"
        )
    })
}

#[cfg(test)]
mod tests;
