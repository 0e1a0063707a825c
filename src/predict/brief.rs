//! A prediction in a few lines.

use super::{Intervals, Prediction, Raw};
use crate::laws::text::{count, times, wrap};

/// Warnings that are said before the rest are only counted.
const MOST_SAID: usize = 2;

/// The prediction in some eight lines of at most 80 columns; [`text`](super::text()) has everything.
pub fn brief(prediction: &Prediction) -> String {
    wrap("", &title(prediction))
        + &rows(prediction)
        + &shape(prediction)
        + &together(prediction)
        + &warnings(prediction)
}

fn title(prediction: &Prediction) -> String {
    format!("Optimum for {} FLOPs, {}:", count(prediction.budget_flops), standing(prediction))
}

/// How far beyond the fit a prediction lies, and by which law it is.
pub fn standing(prediction: &Prediction) -> String {
    let far = match prediction.extrapolation_factor {
        factor if factor > 1.0 => {
            format!("{} times beyond the largest budget fitted", times(factor))
        }
        _ => "within the budgets fitted".to_string(),
    };
    let law =
        prediction.recommended.map_or_else(String::new, |law| format!(", by {}", law.about()));
    far + &law
}

/// A quantity with its interval, as it is written.
struct Row {
    name: &'static str,
    value: Option<f64>,
    interval: Option<[f64; 2]>,
    number: fn(f64) -> String,
}

impl Row {
    fn cells(&self) -> Option<[String; 3]> {
        let number = self.number;
        let interval = self
            .interval
            .map_or_else(String::new, |[low, high]| format!("{} to {}", number(low), number(high)));
        Some([self.name.to_string(), number(self.value?), interval])
    }

    fn text(&self) -> Option<String> {
        let [name, value, interval] = self.cells()?;
        let interval = if interval.is_empty() { interval } else { format!("   95 %: {interval}") };
        Some(format!("  {name:<5}{value:>11}{interval}\n"))
    }
}

/// Each quantity of the prediction with its value and its 95 % interval, as [`brief`] writes them.
pub fn cells(prediction: &Prediction) -> Vec<[String; 3]> {
    quantities(prediction).iter().filter_map(Row::cells).collect()
}

fn rows(prediction: &Prediction) -> String {
    let rows = quantities(prediction);
    rows.iter().filter_map(Row::text).collect::<String>()
        + &on_other_clips(&prediction.ci95)
        + &other_laws(&prediction.raw)
}

/// The loss, had other clips been held out.
fn on_other_clips(ci95: &Intervals) -> String {
    let row = |[low, high]: [f64; 2]| format!("  on other clips     95 %: {low:.4} to {high:.4}\n");
    ci95.loss_on_other_clips.map_or_else(String::new, row)
}

/// The symbol of a quantity, and how it is written.
type Quantity = (&'static str, fn(f64) -> String);

/// N, N_nv, V, D and the loss.
pub(super) const QUANTITIES: [Quantity; 5] = [
    ("N", count),
    ("N_nv", count),
    ("V", |x| format!("{x:.0}")),
    ("D", count),
    ("loss", |x| format!("{x:.4}")),
];

fn quantities(prediction: &Prediction) -> [Row; 5] {
    let ci = &prediction.ci95;
    let values = [
        (prediction.params, ci.params),
        (prediction.params_nonvocab, ci.params_nonvocab),
        (prediction.n_vocab, ci.n_vocab),
        (Some(prediction.tokens), ci.tokens),
        (prediction.loss_normalised, ci.loss_normalised),
    ];
    std::array::from_fn(|i| {
        let ((name, number), (value, interval)) = (QUANTITIES[i], values[i]);
        Row { name, value, interval, number }
    })
}

/// What the laws that are not recommended say of the loss.
fn other_laws(raw: &Raw) -> String {
    let laws = [
        ("log law", raw.loss_log),
        ("law with a floor", raw.loss_floor),
        ("joint law", raw.loss_joint),
    ];
    let named = |(name, loss): (&str, Option<f64>)| Some(format!("{name} {:.4}", loss?));
    let all: Vec<String> = laws.into_iter().filter_map(named).collect();
    if all.len() < 2 { String::new() } else { format!("  ({})\n", all.join(", ")) }
}

fn shape(prediction: &Prediction) -> String {
    prediction.shape.as_ref().map_or_else(String::new, |shape| {
        format!(
            "  build: {} layers, {} heads, width {}, {} codes\n",
            shape.n_layer, shape.n_head, shape.d_model, shape.n_vocab
        )
    })
}

/// What all laws say together.
pub(super) fn together(prediction: &Prediction) -> String {
    let together = prediction.together.as_ref();
    together.map_or_else(String::new, |together| wrap("- ", &together.sentence()))
}

fn warnings(prediction: &Prediction) -> String {
    let said = prediction.warnings.iter().take(MOST_SAID);
    let mut out: String = said.map(|sentence| wrap("- ", sentence)).collect();
    let more = prediction.warnings.len().saturating_sub(MOST_SAID);
    if more > 0 {
        out += &format!("- {more} more: --full\n");
    }
    out
}
