//! The parametric forms of the loss.

use crate::laws::input::{IsoFlopPoint, Parameters};
use serde::{Deserialize, Serialize};

/// A parametric form of the loss.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Form {
    /// L = E + A/N^α + B/D^β (Hoffmann et al. 2022, approach 3).
    Approach3,
    /// L_u = −E + A1/N_nv^α1 + A2/N_v^α2 + B/D^β (Tao et al. 2024, approach 3).
    Approach3Vocab,
}

/// The quantity of the residuals.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Space {
    /// The logarithm of the loss.
    Log,
    /// The loss.
    Raw,
}

impl Space {
    /// A loss as the residuals are taken of it.
    pub(super) fn of(self, loss: f64) -> f64 {
        match self {
            Self::Log => loss.ln(),
            Self::Raw => loss,
        }
    }
}

/// How the constant of a law is parametrised.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Constant {
    /// E = e^θ, above zero.
    Positive,
    /// −E = θ, of either sign.
    Free,
}

/// Most parameters of a form: three terms of two each, and the constant.
pub(super) const MAX_PARAMS: usize = 7;

pub(super) type Vector = [f64; MAX_PARAMS];
pub(super) type Matrix = [[f64; MAX_PARAMS]; MAX_PARAMS];

/// The free parameter of each parameter of a form; `None` if it is frozen.
pub(super) type Slots = [Option<usize>; MAX_PARAMS];

impl Form {
    /// Every form.
    pub const ALL: [Self; 2] = [Self::Approach3, Self::Approach3Vocab];

    /// The name in files and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Approach3 => "approach3",
            Self::Approach3Vocab => "approach3-vocab",
        }
    }

    /// Whether the form separates vocabulary and other parameters.
    pub fn parameters(self) -> Parameters {
        match self {
            Self::Approach3 => Parameters::Total,
            Self::Approach3Vocab => Parameters::Split,
        }
    }

    /// The default space of the residuals: the loss or its logarithm.
    pub fn default_space(self) -> Space {
        match self {
            Self::Approach3 => Space::Log,
            Self::Approach3Vocab => Space::Raw,
        }
    }

    /// The quantities of the terms: N and D, or N_nv, N_v and D.
    pub(super) fn quantities_of(self, p: &IsoFlopPoint) -> [f64; 3] {
        match self {
            Self::Approach3 => [p.params_nonvocab + p.params_vocab, p.tokens, 0.0],
            Self::Approach3Vocab => [p.params_nonvocab, p.params_vocab, p.tokens],
        }
    }

    /// Coefficients in the order of [`Form::names`], alike for all kinds of parameters.
    pub(super) fn start(self, [a, b, e, alpha, beta]: [f64; 5]) -> Vec<f64> {
        match self {
            Self::Approach3 => vec![e, a, b, alpha, beta],
            Self::Approach3Vocab => vec![e, a, a, b, alpha, alpha, beta],
        }
    }

    /// Terms that fall with a quantity.
    pub(super) fn n_terms(self) -> usize {
        self.quantities().len()
    }

    pub(super) fn n_params(self) -> usize {
        2 * self.n_terms() + 1
    }

    /// E of approach 3 is a loss, so above zero where losses are; that of a normalised loss, and −E
    /// with a vocabulary, may have either sign.
    pub(super) fn constant(self, losses: &[f64]) -> Constant {
        match self {
            Self::Approach3 if losses.iter().all(|loss| *loss > 0.0) => Constant::Positive,
            Self::Approach3 | Self::Approach3Vocab => Constant::Free,
        }
    }

    /// The sign of E in the law.
    fn sign(self) -> f64 {
        match self {
            Self::Approach3 => 1.0,
            Self::Approach3Vocab => -1.0,
        }
    }

    /// Names of the constant, the coefficients and the exponents, in that order.
    pub fn names(self) -> &'static [&'static str] {
        match self {
            Self::Approach3 => &["E", "A", "B", "alpha", "beta"],
            Self::Approach3Vocab => &["E", "A1", "A2", "B", "alpha1", "alpha2", "beta"],
        }
    }

    /// The law, for a person.
    pub fn equation(self) -> &'static str {
        match self {
            Self::Approach3 => "L = E + A/N^alpha + B/D^beta",
            Self::Approach3Vocab => "L = -E + A1/N_nv^alpha1 + A2/N_v^alpha2 + B/D^beta",
        }
    }

    /// The quantities of the terms, for messages.
    pub(in crate::laws) fn quantities(self) -> &'static [&'static str] {
        match self {
            Self::Approach3 => &["N", "D"],
            Self::Approach3Vocab => &["N_nv", "N_v", "D"],
        }
    }

    /// Every parameter free; with `tied`, the first exponent follows the last, as Tao et al. have
    /// it (α1 = β).
    pub(super) fn slots(self, tied: bool) -> Slots {
        let k = self.n_terms();
        let mut slots = [None; MAX_PARAMS];
        for (p, slot) in slots.iter_mut().enumerate().take(self.n_params()) {
            *slot = Some(p);
        }
        if tied {
            // The last exponent takes the first one's place among the free.
            slots[2 * k] = slots[k + 1];
        }
        slots
    }
}

