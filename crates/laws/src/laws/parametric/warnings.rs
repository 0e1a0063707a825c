//! The sentences that a parametric fit owes its reader.

use super::bootstrap::Replicates;
use super::form::Coefficients;
use super::influence::Influence;
use super::search::{Found, Target};

/// Share of starts at the optimum below which a second optimum may have been missed.
const FEW_STARTS: f64 = 0.1;
/// Rows for each coefficient below which a bootstrap understates.
const ENOUGH_ROWS: usize = 6;
/// Rows for each coefficient below which a law follows single rows.
const LEAST_ROWS: usize = 3;
/// Share of the mean loss below which a term counts as absent.
const ABSENT: f64 = 1e-4;

pub(super) fn of(
    target: &Target,
    found: &Found,
    coefficients: &Coefficients,
    replicates: &Replicates,
    influence: Option<&Influence>,
) -> Vec<String> {
    let mut sentences = Vec::new();
    sentences.extend(terms(target, coefficients));
    sentences.extend(starts(found));
    sentences.extend(unfinished(replicates));
    sentences.extend(few_rows(target, replicates));
    let size = target.form.quantities()[0];
    sentences.extend(influence.map(|influence| influence.sentence(size)));
    sentences
}

fn terms(target: &Target, coefficients: &Coefficients) -> Vec<String> {
    let form = target.form;
    let losses = &target.data.losses;
    let typical = losses.iter().map(|l| l.abs()).sum::<f64>() / losses.len() as f64;
    let mut sentences = Vec::new();
    for (term, quantity) in form.quantities().iter().enumerate() {
        let exponent = coefficients.exponent(term);
        let size = coefficients.coefficient(term) * (-exponent * target.data.means[term]).exp();
        if size < ABSENT * typical {
            sentences.push(format!(
                "The term of {quantity} is not identified: the best fit does without it, so its \
                 exponent means nothing."
            ));
        } else if target.bounds.contains(&exponent) {
            sentences.push(format!(
                "The exponent of {quantity} is not identified: it runs into its bound {exponent}, \
                 where it is held."
            ));
        }
    }
    if coefficients.floor().abs() < ABSENT * typical {
        sentences.push("The floor E is not identified: the best fit has none.".into());
    }
    sentences
}

fn starts(found: &Found) -> Option<String> {
    let share = found.starts_at_optimum as f64 / found.starts as f64;
    (share < FEW_STARTS).then(|| {
        format!(
            "Only {} of {} starts reach the best optimum found: there may be a better one.",
            found.starts_at_optimum, found.starts
        )
    })
}

fn few_rows(target: &Target, replicates: &Replicates) -> Option<String> {
    let (rows, coefficients) = (target.data.columns.n, target.form.n_params());
    if rows < LEAST_ROWS * coefficients {
        return Some(format!(
            "{rows} rows are fewer than {LEAST_ROWS} times the {coefficients} coefficients: the law \
             follows single rows, and its intervals are too narrow. Add runs."
        ));
    }
    (replicates.asked > 0 && rows < ENOUGH_ROWS * coefficients).then(|| {
        format!(
            "{rows} rows are few for {coefficients} coefficients: drawing among so few makes \
             intervals too narrow."
        )
    })
}

fn unfinished(replicates: &Replicates) -> Option<String> {
    let missing = replicates.asked - replicates.converged;
    (missing > 0).then(|| {
        format!(
            "{missing} of {} bootstrap replicates did not reach an optimum of their own.",
            replicates.asked
        )
    })
}
