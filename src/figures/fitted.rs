//! The parts of laws that figures draw: minima by kind, and the quantities of the optimum.

use super::axis::{signed, span};
use super::legend::{Legend, Sample};
use super::scene::{Mark, Marker};
use super::style::{HELD_OUT, INK, Rgb};
use crate::laws::{
    Answer, Coefficient, Exponent, LawKind, Laws, Minimum, MinimumMethod, OptimumAt,
};

/// The role of a minimum in the laws.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    Fitted,
    Flagged,
    HeldOut,
}

impl Role {
    fn of(minimum: &Minimum, laws: &Laws) -> Role {
        if laws.held_out.as_ref().is_some_and(|h| h.budget_flops == minimum.budget_flops) {
            Role::HeldOut
        } else if minimum.flags.is_empty() {
            Role::Fitted
        } else {
            Role::Flagged
        }
    }

    /// The mark of a minimum by role: hollow if flagged, a diamond if held out.
    pub fn mark(self, colour: Rgb) -> Mark {
        let marker = if self == Role::HeldOut { Marker::Diamond } else { Marker::Circle };
        Mark { marker, colour, radius: 5.0, hollow: self == Role::Flagged }
    }

    /// The colour of the role, if colour has no other meaning.
    pub fn colour(self) -> Rgb {
        if self == Role::HeldOut { HELD_OUT } else { INK }
    }
}

/// The minima of the laws, the held-out one last, each with its role.
pub fn minima(laws: &Laws) -> Vec<(&Minimum, Role)> {
    let of_method = laws.minima.iter().filter(|minimum| minimum.method == laws.minima_method);
    let fitted = of_method.map(|minimum| (minimum, Role::of(minimum, laws)));
    let held_out = laws.held_out.iter().map(|held_out| (&held_out.minimum, Role::HeldOut));
    fitted.filter(|(_, role)| *role != Role::HeldOut).chain(held_out).collect()
}

/// The same, or the reason why there are none.
pub fn known_minima(laws: &Laws) -> Result<Vec<(&Minimum, Role)>, String> {
    let minima = minima(laws);
    if minima.is_empty() { Err("the laws hold no minimum".to_owned()) } else { Ok(minima) }
}

