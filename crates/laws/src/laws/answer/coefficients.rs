//! The coefficients of the loss by the law to believe.

use std::collections::BTreeMap;

use crate::laws::file::answer::Coefficient;
use crate::laws::file::laws::Laws;
use crate::laws::joint::law::JointLaw;
use crate::laws::joint::loss::JointLoss;
use crate::laws::maths::stats::interval95;
use crate::laws::say::formula::Told;

/// By their names; empty where the loss has no law.
pub(super) fn of(laws: &Laws) -> BTreeMap<String, Coefficient> {
    let named: Vec<(&str, f64, Option<[f64; 2]>)> = match Told::of(laws) {
        None => return BTreeMap::new(),
        Some(Told::Joint(law)) => return of_joint(law),
        Some(Told::Parametric(own)) => {
            let values = own.coefficients.values().iter().enumerate();
            let names = own.coefficients.form.names();
            values.map(|(i, value)| (names[i], *value, own.ci95.get(i).copied())).collect()
        }
        Some(Told::Log(law)) => vec![
            ("slope_per_decade", law.slope_per_decade, law.slope_ci95),
            ("intercept", law.intercept, law.intercept_ci95),
        ],
        Some(Told::Floor(law)) => vec![
            ("floor", law.floor, law.floor_ci95),
            ("coefficient", law.coefficient, law.coefficient_ci95),
            ("exponent", law.exponent, law.exponent_ci95),
            ("C0", laws.reference_flops, None),
        ],
    };
    let named = named.into_iter();
    named.map(|(name, value, ci95)| (name.to_string(), Coefficient { value, ci95 })).collect()
}

fn of_joint(law: &JointLaw) -> BTreeMap<String, Coefficient> {
    let values =
        |loss: JointLoss| loss.coefficients().into_iter().map(|(_, value)| value).collect();
    let all: Vec<Vec<f64>> = law.bootstrap.iter().map(|own| values(law.loss.with(own))).collect();
    let named = law.loss.coefficients().into_iter().enumerate().map(|(i, (name, value))| {
        let ci95 = interval95(all.iter().map(|values| values[i]));
        (name.to_string(), Coefficient { value, ci95 })
    });
    named.collect()
}
