//! All sentences about a fit. Here: flags, formulas and reasons for further runs; doubts are in `judgement`,
//! warnings in `warnings`.

mod judgement;
pub(in crate::laws) mod warnings;

pub(super) use judgement::{Beyond, Undetermined, doubts, verdict, why_recommended};

use std::collections::BTreeMap;

use crate::laws::file::{Coefficient, LawKind, Laws};
use crate::laws::input::{MinimumMethod, Parameters};
use crate::laws::joint::JointLaw;
use crate::laws::lines::{FloorLaw, LogLaw};
use crate::laws::minima::{Minimum, MinimumFlag};
use crate::laws::parametric::Parametric;
use crate::laws::ranking::Candidate;
use crate::laws::text::{count, short};

// The loss by the recommended law, as a formula with named coefficients.

/// The law of the loss that the formula shows.
pub(in crate::laws) enum Told<'a> {
    Log(&'a LogLaw),
    Floor(&'a FloorLaw),
    Joint(&'a JointLaw),
    Parametric(&'a Parametric),
}

impl<'a> Told<'a> {
    /// `None` if the loss has no law.
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

/// The formula of the loss with numbers; empty if it has no law.
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

/// Four significant digits.
fn number(x: f64) -> String {
    if x == 0.0 || (1e-2..1e5).contains(&x.abs()) {
        let whole = x.abs().max(1.0).log10().floor() as usize + 1;
        format!("{x:.*}", 5usize.saturating_sub(whole).clamp(1, 4))
    } else {
        short(x, 3)
    }
}

/// A number after its sign.
fn signed(x: f64) -> String {
    format!("{} {}", if x < 0.0 { "-" } else { "+" }, number(x.abs()))
}

// Flags of minima.

/// The flags in one phrase: "not-convex, vocab-edge".
pub fn flags_text(flags: &[MinimumFlag]) -> String {
    flags.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ")
}

/// Flagged minima that are named; further ones are counted.
const MOST_NAMED: usize = 8;

/// The flagged minima: "1e10 (vocab-edge), 3e10 (not-convex)"; the first ones if there are many.
pub(in crate::laws) fn flagged(minima: &[Minimum]) -> String {
    let flagged: Vec<&Minimum> = minima.iter().filter(|m| !m.trusted).collect();
    let name = |m: &&Minimum| format!("{} ({})", count(m.budget_flops), flags_text(&m.flags));
    let named = flagged.iter().take(MOST_NAMED).map(name).collect::<Vec<_>>().join(", ");
    match flagged.len().saturating_sub(MOST_NAMED) {
        0 => named,
        more => format!("{named} and {more} more"),
    }
}

// Reasons for further runs, as the end of a sentence.

fn side(largest: bool) -> &'static str {
    if largest { "largest" } else { "smallest" }
}

pub(in crate::laws) fn why_size_at_edge(largest: bool) -> String {
    format!("the minimum lies at or beyond the {} size tried", side(largest))
}

pub(in crate::laws) fn why_vocabulary_at_edge(largest: bool) -> String {
    format!("the best vocabulary is the {} tried", side(largest))
}

/// `left` and `right`: the sizes on either side of the minimum.
pub(in crate::laws) fn why_gap(left: f64, right: f64) -> String {
    let factor = right / left;
    format!(
        "the minimum lies between {} and {}, a factor {factor:.1} apart",
        count(left),
        count(right)
    )
}

pub(in crate::laws) fn why_few_sizes(sizes: usize, method: MinimumMethod) -> String {
    format!("{sizes} size(s) are too few for the {method}")
}

pub(in crate::laws) fn why_seeds(has_minimum: bool) -> String {
    let what = match has_minimum {
        true => "is flat within its noise",
        false => "has no minimum, which noise may explain",
    };
    format!("the curve {what}; as many seeds again reduce the noise by a factor 1.4")
}

/// Why the next budget is advised: the exponents with wide intervals, and the optimal size there.
pub(in crate::laws) fn why_next(wide: &[(&str, f64)], size: &str, centre: f64) -> String {
    let wide = wide
        .iter()
        .map(|(name, width)| format!("the interval of the exponent of {name} is {width:.2} wide"));
    let wide = wide.collect::<Vec<_>>().join(" and ");
    let semicolon = if wide.is_empty() { "" } else { "; " };
    format!("{wide}{semicolon}the laws put its optimum at {size} = {}", count(centre))
}