/// Explains the marks of minima by a method.
pub fn explain_marks(
    legend: &mut Legend,
    method: MinimumMethod,
    marks: impl Iterator<Item = (Mark, &'static str)>,
) {
    legend.heading(&format!("Minima ({method})"));
    marks.for_each(|(mark, text)| legend.entry(Sample::Mark(mark), text));
}

/// Explains the marks of those roles that occur, in the colours that `colour` gives them.
pub fn explain_roles(legend: &mut Legend, laws: &Laws, colour: fn(Role) -> Rgb) {
    let minima = minima(laws);
    let roles =
        [(Role::Fitted, "fitted"), (Role::Flagged, "flagged"), (Role::HeldOut, "tested on")];
    let met = roles.into_iter().filter(|(role, _)| minima.iter().any(|(_, of)| of == role));
    let marks = met.map(|(role, text)| (role.mark(colour(role)), text));
    explain_marks(legend, laws.minima_method, marks);
}

/// Values that an axis must include: trusted points, and flagged ones within a decade.
pub fn within_reach(points: &[(f64, Role)]) -> Vec<f64> {
    let values = points.iter().map(|(value, _)| *value);
    let trusted = points.iter().filter(|(_, role)| *role != Role::Flagged);
    let [low, high] = span(trusted.clone().map(|(value, _)| *value));
    let reach = low / 10.0..=high * 10.0;
    let has_none = trusted.count() == 0;
    values.filter(|value| has_none || reach.contains(value)).collect()
}

/// Says how many minima a figure's axes leave outside; empty if all are shown.
pub fn outside_remark(hidden: usize) -> String {
    match hidden {
        0 => String::new(),
        1 => " One minimum lies outside the axes.".to_owned(),
        n => format!(" {n} minima lie outside the axes."),
    }
}

/// `95 % interval 0.4 to 0.5`.
pub fn interval95([low, high]: [f64; 2]) -> String {
    format!("95 % interval {} to {}", signed(low, 3), signed(high, 3))
}

/// The law that an answer is of, for a legend.
pub fn law_name(laws: &Laws) -> String {
    match laws.law {
        LawKind::Isoflop => laws.recommended_law().about().trim_start_matches("the ").to_owned(),
        other => other.name().to_owned(),
    }
}

// The quantities of the optimum.

/// One of the three quantities of ScaMo Eq. 9, or N, if the vocabulary's parameters are not separate.
pub struct Quantity {
    pub label: &'static str,
    /// The law with its symbols.
    pub form: &'static str,
    /// The exponent's symbol.
    pub exponent: &'static str,
    pub of: fn(&Minimum) -> f64,
    /// Its symbol in the recommended law.
    symbol: &'static str,
}

const NONVOCAB: Quantity = Quantity {
    label: "Non-vocabulary parameters Nₙᵥ",
    form: "Nₙᵥ ∝ Cᵇ",
    exponent: "b",
    of: |minimum| minimum.params_nonvocab,
    symbol: "N_nv",
};
const VOCAB: Quantity = Quantity {
    label: "Vocabulary parameters Nᵥ",
    form: "Nᵥ ∝ Cᵃ",
    exponent: "a",
    of: |minimum| minimum.params_vocab,
    symbol: "N_v",
};
const TOKENS: Quantity = Quantity {
    label: "Training tokens D",
    form: "D ∝ Cᶜ",
    exponent: "c",
    of: |minimum| minimum.tokens,
    symbol: "D",
};
const SIZE: Quantity = Quantity {
    label: "Model size N (parameters)",
    form: "N ∝ Cᵃ",
    exponent: "a",
    of: |minimum| minimum.params_nonvocab,
    symbol: "N",
};

/// The quantities of the optimum, the model's size first: only N and D if the vocabulary's parameters are not
/// separate.
pub fn quantities(size_alone: bool) -> &'static [Quantity] {
    if size_alone { &[SIZE, TOKENS] } else { &[NONVOCAB, VOCAB, TOKENS] }
}

impl Quantity {
    /// Its exponent, if determined.
    pub fn exponent_of<'a>(&self, answer: &'a Answer) -> Option<&'a Exponent> {
        answer.exponents.of(self.symbol).filter(|own| own.value.is_some())
    }

    /// C, the value there and its 95 % interval along the fitted budgets; empty if the exponent is not
    /// determined.
    pub fn path(&self, answer: &Answer) -> Vec<(f64, Coefficient)> {
        let told = self.exponent_of(answer).is_some();
        let at = |optimum: &OptimumAt| Some((optimum.budget_flops, *optimum.at.of(self.symbol)?));
        answer.path.iter().filter(|_| told).filter_map(at).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figures::tests::simulated;

    #[test]
    fn the_held_out_minimum_is_shown_once() {
        let laws = simulated::sweep().laws;
        let shown = minima(&laws);
        let held_out: Vec<_> = shown.iter().filter(|(_, role)| *role == Role::HeldOut).collect();
        assert_eq!(held_out.len(), 1);
        assert_eq!(held_out[0].0, &laws.held_out.as_ref().unwrap().minimum);
    }

    #[test]
    fn a_wild_flagged_value_does_not_stretch_an_axis() {
        let points = [(1e4, Role::Fitted), (1e5, Role::HeldOut), (3e5, Role::Flagged)];
        let wild = [points.as_slice(), &[(1e19, Role::Flagged)]].concat();
        assert_eq!(within_reach(&wild), [1e4, 1e5, 3e5]);
        assert_eq!(within_reach(&[(1e19, Role::Flagged)]), [1e19]);
    }
}
