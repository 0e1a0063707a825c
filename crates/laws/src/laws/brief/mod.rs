//! The fit on one screen: what to believe, the laws, and what is in doubt.

mod forecasts;
mod held;

use std::collections::BTreeMap;

use super::names::flags_text;
use super::text::{count, wrap};
use super::{Candidate, Laws, Minimum, PowerLaw, Recommended, Score};
use crate::laws::MinimumMethod;

/// Minima in doubt that are named before flags are only counted.
const MOST_NAMED: usize = 3;

/// The recommended law, the laws with intervals and what is in doubt, in some fifteen lines of at most 80
/// columns; [`summary`](super::summary()) has everything.
pub fn brief(laws: &Laws) -> String {
    let sentences = [Some(scope(laws)), recommended(laws)];
    let head: String = sentences.iter().flatten().map(|sentence| wrap("", sentence)).collect();
    head + &table(laws) + &doubts(laws)
}

fn scope(laws: &Laws) -> String {
    let all = laws.of_all_budgets();
    let own = || all.minima.iter().filter(|m| m.method == all.minima_method);
    let range = match (all.fitted_budgets.first(), all.fitted_budgets.last()) {
        (Some(first), Some(last)) => {
            format!("{} to {} FLOPs, rule {}", count(*first), count(*last), laws.flops_rule)
        }
        _ => format!("published, rule {}", laws.flops_rule),
    };
    let trusted = match own().count() {
        0 => String::new(),
        minima => {
            let trusted = own().filter(|m| m.trusted).count();
            let kind = match all.minima_method {
                MinimumMethod::Parabola => String::new(),
                other => format!(" ({other})"),
            };
            format!("; {trusted} of {minima} minima{kind} have no flag")
        }
    };
    format!("{}: {range}{trusted}.", laws.name)
}

/// The law to believe, and its rivals.
fn recommended(laws: &Laws) -> Option<String> {
    let Recommended { law, why, scores, .. } = laws.judgement.recommended.as_ref()?;
    if scores.is_empty() {
        return Some(format!("Recommended for want of a test: {}, since {why}.", law.about()));
    }
    let of = |law: Candidate| scores.iter().find(|score| score.law == law).map(|score| score.rms);
    let others = scores.iter().filter(|score| score.law != *law);
    let named = |score: &Score| format!("{} by {:.4}", score.law.about(), score.rms);
    let others: Vec<String> = others.map(named).collect();
    let others =
        if others.is_empty() { String::new() } else { format!(" ({})", others.join(", ")) };
    let missed = of(*law)
        .map_or_else(String::new, |rms| format!(", {rms:.4} nats r.m.s. off larger budgets"));
    Some(format!("Recommended: {}{missed}{others}.", law.about()))
}

/// Exponents through all budgets, and what they were without the held-out one.
fn table(laws: &Laws) -> String {
    let all = laws.of_all_budgets();
    let without = laws.refit.as_ref().and(laws.held_out.as_ref());
    let without = without.map(|held_out| format!("without {}", count(held_out.budget_flops)));
    let head = without.clone().unwrap_or_default();
    let mut out = format!("{:<14}{:>9}{:>19}{:>18}\n", "law", "exponent", "95 % interval", head);
    for ((name, law), (_, before)) in rows(all).into_iter().zip(rows(laws)) {
        let Some(law) = law else { continue };
        let before = before.filter(|_| without.is_some());
        let before = before.map_or(String::new(), |law| format!("{:.3}", law.exponent));
        let interval = law.exponent_ci95.map_or("-".into(), |[l, h]| format!("{l:.3}..{h:.3}"));
        out += format!("{name:<14}{:>9.3}{interval:>19}{before:>18}", law.exponent).trim_end();
        out += "\n";
    }
    out + &loss(all)
}

