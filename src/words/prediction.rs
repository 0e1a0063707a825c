//! Predictions as text for a terminal: for budgets, and for one model.

use crate::laws::PerQuantity;
use crate::laws::text::{codes, count, short, times};
use crate::predict::{PredictedShape, Prediction, Raw, SizedPrediction, Together};
use crate::words::{four, from_to, known, listed, span, thousandths, wrap};

/// The symbol of a quantity, and the format of its values.
type Quantity = (&'static str, fn(f64) -> String);

/// N, N_nv, V, D and the loss.
const QUANTITIES: [Quantity; 5] =
    [("N", count), ("N_nv", count), ("V", codes), ("D", count), ("loss", four)];

/// The format of a quantity's values; N_v like N.
fn number(symbol: &str) -> fn(f64) -> String {
    let own = QUANTITIES.into_iter().find(|(name, _)| *name == symbol);
    own.map_or(count, |(_, number)| number)
}

/// The values of a prediction with their 95 % intervals, in the order of [`QUANTITIES`].
fn values(prediction: &Prediction) -> [(Option<f64>, Option<[f64; 2]>); 5] {
    QUANTITIES.map(|(name, _)| match name {
        "loss" => (prediction.loss_normalised, prediction.ci95.loss_normalised),
        _ => (prediction.at.of(name).copied(), prediction.ci95.at.of(name).copied()),
    })
}

/// Each quantity of the prediction with its value and its 95 % interval, as on a screen, and the interval of
/// the loss on other clips if it is known.
pub fn cells(prediction: &Prediction) -> Vec<[String; 3]> {
    let row = |((name, number), (value, interval)): (Quantity, (Option<f64>, Option<[f64; 2]>))| {
        let interval = interval.map_or_else(String::new, |ends| from_to(ends, number));
        Some([name.to_string(), number(value?), interval])
    };
    let own = QUANTITIES.into_iter().zip(values(prediction)).filter_map(row);
    let others = on_other_clips(prediction);
    own.chain(others.map(|told| ["loss on other clips".into(), String::new(), told])).collect()
}

/// The interval of the loss on other held-out clips.
fn on_other_clips(prediction: &Prediction) -> Option<String> {
    prediction.ci95.loss_on_other_clips.map(|ends| from_to(ends, four))
}

/// The nearest model that can be built, in a few words.
pub fn buildable(shape: &PredictedShape) -> String {
    format!(
        "{} layers, {} heads, width {}, {} codes",
        shape.n_layer, shape.n_head, shape.d_model, shape.n_vocab
    )
}

/// The distance of a budget from the fitted ones, to stand before "the fit". `beyond`: the budget over the
/// largest fitted one; `below`: the smallest fitted one over the budget.
fn distance(beyond: f64, below: Option<f64>) -> String {
    match below {
        Some(factor) => format!("{} times below", times(factor)),
        None if beyond > 1.0 => format!("{} times beyond", times(beyond)),
        None => "within".to_string(),
    }
}

/// The distance of a prediction from the fit, and its law.
pub fn standing(prediction: &Prediction) -> String {
    let far = distance(prediction.extrapolation_factor, prediction.below_fit);
    let law =
        prediction.recommended.map_or_else(String::new, |law| format!(", by {}", law.about()));
    format!("{far} the fit{law}")
}

/// The name of a table's loss, in parentheses; empty for L_u and for a column `loss`.
fn of_loss(name: Option<&str>) -> String {
    let named = |name| format!(" (loss: {name})");
    name.filter(|name| *name != "loss").map_or_else(String::new, named)
}

// The loss of a model of any size.

/// The loss, the best model for the same FLOPs and the gap between them, in at most 80 columns.
pub fn sized_text(prediction: &SizedPrediction) -> String {
    let SizedPrediction { ci95, optimum, .. } = prediction;
    let of_optimum = optimum.at.named().map(|(name, x)| row(name, *x, number(name), None));
    title(prediction)
        + &row("loss", prediction.loss_normalised, four, ci95.loss_normalised)
        + "The best model for the same FLOPs, and the loss above it:\n"
        + &of_optimum.collect::<String>()
        + &row("loss", optimum.loss_normalised, four, ci95.optimum_loss)
        + &row("above", prediction.loss_above_optimum, four, ci95.loss_above_optimum)
        + &notes(prediction)
}

fn title(prediction: &SizedPrediction) -> String {
    // The model's size in the quantities of the law.
    let named = prediction.model.named().filter(|(name, _)| *name != "D");
    let size: Vec<_> = named.map(|(name, x)| format!("{name} = {}", number(name)(*x))).collect();
    let sentence = format!(
        "{} on {} tokens, {} FLOPs, {} the fit, by {} of {}{}:",
        size.join(", "),
        count(tokens(&prediction.model)),
        count(prediction.flops),
        distance(prediction.extrapolation_factor, prediction.below_fit),
        prediction.form,
        prediction.law,
        of_loss(prediction.loss_name.as_deref())
    );
    wrap("", &sentence)
}

fn row(name: &str, value: f64, number: fn(f64) -> String, interval: Option<[f64; 2]>) -> String {
    let ends = interval.map(|ends| format!("   95 %: {}", from_to(ends, number)));
    format!("  {name:<5}{:>11}{}\n", number(value), ends.unwrap_or_default())
}

fn notes(prediction: &SizedPrediction) -> String {
    let ratio = tokens(&prediction.model) / tokens(&prediction.optimum.at);
    let more = if ratio > 1.0 { "times" } else { "of" };
    let equal = prediction.flops_of_equal_loss.map_or_else(String::new, |flops| {
        let share = 100.0 * flops / prediction.flops;
        format!("; the best model reaches its loss with {} % of the FLOPs", times(share))
    });
    let trained =
        format!("It is trained on {} {more} the best model's tokens{equal}.", times(ratio));
    let sentences = [trained].into_iter().chain(prediction.warnings.iter().cloned());
    sentences.map(|sentence| wrap("- ", &sentence)).collect()
}

/// D, always known here.
fn tokens(of: &PerQuantity<f64>) -> f64 {
    of.tokens.unwrap_or(f64::NAN)
}

// Predictions for budgets: one or several on a screen, or each in full.

/// Predictions in some ten lines of at most 80 columns, or each in full.
pub fn said(predictions: &[Prediction], full: bool) -> String {
    match predictions {
        _ if full => predictions.iter().map(text).collect::<Vec<_>>().join("\n"),
        [] => String::new(),
        [one] => of_one(one),
        several => of_several(several),
    }
}

// One budget on a screen: values with intervals, what to build, other laws, warnings.

fn of_one(prediction: &Prediction) -> String {
    // The first two warnings are shown, the rest are counted.
    let (said, left) = prediction.warnings.split_at(2.min(prediction.warnings.len()));
    let (budget, loss) = (count(prediction.budget_flops), of_loss(prediction.loss_name.as_deref()));
    let build = prediction.shape.as_ref().map(|shape| format!("  build: {}\n", buildable(shape)));
    wrap("", &format!("For {budget} FLOPs, {}{loss}:", standing(prediction)))
        + &rows(prediction)
        + &build.unwrap_or_default()
        + &other_laws(prediction)
        + &cautions(said, left.len())
}

fn rows(prediction: &Prediction) -> String {
    let interval = |text: &str, to: &str| {
        if to.is_empty() { String::new() } else { format!("   {text}: {to}") }
    };
    let others = on_other_clips(prediction).unwrap_or_default();
    let row = |[name, value, to]: [String; 3]| {
        // The loss on other clips has only an interval, shown in the row of the loss.
        let line = format!("  {name:<5}{value:>11}{}", interval("95 %", &to));
        let others = if name == "loss" { interval("other clips", &others) } else { String::new() };
        (!value.is_empty()).then(|| line + &others + "\n")
    };
    cells(prediction).into_iter().filter_map(row).collect()
}

/// The loss by each law, and their weighted mean.
fn other_laws(prediction: &Prediction) -> String {
    let Raw { loss_log, loss_floor, loss_joint, .. } = prediction.raw;
    let laws = [("log", loss_log), ("floor", loss_floor), ("joint", loss_joint)];
    let named = |(name, loss): (&str, Option<f64>)| Some(format!("{name} {:.4}", loss?));
    let all: Vec<String> = laws.into_iter().filter_map(named).collect();
    let together = prediction.together.as_ref();
    let together =
        together.map(|together| format!("; weighted mean {:.4}", together.loss_normalised));
    match all.len() {
        0 | 1 => String::new(),
        _ => wrap("  loss by law: ", &(all.join(", ") + &together.unwrap_or_default())),
    }
}

/// Sentences, and the number of those left to `--full`.
fn cautions(said: &[String], left: usize) -> String {
    let said: String = said.iter().map(|sentence| wrap("- ", sentence)).collect();
    if left == 0 { said } else { format!("{said}- {left} more: --full\n") }
}

// Several budgets on a screen: a table, and a warning for the farthest.

fn of_several(predictions: &[Prediction]) -> String {
    let first = &predictions[0];
    let by = first.recommended.map_or_else(String::new, |law| format!(" by {}", law.about()));
    let loss = of_loss(first.loss_name.as_deref());
    let told = QUANTITIES.into_iter().zip(values(first));
    wrap("", &format!("Optima{by}, with their distance beyond the fit{loss}:"))
        + &line("FLOPs", told.map(|((name, _), (value, _))| value.map(|_| name.to_string())))
        + &predictions.iter().map(two_lines).collect::<String>()
        + &weightiest(predictions)
}

/// The values of a budget, with their intervals below.
fn two_lines(prediction: &Prediction) -> String {
    let [_, _, (_, vocab), _, _] = QUANTITIES;
    let narrow = |x| short(x, 2);
    let numbers: [fn(f64) -> String; 5] = [narrow, narrow, vocab, narrow, thousandths];
    let told = numbers.into_iter().zip(values(prediction));
    let own = told.clone().map(|(number, (value, _))| value.map(number));
    let intervals = told.map(|(number, (value, ends))| value.map(|_| span(ends, number)));
    let far = distance(prediction.extrapolation_factor, prediction.below_fit);
    let far = format!("  {}", far.trim_end_matches(" beyond"));
    line(&count(prediction.budget_flops), own) + &line(&far, intervals)
}

/// A label, and a column for each known quantity.
fn line(label: &str, cells: impl Iterator<Item = Option<String>>) -> String {
    let cells: String = cells.flatten().map(|cell| format!(" {cell:>15}")).collect();
    format!("{label:<16}{cells}").trim_end().to_string() + "\n"
}

/// The first warning of the farthest budget, and the number of all others.
fn weightiest(predictions: &[Prediction]) -> String {
    let all: usize = predictions.iter().map(|prediction| prediction.warnings.len()).sum();
    let farthest = predictions.iter().max_by(|a, b| a.budget_flops.total_cmp(&b.budget_flops));
    let said = farthest
        .and_then(|one| Some(format!("{}: {}", count(one.budget_flops), one.warnings.first()?)));
    let said: Vec<String> = said.into_iter().collect();
    cautions(&said, all - said.len())
}

// A prediction in full.

/// The prediction in full, in at most 80 columns and without colour.
fn text(prediction: &Prediction) -> String {
    let title = format!(
        "Optimum for {} FLOPs by {}{}. Unscaled, the separate laws spend {:.3} of the budget; extrapolation factor {:.3}.",
        count(prediction.budget_flops),
        prediction.law,
        of_loss(prediction.loss_name.as_deref()),
        prediction.budget_ratio,
        prediction.extrapolation_factor
    );
    let Prediction { at, ci95, raw, .. } = prediction;
    let row = |(name, value): (&str, &f64)| {
        let number = number(name);
        let interval = span(ci95.at.of(name).copied(), number);
        let raw = known(raw.at.of(name).copied(), count);
        format!("{name:<8}{:>14}{interval:>28}{raw:>14}\n", number(*value))
    };
    let together = prediction.together.as_ref().map(|own| wrap("- ", &all_together(own)));
    wrap("", &title)
        + &format!("\n{:<8}{:>14}{:>28}{:>14}\n", "", "on budget", "95 % interval", "unscaled")
        + &at.named().map(row).collect::<String>()
        + &loss(prediction)
        + &shape(prediction)
        + &together.unwrap_or_default()
        + &listed("warnings", prediction.warnings.iter().cloned())
}

fn loss(prediction: &Prediction) -> String {
    let Prediction { ci95, raw, .. } = prediction;
    let Some(loss) = prediction.loss_normalised else {
        return String::new();
    };
    // Without a log law, the loss above is already the floor law's.
    let floor = raw.loss_log.and(raw.loss_floor).map_or_else(String::new, |floor| {
        let interval = span(ci95.loss_floor, four);
        format!("{:<8}{:>14}{interval:>28}   by the law with a floor\n", "", four(floor))
    });
    let others = ci95.loss_on_other_clips.map_or_else(String::new, |ends| {
        format!("{:<22}{:>28}\n", "on other clips", span(Some(ends), four))
    });
    let interval = span(ci95.loss_normalised, four);
    format!("{:<8}{:>14}{interval:>28}\n{others}{floor}", "loss", four(loss))
}

fn shape(prediction: &Prediction) -> String {
    let Some(shape) = &prediction.shape else {
        return String::new();
    };
    let levels = match &shape.levels[..] {
        [] => String::new(),
        levels => format!(" (FSQ levels {levels:?})"),
    };
    let sentence = format!(
        "nearest shape: {} layers, {} heads, width {}, vocabulary {}{levels}",
        shape.n_layer, shape.n_head, shape.d_model, shape.n_vocab
    );
    format!("\n{}", wrap("", &sentence))
}

/// The weighted mean of all laws, in a sentence.
pub fn all_together(together: &Together) -> String {
    let Together { laws, loss_normalised, at } = together;
    let said = QUANTITIES.into_iter().filter_map(|(name, number)| {
        let value = if name == "loss" { *loss_normalised } else { *at.of(name)? };
        Some(format!("{name} {}", number(value)))
    });
    let weights = laws.iter().map(|one| format!("{} {:.2}", one.law.name(), one.weight));
    format!(
        "The weighted mean of all laws (weights from their past errors: {}): {}.",
        weights.collect::<Vec<_>>().join(", "),
        said.collect::<Vec<_>>().join(", ")
    )
}
