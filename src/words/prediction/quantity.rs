//! The quantities of a prediction, as they are written.

use crate::laws::text::count;
use crate::predict::{Intervals, Prediction};
use crate::words::number::{four, from_to};

/// The symbol of a quantity, and how it is written.
pub(super) type Quantity = (&'static str, fn(f64) -> String);

/// N, N_nv, V, D and the loss.
pub(super) const QUANTITIES: [Quantity; 5] =
    [("N", count), ("N_nv", count), ("V", |x| format!("{x:.0}")), ("D", count), ("loss", four)];

/// How the quantity of a symbol is written; N_v like N.
pub(super) fn number(symbol: &str) -> fn(f64) -> String {
    let own = QUANTITIES.into_iter().find(|(name, _)| *name == symbol);
    own.map_or(count, |(_, number)| number)
}

/// Of a prediction, in the order of [`QUANTITIES`]: each value with its 95 % interval.
pub(super) fn values(prediction: &Prediction) -> [(Option<f64>, Option<[f64; 2]>); 5] {
    QUANTITIES.map(|(name, _)| match name {
        "loss" => (prediction.loss_normalised, prediction.ci95.loss_normalised),
        _ => (prediction.at.of(name).copied(), prediction.ci95.at.of(name).copied()),
    })
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
    ci95.loss_on_other_clips.map(|ends| from_to(ends, four))
}