fn rows(laws: &Laws) -> [(&'static str, Option<&PowerLaw>); 5] {
    let powers = &laws.power_laws;
    [
        ("N    in C", powers.params.as_ref()),
        ("N_nv in C", powers.params_nonvocab.as_ref()),
        ("N_v  in C", powers.params_vocab.as_ref()),
        ("D    in C", powers.tokens.as_ref()),
        ("N_v  in N_nv", laws.vocab_from_nonvocab.as_ref()),
    ]
}

/// What the loss does, by the law to believe.
fn loss(laws: &Laws) -> String {
    let symbol = laws.loss_symbol();
    let by = match laws.recommended_law() {
        Candidate::Log => laws.loss.log.as_ref().map(|law| {
            format!("{symbol} = {:.4} log10 C {:+.4}", law.slope_per_decade, law.intercept)
        }),
        Candidate::Floor => laws.loss.floor.as_ref().map(|law| {
            format!(
                "{symbol} = {:.4} {:+.4} (C/C0)^-{:.4}, C0 = {}",
                law.floor,
                law.coefficient,
                law.exponent,
                count(laws.reference_flops)
            )
        }),
        Candidate::Joint | Candidate::JointRepeats => laws.judgement.joint.as_ref().map(|law| {
            format!(
                "{symbol} by the joint law of {} cells, {:.4} nats off (root mean square)",
                law.n, law.residual_sd
            )
        }),
    };
    by.map_or_else(String::new, |law| wrap("", &law))
}

fn doubts(laws: &Laws) -> String {
    let all = laws.of_all_budgets();
    let sentences = forecasts::sentences(&laws.judgement.validations).into_iter();
    let sentences =
        sentences.chain(minima_in_doubt(all)).chain(misfit(all)).chain(held::sentence(all));
    sentences.map(|sentence| wrap("- ", &sentence)).collect()
}

fn misfit(laws: &Laws) -> Option<String> {
    let lack = laws.judgement.lack_of_fit.iter().find(|lack| lack.method == laws.minima_method);
    let lack = lack.filter(|lack| lack.is_misfit())?;
    let p = if lack.p < 1e-4 { "below 1e-4".to_string() } else { format!("= {:.4}", lack.p) };
    let wider = lack.variance_ratio().sqrt();
    let (chi2, dof) = (lack.chi2, lack.dof);
    Some(format!(
        "Misfit: chi2 {chi2:.0} on {dof} dof (p {p}), so intervals are {wider:.1} times as wide."
    ))
}

fn minima_in_doubt(laws: &Laws) -> Option<String> {
    let own = laws.minima.iter().filter(|m| m.method == laws.minima_method);
    let flagged: Vec<&Minimum> = own.clone().filter(|m| !m.flags.is_empty()).collect();
    let name = |m: &&Minimum| {
        let out = if m.is_usable() { "" } else { "; not fitted" };
        format!("{} ({}{out})", count(m.budget_flops), flags_text(&m.flags))
    };
    match flagged.len() {
        0 => None,
        1..=MOST_NAMED => {
            let named: Vec<String> = flagged.iter().map(name).collect();
            Some(format!("Minima in doubt: {}.", named.join(", ")))
        }
        n => Some(format!("Minima in doubt: {n} of {} ({}).", own.count(), of_each_flag(&flagged))),
    }
}

/// How many minima have each flag.
fn of_each_flag(flagged: &[&Minimum]) -> String {
    let all = flagged.iter().flat_map(|minimum| minimum.flags.iter().map(ToString::to_string));
    let mut counts = BTreeMap::new();
    all.for_each(|flag| *counts.entry(flag).or_insert(0) += 1);
    let told: Vec<String> = counts.iter().map(|(flag, n)| format!("{flag} {n}")).collect();
    let lost = flagged.iter().filter(|minimum| !minimum.is_usable()).count();
    let lost = if lost > 0 { format!("; {lost} not fitted") } else { String::new() };
    told.join(", ") + &lost
}
