//! The prediction: a slider over budgets, the configuration, and the loss over budgets.

use maud::{Markup, PreEscaped, html};
use serde_json::{Value, json};

use super::chart::{Chart, px};
use super::input::Study;
use super::words::Words;
use crate::laws::Minimum;
use crate::laws::text::count;
use crate::predict::Prediction;
use crate::words::prediction::{all_together, buildable, cells, standing};

/// The section; `None` where nothing is predicted.
pub fn section(study: &Study) -> Option<Markup> {
    let last = study.predictions.len().checked_sub(1)?;
    let first = start(study);
    let data: Vec<Value> = study.predictions.iter().map(shown).collect();
    let [budget, far] = ["budget", "far"].map(|name| study.id(name));
    let within = html! {
        label for=(budget) { "Budget: " output.flops for=(budget) {} " FLOPs" }
        input.budget id=(budget) type="range" min="0" max=(last) value=(first) step="1"
            aria-describedby=(far);
        p.far id=(far) {}
        div.wide tabindex="0" role="region" aria-label=(study.own("Predicted configuration")) {
            table {
                caption { "The optimal configuration, with 95 % intervals" }
                thead { tr { th scope="col" { "quantity" } th scope="col" { "value" }
                    th scope="col" { "95 %" } } }
                tbody.configuration {}
            }
        }
        p.build {}
        p.together {}
        ul.cautions {}
        p.faint { (explained(study)) }
        (losses(study).unwrap_or_default())
        p { "The same numbers: " code {
            "isoflop predict C --law RESULTS" @if let Some(generator) = study.generator { "/generators/" (generator) }
        } }
    };
    Some(html! {
        (study.section("prediction", "Prediction", &within))
        script.predictions type="application/json" { (PreEscaped(escaped(&data))) }
    })
}

/// The symbols in words.
fn explained(study: &Study) -> String {
    match (study.loss_name, study.words().size) {
        (None, _) => "N_nv: parameters beside those of the vocabulary. V: codes. D: tokens of training. \
                      loss: L_u, nats a token below a model that knows only how often each code is met."
            .to_string(),
        (Some(name), "N") => format!("N: model size. D: tokens of training. loss: {name}."),
        (Some(name), _) => format!(
            "N_nv: parameters beside those of the vocabulary. D: tokens of training. loss: {name}."
        ),
    }
}

/// The first budget beyond the runs, or the last.
fn start(study: &Study) -> usize {
    let beyond = study.predictions.iter().position(|one| one.extrapolation_factor > 1.5);
    beyond.unwrap_or(study.predictions.len() - 1)
}

/// What the script shows of a prediction: all of it written here.
fn shown(prediction: &Prediction) -> Value {
    let shape = prediction.shape.as_ref();
    let shape = shape.map(|shape| format!("Nearest that can be built: {}", buildable(shape)));
    json!({
        "budget_flops": prediction.budget_flops,
        "flops": count(prediction.budget_flops),
        "far": standing(prediction),
        "rows": cells(prediction),
        "shape": shape,
        "together": prediction.together.as_ref().map(all_together),
        "warnings": prediction.warnings,
    })
}

/// JSON that ends no script element.
fn escaped(data: &[Value]) -> String {
    Value::from(data).to_string().replace('<', "\\u003c")
}

/// Predicted L_u over budgets with its interval, the minima, and a mark that the slider moves.
fn losses(study: &Study) -> Option<Markup> {
    let at = |one: &Prediction| Some((one.budget_flops, one.loss_normalised?));
    let line: Vec<(f64, f64)> = study.predictions.iter().filter_map(at).collect();
    let side = |side: usize| {
        let of = move |one: &Prediction| Some((one.budget_flops, one.ci95.loss_normalised?[side]));
        study.predictions.iter().filter_map(of).collect::<Vec<_>>()
    };
    let [low, high] = [side(0), side(1)];
    let minima = minima(study);
    let measured = minima.iter().map(|minimum| (minimum.flops, minimum.loss_normalised));
    let certain = line.iter().chain(&low).chain(&high).copied();
    let chart = Chart::around(certain.chain(measured))?;
    let around = low.iter().copied().chain(high.iter().rev().copied());
    let marks: Vec<String> =
        line.iter().map(|(x, y)| format!("{} {}", px(chart.x(*x)), px(chart.y(*y)))).collect();
    let words = study.words();
    let drawn = html! {
        path.band d=(chart.path(around)) {}
        path.law d=(chart.path(line.iter().copied())) {}
        @for minimum in minima {
            circle.minimum.doubtful[!minimum.trusted]
                cx=(px(chart.x(minimum.flops))) cy=(px(chart.y(minimum.loss_normalised))) r="4.5"
                data-label=(told(minimum, &words)) {}
        }
        circle.mark r="6" data-places=(marks.join(",")) {}
    };
    let about = format!(
        "Predicted {} against budgets with its 95 % interval, and the minima of the runs",
        words.loss
    );
    let axes = ["FLOPs", &words.loss_axis];
    Some(chart.drawing(&study.id("losses"), &study.own(&about), axes, &drawn))
}

/// The minima that the laws stand on, and the one held out.
fn minima<'a>(study: &Study<'a>) -> Vec<&'a Minimum> {
    let Some(laws) = study.laws else { return Vec::new() };
    let own = laws.minima.iter().filter(|minimum| minimum.method == laws.minima_method);
    own.filter(|minimum| minimum.loss_normalised.is_finite()).collect()
}

fn told(minimum: &Minimum, words: &Words) -> String {
    let word = if minimum.trusted { "trusted minimum" } else { "minimum in doubt" };
    let vocab = if words.has_vocab { format!(", V {:.0}", minimum.n_vocab) } else { String::new() };
    format!(
        "{word} at {}: {} {:.4}, {} {}{vocab}",
        count(minimum.budget_flops),
        words.loss,
        minimum.loss_normalised,
        words.size,
        count(minimum.params_nonvocab)
    )
}
