//! The laws: what they say, with what certainty, and the minima that they stand on.

use maud::{Markup, html};

use super::input::Study;
use super::table::{interval, table};
use super::words::Words;
use crate::laws::text::count;
use crate::laws::{Exponent, IntervalPart, Laws, Minimum, PowerLaw, flags_text};
use crate::words::thousandths;

/// Laws, minima and what was said of them.
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
            &study.own("Laws of the loss through the minima; the error is that of laws without the held-out budget"),
            &["law", if study.loss_name.is_none() { "held-out error, nats" } else { "held-out error" }, "parameters"],
            &losses(laws)
        ))
        (parts(study, laws))
        (minima(study, laws))
        @if !laws.warnings.is_empty() {
            details {
                summary { "Remarks on the fit: " (laws.warnings.len()) }
                ul { @for warning in &laws.warnings { li { (warning) } } }
            }
        }
    };
    study.section("laws", "Laws", &within)
}

/// The law to believe: its formula, its exponents and what is in doubt.
fn own(study: &Study, laws: &Laws) -> Markup {
    let answer = laws.answer();
    let row = |(name, own): (&str, &Exponent)| {
        let [value, ci95, reason] = match own.value {
            Some(value) => [thousandths(value), interval(own.ci95, thousandths), String::new()],
            None => {
                let reason = own.reason.clone().unwrap_or_default();
                ["not determined".to_string(), String::new(), reason]
            }
        };
        vec![name.to_string(), value, ci95, reason]
    };
    let rows: Vec<Vec<String>> = answer.exponents.named().map(row).collect();
    let [low, high] = laws.range().map(count);
    let title = format!("How the optimum grows with C, {low} to {high} FLOPs");
    html! {
        @if let Some(recommended) = &laws.judgement.recommended {
            p { "Recommended: " (recommended.law.about()) ", " (recommended.why) "." }
        }
        p { code { (answer.formula) } }
        (table(&study.own(&title), &["quantity", "exponent", "95 %", "why not"], &rows))
        p { (answer.verdict) }
        @if !answer.doubts.is_empty() {
            ul { @for doubt in &answer.doubts { li { (doubt.sentence()) } } }
        }
    }
}

/// The exponents of the laws through minima, and without the held-out budget where there is one.
fn powers(laws: &Laws) -> Vec<Vec<String>> {
    let row = |(name, law): (&str, &PowerLaw)| {
        let before = laws.held_out.as_ref().map(|held_out| match name {
            "N_v" => held_out.exponents.params_vocab,
            "D" => held_out.exponents.tokens,
            _ => held_out.exponents.size,
        });
        let fit = law.told_r2().map(thousandths).unwrap_or_default();
        let mut cells = vec![
            name.to_string(),
            thousandths(law.exponent),
            interval(law.exponent_ci95, thousandths),
            count(law.ln_at_reference.exp()),
            fit,
            law.n.to_string(),
        ];
        cells.extend(before.map(|exponent| exponent.map(thousandths).unwrap_or_default()));
        cells
    };
    laws.power_laws.named().map(row).collect()
}

fn losses(laws: &Laws) -> Vec<Vec<String>> {
    let error = |error: Option<f64>| error.map(thousandths).unwrap_or_default();
    let log = laws.loss.log.as_ref().map(|law| {
        let ci95 = interval(law.slope_ci95, thousandths);
        let said = format!("{:.4} per decade ({ci95})", law.slope_per_decade);
        vec!["log".to_string(), error(law.held_out_error), said]
    });
    let floor = laws.loss.floor.as_ref().map(|law| {
        let ci95 = interval(law.floor_ci95, thousandths);
        let said = format!("floor {:.3} ({ci95}), exponent {:.3}", law.floor, law.exponent);
        vec!["with a floor".to_string(), error(law.held_out_error), said]
    });
    log.into_iter().chain(floor).collect()
}

/// What the intervals are made of.
fn parts(study: &Study, laws: &Laws) -> Markup {
    let row = |part: &IntervalPart| {
        let of = [part.exponent_nonvocab, part.exponent_vocab, part.exponent_tokens];
        let of = of.map(|ends| interval(ends, thousandths));
        [part.part.clone()].into_iter().chain(of).collect()
    };
    let rows: Vec<Vec<String>> = laws.judgement.interval_parts.iter().map(row).collect();
    let head = ["reason", study.words().size, "N_v", "D"];
    html! { @if !rows.is_empty() { (table(&study.own("The intervals of the exponents, had they one reason alone"), &head, &rows)) } }
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
    let own = laws.minima.iter().filter(|minimum| minimum.method == laws.minima_method);
    let rows: Vec<Vec<String>> = own.map(row).collect();
    let Words { size, loss, .. } = study.words();
    let head = ["C", size, "V", "D", loss, "flags"];
    html! { @if !rows.is_empty() { (table(&study.own("Minima"), &head, &rows)) } }
}
