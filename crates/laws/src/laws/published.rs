//! Laws of papers.

use std::f64::consts::LN_10;

use crate::laws::file::{LawKind, Laws};
use crate::laws::input::Parameters;
use crate::laws::lines::{LogLaw, LossLaws, PowerLaw, PowerLaws};

/// The FLOPs of ScaMo's validating run, around which its laws are read.
const REFERENCE_FLOPS: f64 = 1e18;

/// The law of *ScaMo: Exploring the Scaling Law in Autoregressive Motion Generation Model*, Eqs. 10
/// to 14, named `scamo`.
///
/// N_v = 10^−5.29 C^0.75, N_nv = 10^−0.52 C^0.57, D = 10^−0.05 C^0.43, N_v = 10^−5.604 N_nv^1.467,
/// L_u = −1.062 log10 C + 13.839.
///
/// The FLOP rule is `6nd`: the laws are derived from C = 6(N_nv + N_v)D (Eq. 7), though the paper
/// does not say which count its figures' axis uses. Neither its budgets nor its points are
/// published, so there are no minima, no R² and no intervals, `n` is 0, and C0 is the 1e18 of its
/// validating run. The laws do not agree with one another; [`predict`](crate::predict) says how far.
pub fn scamo() -> Laws {
    let names = ("scamo", "6nd");
    let log = LogLaw { slope_per_decade: -1.062, intercept: 13.839, ..LogLaw::default() };
    Laws {
        from_sweep: true,
        power_laws: PowerLaws {
            params_vocab: Some(published(-5.29, 0.75, REFERENCE_FLOPS)),
            params_nonvocab: Some(published(-0.52, 0.57, REFERENCE_FLOPS)),
            tokens: Some(published(-0.05, 0.43, REFERENCE_FLOPS)),
            ..PowerLaws::default()
        },
        vocab_from_nonvocab: Some(published(-5.604, 1.467, 10f64.powf(-0.52 + 0.57 * 18.0))),
        loss: LossLaws { log: Some(log), floor: None },
        warnings: WARNINGS.map(String::from).to_vec(),
        ..Laws::unfitted(LawKind::Published, names, Parameters::Split, REFERENCE_FLOPS)
    }
    .answered()
}

const WARNINGS: [&str; 2] = [
    "ScaMo gives its exponents to two digits, which alone is 23 % at 1e18, and publishes neither \
     its points nor intervals.",
    "ScaMo does not publish its budgets; extrapolation is counted from 1e18, where its validating \
     run is.",
];

fn published(log10_coefficient: f64, exponent: f64, reference: f64) -> PowerLaw {
    PowerLaw {
        log10_coefficient,
        exponent,
        ln_at_reference: (log10_coefficient + exponent * reference.log10()) * LN_10,
        ..PowerLaw::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_published_laws_give_the_papers_numbers_at_1e18() {
        let laws = scamo();
        let at = |law: &Option<PowerLaw>| law.as_ref().unwrap().value_at(1e18);
        assert!((at(&laws.power_laws.params_nonvocab) / 5.495e9 - 1.0).abs() < 1e-3);
        assert!((at(&laws.power_laws.params_vocab) / 1.622e8 - 1.0).abs() < 1e-3);
        assert!((at(&laws.power_laws.tokens) / 4.898e7 - 1.0).abs() < 1e-3);
        assert!((laws.loss.log.unwrap().loss_at(1e18) + 5.277).abs() < 1e-12);
    }

    #[test]
    fn the_published_law_survives_its_file() {
        let text = serde_json::to_string(&scamo()).unwrap();
        assert_eq!(serde_json::from_str::<Laws>(&text).unwrap(), scamo());
    }
}
