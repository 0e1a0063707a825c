//! How the best FID of a generator falls with compute.

use std::collections::BTreeMap;

use isoflop::laws::{floor_law, power_law};
use serde::Serialize;

use super::best::Best;

/// Budgets that a law with three numbers needs at least, so that one is left to misfit.
const LEAST_BUDGETS: usize = 4;

/// FID = floor + coefficient (C / C0)^−exponent, and how far it hangs on single budgets.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FidLaw {
    pub generator: String,
    /// C0.
    pub reference_flops: f64,
    #[serde(flatten)]
    pub curve: Curve,
    /// Least and largest floor of the laws that leave one budget out.
    pub floor_range: [f64; 2],
    /// The same of the exponent.
    pub exponent_range: [f64; 2],
    pub budgets: usize,
}

/// The three numbers of a law.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Curve {
    /// No distance is below 0, so that neither is the floor.
    pub floor: f64,
    pub coefficient: f64,
    pub exponent: f64,
}

/// Of each generator that has four budgets or more and whose best FID falls with C.
pub fn fid_laws(best: &[Best]) -> Vec<FidLaw> {
    let mut by_generator: BTreeMap<&str, Vec<(f64, f64)>> = BTreeMap::new();
    for best in best {
        let point = (best.budget_flops, best.by_fid.fid);
        by_generator.entry(&best.generator).or_default().push(point);
    }
    let law = |(generator, points): (&str, Vec<(f64, f64)>)| FidLaw::of(generator, &points);
    by_generator.into_iter().filter_map(law).collect()
}

impl FidLaw {
    fn of(generator: &str, points: &[(f64, f64)]) -> Option<Self> {
        let reference_flops = points.first().filter(|_| points.len() >= LEAST_BUDGETS)?.0;
        let curve = Curve::of(points, reference_flops)?;
        let without = |left_out: usize| {
            let rest = points.iter().enumerate().filter(|(i, _)| *i != left_out);
            Curve::of(&rest.map(|(_, point)| *point).collect::<Vec<_>>(), reference_flops)
        };
        let others: Vec<Curve> = (0..points.len()).filter_map(without).collect();
        let range = |of: fn(&Curve) -> f64| {
            let values = others.iter().map(of);
            let least = values.clone().fold(of(&curve), f64::min);
            [least, values.fold(of(&curve), f64::max)]
        };
        Some(Self {
            generator: generator.to_string(),
            reference_flops,
            curve,
            floor_range: range(|curve| curve.floor),
            exponent_range: range(|curve| curve.exponent),
            budgets: points.len(),
        })
    }
}

impl Curve {
    /// By least squares; where that puts the floor below 0 or shows none, the power law without a floor.
    fn of(points: &[(f64, f64)], reference: f64) -> Option<Self> {
        let (compute, fid): (Vec<f64>, Vec<f64>) = points.iter().copied().unzip();
        if let Some(law) =
            floor_law(&compute, &fid, reference).filter(|law| law.floor > 0.0 && !law.is_at_bound())
        {
            let (floor, coefficient) = (law.floor, law.coefficient);
            return Some(Self { floor, coefficient, exponent: law.exponent });
        }
        if fid.iter().any(|fid| *fid <= 0.0) {
            return None;
        }
        let law = power_law(&compute, &fid, reference, &vec![1.0; fid.len()], None)?;
        let falls = law.exponent < 0.0;
        falls.then(|| Self {
            floor: 0.0,
            coefficient: law.ln_at_reference.exp(),
            exponent: -law.exponent,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(law: impl Fn(f64) -> f64) -> Vec<(f64, f64)> {
        [1e9, 1e10, 1e11, 1e12].map(|c| (c, law(c / 1e9))).to_vec()
    }

    fn near(found: f64, expected: f64) -> bool {
        (found - expected).abs() < 1e-5
    }

    #[test]
    fn a_law_with_a_floor_is_found_where_there_is_one() {
        let points = points(|c| 0.05 + 0.4 * c.powf(-0.5));
        let law = FidLaw::of("masked", &points).unwrap();
        let Curve { floor, coefficient, exponent } = law.curve;
        assert!(near(floor, 0.05) && near(coefficient, 0.4) && near(exponent, 0.5), "{law:?}");
        assert!(law.exponent_range.into_iter().all(|exponent| near(exponent, 0.5)), "{law:?}");
        assert_eq!(FidLaw::of("masked", &points[..3]), None, "three numbers fit three budgets");
    }

    #[test]
    fn a_floor_is_never_below_zero() {
        let points = points(|c| 0.3 - 0.04 * c.ln());
        let law = FidLaw::of("masked", &points[..]).unwrap();
        assert!(law.curve.floor == 0.0 && law.curve.exponent > 0.0, "{law:?}");
    }

    #[test]
    fn fid_that_rises_has_no_law() {
        assert_eq!(FidLaw::of("masked", &points(|c| 0.1 * c.powf(0.2))), None);
    }

    #[test]
    fn a_law_that_hangs_on_one_budget_says_so() {
        let mut points = points(|c| 0.05 + 0.4 * c.powf(-0.5));
        points[3].1 += 0.03;
        let [least, largest] = FidLaw::of("masked", &points).unwrap().exponent_range;
        assert!(largest / least > 1.5, "{least} to {largest}");
    }
}
