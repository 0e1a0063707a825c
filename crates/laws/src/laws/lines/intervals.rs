//! 95 % intervals: percentiles over the replicates.

use super::bootstrap::{Replicate, ReplicateLaws};
use super::law_set::LawSet;
use super::sample::{FloorSample, LawSample};
use super::types::{FloorLaw, LogLaw, PowerLaw};
use crate::laws::maths::stats::interval95;
use crate::laws::minima::types::{Minimum, MinimumIntervals};
use std::f64::consts::LN_10;

/// The replicates that gave laws.
pub(in crate::laws) fn laws(replicates: &[Replicate]) -> Vec<ReplicateLaws> {
    replicates.iter().filter_map(|replicate| replicate.laws).collect()
}

/// The laws with the interval of every coefficient.
pub(in crate::laws) fn of_set(mut set: LawSet, replicates: &[ReplicateLaws]) -> LawSet {
    let samples: Vec<LawSample> = replicates.iter().map(|r| r.sample).collect();
    let ln_reference = set.reference.ln();
    let power = |law: &mut PowerLaw, of: fn(&LawSample) -> (f64, f64)| {
        let coefficients: Vec<_> = samples.iter().map(of).collect();
        of_power(law, &coefficients, ln_reference);
    };
    if let Some(law) = &mut set.params_vocab {
        power(law, LawSample::vocab);
    }
    power(&mut set.params_nonvocab, LawSample::size);
    power(&mut set.tokens, LawSample::tokens);
    if let Some(law) = &mut set.vocab_from_nonvocab {
        let exponents = replicates.iter().filter_map(|r| r.vocab_from_nonvocab);
        law.exponent_ci95 = interval95(exponents);
    }
    set.log = of_log(set.log, &samples);
    set.floor = set.floor.map(|law| of_floor(law, &samples));
    set
}

/// `coefficients` holds ln y at C0 and the exponent of each replicate.
pub(in crate::laws) fn of_power(
    law: &mut PowerLaw,
    coefficients: &[(f64, f64)],
    ln_reference: f64,
) {
    let interval = |value: &dyn Fn(&(f64, f64)) -> f64| interval95(coefficients.iter().map(value));
    law.exponent_ci95 = interval(&|(_, exponent)| *exponent);
    law.ln_at_reference_ci95 = interval(&|(level, _)| *level);
    law.log10_coefficient_ci95 =
        interval(&|(level, exponent)| (level - exponent * ln_reference) / LN_10);
}

fn of_log(law: LogLaw, samples: &[LawSample]) -> LogLaw {
    let interval = |value: fn(&LawSample) -> f64| interval95(samples.iter().map(value));
    LogLaw {
        slope_ci95: interval(|s| s.loss_slope_per_decade),
        intercept_ci95: interval(|s| s.loss_intercept),
        ..law
    }
}

/// The floor law with the interval of each coefficient, over the replicates that had one.
pub(in crate::laws) fn of_floor(law: FloorLaw, samples: &[LawSample]) -> FloorLaw {
    let samples: Vec<FloorSample> = samples.iter().filter_map(|sample| sample.floor).collect();
    let interval = |value: fn(&FloorSample) -> f64| interval95(samples.iter().map(value));
    FloorLaw {
        floor_ci95: interval(|s| s.floor),
        coefficient_ci95: interval(|s| s.coefficient),
        exponent_ci95: interval(|s| s.exponent),
        ..law
    }
}

/// The minimum with its intervals; `index` is its place in [`Replicate::minima`]. None where the
/// best run stands in for a minimum, whose interval would be that of another thing.
pub(in crate::laws) fn of_minimum(
    minimum: Minimum,
    index: usize,
    replicates: &[Replicate],
) -> Minimum {
    if minimum.is_best_run_instead() {
        return minimum;
    }
    let interval = |i: usize| interval95(replicates.iter().map(|r| r.minima[index][i]));
    let intervals = MinimumIntervals {
        params_nonvocab: interval(0),
        params_vocab: interval(1).filter(|_| minimum.params_vocab > 0.0),
        loss_normalised: interval(2),
    };
    Minimum { ci95: intervals.loss_normalised.map(|_| intervals), ..minimum }
}
