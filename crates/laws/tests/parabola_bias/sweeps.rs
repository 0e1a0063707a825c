//! IsoFLOP sweeps of truths whose optimum is known.

use isoflop_laws::laws::{IsoFlopPoint, Metric, Normals, RunFacts};

/// L = E + A/N^α + B N^χ/D^β on C = 6ND: the optimum is a power of C, and all budgets' curves have one shape.
#[derive(Clone, Copy)]
pub struct Truth {
    pub name: &'static str,
    a: f64,
    alpha: f64,
    b: f64,
    beta: f64,
    pub chi: f64,
}

pub const FLOOR: f64 = 1.69;
/// Hoffmann et al. 2022, as published.
pub const CHINCHILLA: Truth =
    Truth { name: "Chinchilla", a: 406.4, alpha: 0.34, b: 410.7, beta: 0.28, chi: 0.0 };
/// The same with exponents of ratio 3.
pub const LOPSIDED: Truth = Truth { name: "lopsided", alpha: 0.465, beta: 0.155, ..CHINCHILLA };
/// The same with tokens worth less to a larger model: no fitted law has this form. B is as before at N = 1e9.
pub const COUPLED: Truth = Truth { name: "coupled", b: 145.7, chi: 0.05, ..CHINCHILLA };
pub const TRUTHS: [Truth; 3] = [CHINCHILLA, LOPSIDED, COUPLED];

/// Six budgets over three decades, and one that is a thousand times the largest.
pub const BUDGETS: [f64; 6] = [1e18, 3.98e18, 1.585e19, 6.31e19, 2.512e20, 1e21];
pub const MIDDLE: f64 = 3.162e19;
pub const ASKED: f64 = 1e24;
pub const SPANS: [f64; 3] = [4.0, 16.0, 64.0];
pub const SIZES: [usize; 4] = [5, 7, 9, 15];
/// Errors of the exponent that the grid's centre follows: the centre is off by a factor of 1, 1.4 and 2 at the
/// smallest and at the largest budget.
pub const DRIFTS: [f64; 3] = [0.0, 0.1, 0.2];

impl Truth {
    pub fn exponent(&self) -> f64 {
        self.beta / (self.alpha + self.beta + self.chi)
    }

    pub fn ln_optimum(&self, budget: f64) -> f64 {
        let steepness = self.alpha * self.a / ((self.beta + self.chi) * self.b);
        steepness.ln() / (self.alpha + self.beta + self.chi) + self.exponent() * (budget / 6.0).ln()
    }

    pub fn loss(&self, n: f64, d: f64) -> f64 {
        FLOOR + self.a * n.powf(-self.alpha) + self.b * n.powf(self.chi) * d.powf(-self.beta)
    }
}

/// A sweep of a truth: sizes at even steps over `span`, round the optimum but for the drift.
#[derive(Clone, Copy)]
pub struct Sweep {
    pub truth: Truth,
    pub drift: f64,
    pub span: f64,
    pub sizes: usize,
}

impl Sweep {
    pub fn all() -> impl Iterator<Item = Self> {
        TRUTHS.into_iter().flat_map(|truth| {
            DRIFTS.into_iter().flat_map(move |drift| {
                SPANS.into_iter().flat_map(move |span| {
                    SIZES.into_iter().map(move |sizes| Self { truth, drift, span, sizes })
                })
            })
        })
    }

    pub fn points(&self, noise: f64, seed: u64) -> Vec<IsoFlopPoint> {
        let mut normals = Normals::of_stream(7, seed);
        let mut point = |budget: f64, i: usize| {
            let centre = self.truth.ln_optimum(budget) + self.drift * (budget / MIDDLE).ln();
            let step = i as f64 / (self.sizes - 1) as f64 - 0.5;
            let n = (centre + step * self.span.ln()).exp();
            let d = budget / 6.0 / n;
            IsoFlopPoint {
                run_id: format!("{budget:e} {i}"),
                seed: 0,
                budget_flops: budget,
                flops: budget,
                params_nonvocab: n,
                params_vocab: 0.0,
                n_vocab: 0.0,
                tokens: d,
                metric: Metric::default(),
                loss: self.truth.loss(n, d) + noise * normals.draw(),
                weight: 1.0,
                about: RunFacts::default(),
            }
        };
        let places =
            BUDGETS.into_iter().flat_map(|budget| (0..self.sizes).map(move |i| (budget, i)));
        places.map(|(budget, i)| point(budget, i)).collect()
    }
}
