//! The sentences a fit owes its reader.

use crate::laws::input::method::MinimumMethod;
use crate::laws::input::options::FitOptions;
use crate::laws::input::point::Parameters;
use crate::laws::lines::floor_law::EXPONENT_RANGE;
use crate::laws::lines::types::FloorLaw;
use crate::laws::maths::stats::MIN_REPLICATES;
use crate::laws::minima::grid::Grid;
use crate::laws::minima::has_residuals;
use crate::laws::minima::run_noise::RunNoise;
use crate::laws::minima::select::flagged_text;
use crate::laws::minima::split::Split;
use crate::laws::minima::types::{Minimum, flags_text};
use crate::laws::words::text::count;

/// A minimum may spend this share more or less than declared before a warning says so.
const ACHIEVED_TOLERANCE: f64 = 0.05;

pub(in crate::laws) const ONE_VOCABULARY: &str = "The exponent of N_v is not identified: one vocabulary \
     only. Its law and the law of N_v in N_nv are left out.";

/// What the minima that the laws are fitted to left out or rest on.
pub(in crate::laws) fn of_minima(
    all: &[Minimum],
    used: &[Minimum],
    split: &Split,
    method: MinimumMethod,
    options: &FitOptions,
) -> Vec<String> {
    let (kept, out): (Vec<Minimum>, Vec<Minimum>) =
        all.iter().filter(|m| !m.trusted).cloned().partition(|m| used.contains(m));
    let told = |minima: &[Minimum], how: &str| {
        let flagged = flagged_text(minima);
        (!minima.is_empty()).then(|| format!("Flagged minima {how} the laws of minima: {flagged}."))
    };
    let sentences = [
        told(&out, "left out of"),
        told(&kept, "used in"),
        (!has_residuals(method, &split.fitted)).then(|| NO_RESIDUALS.to_string()),
        (options.parameters == Parameters::Split && split.n_vocabularies() == 1)
            .then(|| ONE_VOCABULARY.to_string()),
        achieved(used, options),
    ];
    sentences.into_iter().flatten().collect()
}

const NO_RESIDUALS: &str = "No budget has more model sizes than its curve has coefficients, so \
     whether a curvature is weak is not known.";

/// Where the minimum that misses its declared budget most misses it by much.
fn achieved(used: &[Minimum], options: &FitOptions) -> Option<String> {
    let miss = |m: &&Minimum| (m.flops / m.budget_flops).ln().abs();
    let worst = used.iter().max_by(|a, b| miss(a).total_cmp(&miss(b)))?;
    if miss(&worst) <= ACHIEVED_TOLERANCE {
        return None;
    }
    Some(format!(
        "At budget {} the optimum spends {:.3} of it under the rule {}; the laws are written in \
         declared budgets.",
        count(worst.budget_flops),
        worst.flops / worst.budget_flops,
        options.flops_rule
    ))
}

/// Where the held-out minimum is itself doubtful.
pub(in crate::laws) fn of_held_out(minimum: &Minimum) -> Option<String> {
    (!minimum.flags.is_empty()).then(|| {
        format!(
            "The held-out minimum is flagged too, so the laws' error there is in doubt: {} ({}).",
            count(minimum.budget_flops),
            flags_text(&minimum.flags)
        )
    })
}

/// Why there is no floor law, or why its exponent is no optimum.
pub(in crate::laws) fn of_floor(floor: Option<&FloorLaw>, budgets: usize) -> Option<String> {
    match floor {
        None if budgets < 3 => {
            Some(format!("The floor law has three coefficients, but {budgets} budgets are fitted."))
        }
        None => Some("The loss does not fall with C, so there is no floor law.".into()),
        Some(law) if law.exponent == EXPONENT_RANGE[0] => Some(
            "The losses bend no more than the log law, so the floor law's exponent runs into its \
             lower bound and its floor means nothing."
                .into(),
        ),
        Some(law) if law.is_at_bound() => Some(
            "The loss reaches its floor at once, so the floor law's exponent runs into its upper \
             bound."
                .into(),
        ),
        Some(_) => None,
    }
}

const NO_NOISE: &str = "There are no intervals: how much single runs scatter is not known, for want \
     of two degrees of freedom. Run every cell with a second seed, or add sizes.";
const NO_SCATTER: &str = "There are no intervals: the runs scatter by no more than rounding, so they \
     would have no width. Check that seeds differ.";

/// Replicates that failed, and intervals that are left out for want of replicates.
pub(in crate::laws) fn of_bootstrap(
    noise: Option<RunNoise>,
    grids: &[Grid],
    succeeded: usize,
    options: &FitOptions,
) -> Vec<String> {
    let asked = options.bootstrap;
    let noiseless = match noise {
        None => Some(NO_NOISE),
        Some(noise) => noise.is_rounding(grids).then_some(NO_SCATTER),
    };
    if let Some(sentence) = noiseless {
        return if asked > 0 { vec![sentence.into()] } else { Vec::new() };
    }
    let failed = asked - succeeded;
    let few = succeeded < MIN_REPLICATES;
    let sentence = match (asked, failed) {
        (0, _) => None,
        (_, 0) if few => {
            Some(format!("{asked} bootstrap replicates are too few for intervals; ask for 1000."))
        }
        (_, 0) => None,
        _ if few => Some(format!(
            "{failed} of {asked} bootstrap replicates gave no laws of minima, so these have no intervals."
        )),
        _ => Some(format!("{failed} of {asked} bootstrap replicates gave no laws.")),
    };
    sentence.into_iter().collect()
}
