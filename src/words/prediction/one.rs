//! The prediction for one budget: values with intervals, what to build, other laws, warnings.

use super::parts::{cautions, of_loss, standing};
use super::quantity::{cells, on_other_clips};
use crate::laws::text::count;
use crate::predict::{Prediction, Raw};
use crate::words::wrap;

/// Warnings that are said before the rest are only counted.
const MOST_SAID: usize = 2;

pub(super) fn text(prediction: &Prediction) -> String {
    let (said, left) = prediction.warnings.split_at(MOST_SAID.min(prediction.warnings.len()));
    title(prediction)
        + &rows(prediction)
        + &shape(prediction)
        + &other_laws(prediction)
        + &cautions(said, left.len())
}

fn title(prediction: &Prediction) -> String {
    let budget = count(prediction.budget_flops);
    wrap(
        "",
        &format!(
            "For {budget} FLOPs, {}{}:",
            standing(prediction),
            of_loss(prediction.loss_name.as_deref())
        ),
    )
}

fn rows(prediction: &Prediction) -> String {
    let interval = |text: &str, to: &str| {
        if to.is_empty() { String::new() } else { format!("   {text}: {to}") }
    };
    let others = on_other_clips(&prediction.ci95).unwrap_or_default();
    let row = |[name, value, to]: [String; 3]| {
        // The loss on other clips has no value of its own, and stands beside the loss.
        let line = format!("  {name:<5}{value:>11}{}", interval("95 %", &to));
        let others = if name == "loss" { interval("other clips", &others) } else { String::new() };
        (!value.is_empty()).then(|| line + &others + "\n")
    };
    cells(prediction).into_iter().filter_map(row).collect()
}

fn shape(prediction: &Prediction) -> String {
    prediction.shape.as_ref().map_or_else(String::new, |shape| {
        format!(
            "  build: {} layers, {} heads, width {}, {} codes\n",
            shape.n_layer, shape.n_head, shape.d_model, shape.n_vocab
        )
    })
}

/// The loss by each law, and by all of them together.
fn other_laws(prediction: &Prediction) -> String {
    let Raw { loss_log, loss_floor, loss_joint, .. } = prediction.raw;
    let laws = [("log", loss_log), ("floor", loss_floor), ("joint", loss_joint)];
    let named = |(name, loss): (&str, Option<f64>)| Some(format!("{name} {:.4}", loss?));
    let all: Vec<String> = laws.into_iter().filter_map(named).collect();
    let together = prediction.together.as_ref();
    let together = together.map(|together| format!("; together {:.4}", together.loss_normalised));
    match all.len() {
        0 | 1 => String::new(),
        _ => format!("  loss by law: {}{}\n", all.join(", "), together.unwrap_or_default()),
    }
}
