//! The laws: predictions, exponents, intervals, and the minima that they are fitted to.

use maud::{Markup, html};
use serde_json::{Value, json};

use super::curves::{Chart, px};
use super::input::{Study, Words, json_text};
use super::tables::{interval, table};
use crate::laws::text::count;
use crate::laws::{Exponent, IntervalPart, Laws, Minimum, PowerLaw, flags_text};
use crate::predict::Prediction;
use crate::words::prediction::{all_together, buildable, cells, standing};
use crate::words::thousandths;

/// A slider over budgets, the configuration and the loss over budgets; `None` if nothing is predicted.
pub fn prediction(study: &Study) -> Option<Markup> {
    let last = study.predictions.len().checked_sub(1)?;
    // The first budget beyond the runs, or the last.
    let beyond = study.predictions.iter().position(|one| one.extrapolation_factor > 1.5);
    let first = beyond.unwrap_or(last);
    let data: Value = study.predictions.iter().map(shown).collect();
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
        script.predictions type="application/json" { (json_text(&data)) }
    })
}

/// The symbols in words.
fn explained(study: &Study) -> String {
    match (study.loss_name, study.words().size) {
        (None, _) => "N_nv: parameters outside the vocabulary. V: number of codes. D: training tokens. \
        loss: L_u, in nats per token relative to a model that knows only the frequency of each code."
            .to_string(),
        (Some(name), "N") => format!("N: model size. D: training tokens. loss: {name}."),
        (Some(name), _) => format!(
            "N_nv: parameters outside the vocabulary. D: training tokens. loss: {name}."
        ),
    }
}

