//! The loss of the law to believe, as a formula whose coefficients have names.

use std::collections::BTreeMap;

use crate::laws::file::answer::Coefficient;
use crate::laws::file::kind::LawKind;
use crate::laws::file::laws::Laws;
use crate::laws::input::point::Parameters;
use crate::laws::joint::law::JointLaw;
use crate::laws::lines::types::{FloorLaw, LogLaw};
use crate::laws::parametric::types::Parametric;
use crate::laws::ranking::recommended::Candidate;
use crate::laws::words::text::{count, short};

/// The law of the loss that is told.
pub(in crate::laws) enum Told<'a> {
    Log(&'a LogLaw),
    Floor(&'a FloorLaw),
    Joint(&'a JointLaw),
    Parametric(&'a Parametric),
}

impl<'a> Told<'a> {
    /// None where the loss has no law.
    pub fn of(laws: &'a Laws) -> Option<Self> {
        if let (LawKind::Parametric(_), Some(own)) = (laws.law, &laws.parametric) {
            return Some(Self::Parametric(own));
        }
        let law = match laws.law {
            LawKind::Isoflop => laws.recommended_law(),
            _ => Candidate::Log,
        };
        let floor = || laws.loss.floor.as_ref().map(Self::Floor);
        let told = match law {
            Candidate::Log => laws.loss.log.as_ref().map(Self::Log),
            Candidate::Floor => floor(),
            _ => laws.judgement.joint.as_ref().map(Self::Joint),
        };
        told.or_else(floor)
    }
}

/// The loss under its symbol, with numbers; empty where it has no law.
pub(in crate::laws) fn formula(
    laws: &Laws,
    symbol: &str,
    coefficients: &BTreeMap<String, Coefficient>,
) -> String {
    match Told::of(laws) {
        None => String::new(),
        Some(Told::Parametric(own)) => own.coefficients.formula(symbol),
        Some(Told::Joint(law)) => joint_formula(law, coefficients, laws.parameters, symbol),
        Some(Told::Log(law)) => {
            format!("{symbol} = {:.4} log10 C {}", law.slope_per_decade, signed(law.intercept))
        }
        Some(Told::Floor(law)) => format!(
            "{symbol} = {} {} (C/C0)^-{:.3}, C0 = {}",
            number(law.floor),
            signed(law.coefficient),
            law.exponent,
            count(laws.reference_flops)
        ),
    }
}

fn joint_formula(
    law: &JointLaw,
    named: &BTreeMap<String, Coefficient>,
    parameters: Parameters,
    symbol: &str,
) -> String {
    let of = |name: &str| named.get(name).map_or(0.0, |c| c.value);
    let (size, terms) = (parameters.size(), law.loss.terms);
    let vocab = match (terms.vocab, terms.saturating) {
        (false, _) => String::new(),
        (true, false) => format!(" {} ln V", signed(-of("E_v"))),
        (true, true) => {
            let (slope, kappa) = (of("E_v"), of("kappa_e"));
            format!(" {} V^-{kappa:.3}", signed(slope / kappa))
        }
    };
    let power = |name: &str, base: &str| {
        let exponent = of(name);
        if exponent == 0.0 { String::new() } else { format!(" {base}^{exponent:.3}") }
    };
    let data = if terms.repeats { "D'" } else { "D" };
    let worth = if terms.repeats {
        format!(", D' = worth of repeated D (R = {})", number(of("R")))
    } else {
        String::new()
    };
    format!(
        "{symbol} = {}{vocab} {}{} {size}^-{:.3} {}{}{} {data}^-{:.3}{worth}",
        number(of("E")),
        signed(of("A")),
        power("kappa_a", "V"),
        of("alpha"),
        signed(of("B")),
        power("kappa_b", "V"),
        power("chi", size),
        of("beta"),
    )
}

/// Four digits that say something.
fn number(x: f64) -> String {
    if x == 0.0 || (1e-2..1e5).contains(&x.abs()) {
        let whole = x.abs().max(1.0).log10().floor() as usize + 1;
        format!("{x:.*}", 5usize.saturating_sub(whole).clamp(1, 4))
    } else {
        short(x, 3)
    }
}

/// A number behind its sign.
fn signed(x: f64) -> String {
    format!("{} {}", if x < 0.0 { "-" } else { "+" }, number(x.abs()))
}
