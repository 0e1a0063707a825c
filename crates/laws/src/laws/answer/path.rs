//! The optimum along the fitted budgets, by the law to believe.

use crate::laws::file::answer::{Coefficient, OptimumAt};
use crate::laws::file::kind::LawKind;
use crate::laws::file::laws::Laws;
use crate::laws::input::quantities::PerQuantity;
use crate::laws::joint::law::JointLaw;
use crate::laws::lines::sample::LawSample;
use crate::laws::lines::types::PowerLaw;
use crate::laws::maths::stats::interval95;
use crate::laws::minima::types::Optimum;
use crate::laws::ranking::recommended::Candidate;

/// Budgets at which the optimum is told.
const STEPS: usize = 13;

/// From the smallest to the largest fitted budget in equal steps of ln C; empty for a law that was not
/// fitted here.
pub(super) fn of(laws: &Laws) -> Vec<OptimumAt> {
    let [low, high] = laws.range();
    if laws.law == LawKind::Published || low >= high {
        return Vec::new();
    }
    let at = |i: usize| low * (high / low).powf(i as f64 / (STEPS - 1) as f64);
    let budgets: [f64; STEPS] = std::array::from_fn(at);
    match laws.joint_law() {
        Some(joint) => of_joint(laws, joint, budgets),
        None => budgets.iter().map(|budget| of_lines(laws, *budget)).collect(),
    }
}

fn of_joint(laws: &Laws, joint: &JointLaw, budgets: [f64; STEPS]) -> Vec<OptimumAt> {
    let replicates = joint.optima_at(budgets);
    let told = |i: usize, budget: f64| {
        let own = joint.optimum(budget);
        let all: Vec<Optimum> = replicates.iter().filter_map(|ends| ends[i]).collect();
        let told = |of: fn(&Optimum) -> f64| {
            let value = of(own.as_ref()?);
            let ci95 = interval95(all.iter().map(of));
            value.is_finite().then_some(Coefficient { value, ci95 })
        };
        let loss = own
            .as_ref()
            .map(|own| Coefficient { value: own.loss, ci95: interval95(joint.losses_at(own)) });
        let at = PerQuantity {
            params_nonvocab: told(|o| o.params_nonvocab),
            params_vocab: told(|o| o.params_vocab),
            tokens: told(|o| o.tokens),
            ..PerQuantity::default()
        };
        OptimumAt {
            budget_flops: budget,
            at: at.under(laws.parameters),
            loss: loss.filter(|loss| loss.value.is_finite()),
        }
    };
    budgets.into_iter().enumerate().map(|(i, budget)| told(i, budget)).collect()
}

fn of_lines(laws: &Laws, budget: f64) -> OptimumAt {
    let step = (budget / laws.reference_flops).ln();
    let told = |law: Option<&PowerLaw>, of: fn(&LawSample) -> (f64, f64)| {
        let law = law?;
        let at = |(level, exponent): (f64, f64)| (level + exponent * step).exp();
        let all: Vec<f64> = laws.bootstrap.iter().map(|sample| at(of(sample))).collect();
        Some(Coefficient { value: at((law.ln_at_reference, law.exponent)), ci95: interval95(&all) })
    };
    let powers = &laws.power_laws;
    let at = PerQuantity {
        params: told(powers.params.as_ref(), LawSample::size),
        params_nonvocab: told(powers.params_nonvocab.as_ref(), LawSample::size),
        params_vocab: told(powers.params_vocab.as_ref(), LawSample::vocab),
        n_vocab: None,
        tokens: told(powers.tokens.as_ref(), LawSample::tokens),
    };
    OptimumAt { budget_flops: budget, at, loss: loss(laws, budget) }
}

/// By the floor law where it is the one to believe or the laws follow from a loss with a floor.
fn loss(laws: &Laws, budget: f64) -> Option<Coefficient> {
    let floored = laws.recommended_law() == Candidate::Floor || laws.parametric.is_some();
    let law = if floored || laws.loss.log.is_none() { Candidate::Floor } else { Candidate::Log };
    let value = laws.loss_of_minima(law, budget)?;
    let of = |s: &LawSample| match law {
        Candidate::Log => Some(s.loss_intercept + s.loss_slope_per_decade * budget.log10()),
        _ => Some(s.floor?.loss_at(budget, laws.reference_flops)),
    };
    let all: Vec<f64> = laws.bootstrap.iter().filter_map(of).collect();
    Some(Coefficient { value, ci95: interval95(&all) })
}
