//! The loss of the law to believe, as a formula whose coefficients have names.

use std::collections::BTreeMap;

use crate::laws::file::answer::Coefficient;
use crate::laws::file::kind::LawKind;
use crate::laws::file::laws::Laws;
use crate::laws::input::point::Parameters;
use crate::laws::joint::law::JointLaw;
use crate::laws::joint::loss::JointLoss;
use crate::laws::maths::stats::interval95;
use crate::laws::ranking::recommended::Candidate;
use crate::laws::words::text::{count, short};

type Named = (String, BTreeMap<String, Coefficient>);

/// The formula and its coefficients; empty where the loss has no law.
pub(super) fn of(laws: &Laws) -> Named {
    let symbol = laws.loss_symbol();
    if let (LawKind::Parametric(_), Some(own)) = (laws.law, &laws.parametric) {
        let form = own.coefficients.form;
        let named = form.names().iter().enumerate().map(|(i, name)| {
            let ci95 = own.ci95.get(i).copied();
            (name.to_string(), Coefficient { value: own.coefficients.values()[i], ci95 })
        });
        return (own.coefficients.formula(symbol), named.collect());
    }
    let law = match laws.law {
        LawKind::Isoflop => laws.recommended_law(),
        _ => Candidate::Log,
    };
    let said = match law {
        Candidate::Log => of_log(laws, symbol),
        Candidate::Floor => of_floor(laws, symbol),
        _ => laws.judgement.joint.as_ref().map(|law| of_joint(law, laws.parameters, symbol)),
    };
    said.or_else(|| of_floor(laws, symbol)).unwrap_or_default()
}

fn of_log(laws: &Laws, symbol: &str) -> Option<Named> {
    let law = laws.loss.log.as_ref()?;
    let formula =
        format!("{symbol} = {:.4} log10 C {}", law.slope_per_decade, signed(law.intercept));
    let slope = Coefficient { value: law.slope_per_decade, ci95: law.slope_ci95 };
    let intercept = Coefficient { value: law.intercept, ci95: law.intercept_ci95 };
    let named = [("slope_per_decade", slope), ("intercept", intercept)];
    Some((formula, named.map(|(name, c)| (name.to_string(), c)).into()))
}

fn of_floor(laws: &Laws, symbol: &str) -> Option<Named> {
    let law = laws.loss.floor.as_ref()?;
    let formula = format!(
        "{symbol} = {} {} (C/C0)^-{:.3}, C0 = {}",
        number(law.floor),
        signed(law.coefficient),
        law.exponent,
        count(laws.reference_flops)
    );
    let named = [
        ("floor", law.floor, law.floor_ci95),
        ("coefficient", law.coefficient, law.coefficient_ci95),
        ("exponent", law.exponent, law.exponent_ci95),
        ("C0", laws.reference_flops, None),
    ];
    let named = named.map(|(name, value, ci95)| (name.to_string(), Coefficient { value, ci95 }));
    Some((formula, named.into()))
}

fn of_joint(law: &JointLaw, parameters: Parameters, symbol: &str) -> Named {
    let own = law.loss.coefficients();
    let all: Vec<Vec<f64>> = law
        .bootstrap
        .iter()
        .map(|values| JointLoss { values: values.clone(), ..law.loss.clone() })
        .map(|loss| loss.coefficients().into_iter().map(|(_, value)| value).collect())
        .collect();
    let named = own.iter().enumerate().map(|(i, (name, value))| {
        let ci95 = interval95(&all.iter().map(|values| values[i]).collect::<Vec<_>>());
        (name.to_string(), Coefficient { value: *value, ci95 })
    });
    let named: BTreeMap<String, Coefficient> = named.collect();
    (joint_formula(law, &named, parameters, symbol), named)
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