/// The texts of a prediction that the script shows.
fn shown(prediction: &Prediction) -> Value {
    let shape = prediction.shape.as_ref();
    let shape = shape.map(|shape| format!("Nearest model that can be built: {}", buildable(shape)));
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

/// Predicted L_u over budgets with its interval, the minima, and a mark that the slider moves.
fn losses(study: &Study) -> Option<Markup> {
    let at = |one: &Prediction| Some((one.budget_flops, one.loss_normalised?));
    let line: Vec<(f64, f64)> = study.predictions.iter().filter_map(at).collect();
    let [low, high] = [0, 1].map(|side| {
        let of = |one: &Prediction| Some((one.budget_flops, one.ci95.loss_normalised?[side]));
        study.predictions.iter().filter_map(of).collect::<Vec<_>>()
    });
    let minima = study.laws.into_iter().flat_map(own_minima);
    let minima: Vec<_> = minima.filter(|minimum| minimum.loss_normalised.is_finite()).collect();
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
    let about = "over budgets with its 95 % interval, and the minima of the runs";
    let about = format!("Predicted {} {about}", words.loss);
    let axes = ["FLOPs", &words.loss_axis];
    Some(chart.drawing(&study.id("losses"), &study.own(&about), axes, &drawn))
}

/// The minima that the laws are fitted to, and the held-out one.
fn own_minima(laws: &Laws) -> impl Iterator<Item = &Minimum> {
    laws.minima.iter().filter(|minimum| minimum.method == laws.minima_method)
}

fn told(minimum: &Minimum, words: &Words) -> String {
    let word = if minimum.trusted { "trusted minimum" } else { "flagged minimum" };
    let vocab = if words.has_vocab { format!(", V {:.0}", minimum.n_vocab) } else { String::new() };
    let Words { size, loss, .. } = words;
    let (own, [c, n]) =
        (minimum.loss_normalised, [minimum.budget_flops, minimum.params_nonvocab].map(count));
    format!("{word} at {c}: {loss} {own:.4}, {size} {n}{vocab}")
}

// The laws as tables.

/// Laws, minima and warnings.
pub fn section(study: &Study, laws: &Laws) -> Markup {
    let held_out = laws.held_out.as_ref();
    let without = held_out.map(|held_out| format!("without {}", count(held_out.budget_flops)));
    let mut head = vec!["quantity", "exponent", "95 %", "at C0", "R²", "budgets"];
    head.extend(without.as_deref());
    let reference = count(laws.reference_flops);
    let within = html! {
        (own(study, laws))
        (table(
            &study.own(&format!("Power laws through the minima ({}); C0 = {reference} FLOPs", laws.minima_method)),
            &head,
            &powers(laws)
        ))
        (table(
            &study.own("Laws of the loss through the minima; the error is measured without the held-out budget"),
            &["law", if study.loss_name.is_none() { "held-out error, nats" } else { "held-out error" }, "parameters"],
            &loss_laws(laws)
        ))
        (parts(study, laws))
        (minima(study, laws))
        @if !laws.warnings.is_empty() {
            details {
                summary { "Warnings of the fit: " (laws.warnings.len()) }
                ul { @for warning in &laws.warnings { li { (warning) } } }
            }
        }
    };
    study.section("laws", "Laws", &within)
}

/// The recommended law: its formula, its exponents and doubts.
fn own(study: &Study, laws: &Laws) -> Markup {
    let answer = laws.answer();
    let row = |(name, own): (&str, &Exponent)| {
        let (reason, not) = (own.reason.clone().unwrap_or_default(), "not determined".to_string());
        let told = |value| [thousandths(value), interval(own.ci95, thousandths), String::new()];
        let cells = own.value.map_or([not, String::new(), reason], told);
        [name.to_string()].into_iter().chain(cells).collect()
    };
    let rows: Vec<Vec<String>> = answer.exponents.named().map(row).collect();
    let [low, high] = laws.range().map(count);
    let title = format!("How the optimum grows with C, {low} to {high} FLOPs");
    html! {
        @if let Some(recommended) = &laws.judgement.recommended {
            p { "Recommended: " (recommended.law.about()) ", " (recommended.why) "." }
        }
        p { code { (answer.formula) } }
        (table(&study.own(&title), &["quantity", "exponent", "95 %", "why not determined"], &rows))
        p { (answer.verdict) }
        @if !answer.doubts.is_empty() {
            ul { @for doubt in &answer.doubts { li { (doubt.sentence()) } } }
        }
    }
}

/// The exponents of the laws through minima; if a budget is held out, also without it.
fn powers(laws: &Laws) -> Vec<Vec<String>> {
    let row = |(name, law): (&str, &PowerLaw)| {
        let before = laws.held_out.as_ref().map(|held_out| match name {
            "N_v" => held_out.exponents.params_vocab,
            "D" => held_out.exponents.tokens,
            _ => held_out.exponents.size,
        });
        let mut cells = vec![
            name.to_string(),
            thousandths(law.exponent),
            interval(law.exponent_ci95, thousandths),
            count(law.ln_at_reference.exp()),
            law.told_r2().map(thousandths).unwrap_or_default(),
            law.n.to_string(),
        ];
        cells.extend(before.map(|exponent| exponent.map(thousandths).unwrap_or_default()));
        cells
    };
    laws.power_laws.named().map(row).collect()
}

fn loss_laws(laws: &Laws) -> Vec<Vec<String>> {
    let log = laws.loss.log.as_ref().map(|law| {
        let ci95 = interval(law.slope_ci95, thousandths);
        let said = format!("{:.4} per decade ({ci95})", law.slope_per_decade);
        ("log", law.held_out_error, said)
    });
    let floor = laws.loss.floor.as_ref().map(|law| {
        let ci95 = interval(law.floor_ci95, thousandths);
        let said = format!("floor {:.3} ({ci95}), exponent {:.3}", law.floor, law.exponent);
        ("with a floor", law.held_out_error, said)
    });
    let row = |(name, error, said): (&str, Option<f64>, String)| {
        vec![name.to_string(), error.map(thousandths).unwrap_or_default(), said]
    };
    log.into_iter().chain(floor).map(row).collect()
}

/// The sources of error in the intervals.
fn parts(study: &Study, laws: &Laws) -> Markup {
    let row = |part: &IntervalPart| {
        let of = [part.exponent_nonvocab, part.exponent_vocab, part.exponent_tokens];
        let of = of.map(|ends| interval(ends, thousandths));
        [part.part.clone()].into_iter().chain(of).collect()
    };
    let rows: Vec<Vec<String>> = laws.judgement.interval_parts.iter().map(row).collect();
    let head = ["source", study.words().size, "N_v", "D"];
    html! { @if !rows.is_empty() { (table(&study.own("Intervals of the exponents by each source of error alone"), &head, &rows)) } }
}

fn minima(study: &Study, laws: &Laws) -> Markup {
    let row = |minimum: &Minimum| {
        vec![
            count(minimum.budget_flops),
            count(minimum.params_nonvocab),
            format!("{:.0}", minimum.n_vocab),
            count(minimum.tokens),
            format!("{:.4}", minimum.loss_normalised),
            if minimum.trusted { "trusted".to_string() } else { flags_text(&minimum.flags) },
        ]
    };
    let rows: Vec<Vec<String>> = own_minima(laws).map(row).collect();
    let Words { size, loss, .. } = study.words();
    let head = ["C", size, "V", "D", loss, "flags"];
    html! { @if !rows.is_empty() { (table(&study.own("Minima"), &head, &rows)) } }
}