/// The coefficients of a form, in the units of the table's columns.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coefficients {
    pub form: Form,
    /// E, the A and B, the exponents, in the order of [`Form::names`].
    values: Vector,
}

impl Coefficients {
    /// The law in numbers, the loss being `symbol`.
    pub fn formula(&self, symbol: &str) -> String {
        let (values, k) = (self.values(), self.form.n_terms());
        let quantities = self.form.quantities();
        let term = |i: usize| {
            let [coefficient, exponent] = [values[1 + i], values[1 + k + i]];
            format!(" + {}/{}^{exponent:.4}", digits(coefficient), quantities[i])
        };
        let terms: String = (0..k).map(term).collect();
        format!("{symbol} = {}{terms}", digits(self.form.sign() * values[0]))
    }

    /// From values in the order of [`Form::names`]; none if there are fewer.
    pub fn new(form: Form, values: &[f64]) -> Option<Self> {
        let mut all = [0.0; MAX_PARAMS];
        let own = values.get(..form.n_params())?;
        all[..own.len()].copy_from_slice(own);
        Some(Self { form, values: all })
    }

    /// Undoes centring and logarithms: `theta` is c_1 … c_K, the constant, α_1 … α_K around the
    /// means of ln x.
    pub(super) fn from_centred(
        form: Form,
        constant: Constant,
        theta: &Vector,
        means: &[f64],
    ) -> Self {
        let k = form.n_terms();
        let mut values = [0.0; MAX_PARAMS];
        values[0] = match constant {
            Constant::Positive => theta[k].exp(),
            Constant::Free => form.sign() * theta[k],
        };
        for (term, mean) in means.iter().enumerate() {
            let exponent = theta[k + 1 + term];
            values[1 + term] = (theta[term] + exponent * mean).exp();
            values[1 + k + term] = exponent;
        }
        Self { form, values }
    }

    /// The inverse of [`Self::from_centred`].
    pub(super) fn centred(&self, constant: Constant, means: &[f64]) -> Vector {
        let k = self.form.n_terms();
        let mut theta = [0.0; MAX_PARAMS];
        theta[k] = match constant {
            Constant::Positive => self.values[0].ln(),
            Constant::Free => self.form.sign() * self.values[0],
        };
        for (term, mean) in means.iter().enumerate() {
            theta[term] = self.values[1 + term].ln() - self.exponent(term) * mean;
            theta[k + 1 + term] = self.exponent(term);
        }
        theta
    }

    /// In the order of [`Form::names`].
    pub fn values(&self) -> &[f64] {
        &self.values[..self.form.n_params()]
    }

    /// The value of a name of [`Form::names`].
    pub fn get(&self, name: &str) -> Option<f64> {
        let position = self.form.names().iter().position(|n| *n == name)?;
        Some(self.values[position])
    }

    /// A or B of the `term`-th quantity.
    pub fn coefficient(&self, term: usize) -> f64 {
        self.values[1 + term]
    }

    /// α or β of the `term`-th quantity.
    pub fn exponent(&self, term: usize) -> f64 {
        self.values[1 + self.form.n_terms() + term]
    }

    /// The floor of the loss: E, or −E with a vocabulary.
    pub fn floor(&self) -> f64 {
        self.form.sign() * self.values[0]
    }

    /// The loss at the quantities of the terms, in the order of the form: N and D, or N_nv, N_v
    /// and D.
    pub fn loss(&self, quantities: &[f64]) -> f64 {
        let term = |(term, x): (usize, &f64)| self.coefficient(term) * x.powf(-self.exponent(term));
        self.floor() + quantities.iter().enumerate().map(term).sum::<f64>()
    }
}

/// Five significant digits.
fn digits(x: f64) -> String {
    let whole = x.abs().max(1.0).log10().floor() as usize + 1;
    if x.abs() < 1e5 { format!("{x:.*}", 5usize.saturating_sub(whole)) } else { format!("{x:.3e}") }
}
