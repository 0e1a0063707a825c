//! The quantities of a prediction, as they are written.

use crate::laws::text::count;
use crate::predict::{Intervals, Prediction};

/// The symbol of a quantity, and how it is written.
pub(super) type Quantity = (&'static str, fn(f64) -> String);

/// N, N_nv, V, D and the loss.
pub(super) const QUANTITIES: [Quantity; 5] = [
    ("N", count),
    ("N_nv", count),
    ("V", |x| format!("{x:.0}")),
    ("D", count),
    ("loss", |x| format!("{x:.4}")),
];

/// How the quantity of a symbol is written; N_v like N.
pub(super) fn number(symbol: &str) -> fn(f64) -> String {
    let own = QUANTITIES.into_iter().find(|(name, _)| *name == symbol);
    own.map_or(count, |(_, number)| number)
}

/// Of a prediction, in the order of [`QUANTITIES`]: each value with its 95 % interval.
pub(super) fn values(prediction: &Prediction) -> [(Option<f64>, Option<[f64; 2]>); 5] {
    let (at, ci) = (&prediction.at, &prediction.ci95);
    [
        (at.params, ci.at.params),
        (at.params_nonvocab, ci.at.params_nonvocab),
        (at.n_vocab, ci.at.n_vocab),
        (at.tokens, ci.at.tokens),
        (prediction.loss_normalised, ci.loss_normalised),
    ]
}

/// Each quantity of the prediction with its value and its 95 % interval, as a screen writes them, and the
/// interval of the loss on other clips where it is known.
pub fn cells(prediction: &Prediction) -> Vec<[String; 3]> {
    let row = |((name, number), (value, interval)): (Quantity, (Option<f64>, Option<[f64; 2]>))| {
        let interval = interval.map_or_else(String::new, |ends| from_to(ends, number));
        Some([name.to_string(), number(value?), interval])
    };
    let own = QUANTITIES.into_iter().zip(values(prediction)).filter_map(row);
    let others = on_other_clips(&prediction.ci95);
    own.chain(others.map(|told| ["loss on other clips".into(), String::new(), told])).collect()
}

/// The interval of the loss, had other clips been held out.
pub(super) fn on_other_clips(ci95: &Intervals) -> Option<String> {
    let [.., (_, number)] = QUANTITIES;
    ci95.loss_on_other_clips.map(|ends| from_to(ends, number))
}

fn from_to(ends: [f64; 2], number: fn(f64) -> String) -> String {
    let [low, high] = ends.map(number);
    format!("{low} to {high}")
}
