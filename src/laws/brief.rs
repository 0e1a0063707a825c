//! The fit on one screen: what to believe, the laws, and what is in doubt.

use super::names::flags_text;
use super::stats::student_t95;
use super::text::{count, wrap};
use super::{
    Candidate, Judgement, Laws, Minimum, NoiseSource, Parameters, PowerLaw, Recommended, TestNoise,
    Validated,
};

/// Minima in doubt that are named before the rest are only counted.
const MOST_NAMED: usize = 3;

/// The recommended law, the laws with intervals and what is in doubt, in some fifteen lines of at most 80
/// columns; [`summary`](super::summary()) has everything.
pub fn brief(laws: &Laws) -> String {
    let sentences = [Some(scope(laws)), recommended(laws)];
    let head: String = sentences.iter().flatten().map(|sentence| wrap("", sentence)).collect();
    head + "\n" + &table(laws) + &doubts(laws)
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
            format!("; {trusted} of {minima} minima ({}) have no flag", all.minima_method)
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
    let miss = |law: Candidate, rms: f64| format!("{} by {rms:.4}", law.about());
    let all: Vec<String> = scores.iter().map(|score| miss(score.law, score.rms)).collect();
    Some(format!(
        "Recommended: {}. Fitted to smaller budgets, the laws missed the losses of larger ones (root mean \
         square, nats): {}.",
        law.about(),
        all.join(", ")
    ))
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
    let tested = laws.judgement.validations.iter().filter_map(Validated::sentence);
    let mut sentences: Vec<String> = tested.chain(minima_in_doubt(all)).collect();
    let lack = all.judgement.lack_of_fit.iter().find(|lack| lack.method == all.minima_method);
    if let Some(lack) = lack.filter(|lack| lack.is_misfit()) {
        sentences.push(format!(
            "The curves misfit: chi2 is {:.0} on {} degrees of freedom (p {}), so intervals are {:.1} \
             times as wide as the runs' noise makes them.",
            lack.chi2,
            lack.dof,
            if lack.p < 1e-4 { "below 1e-4".to_string() } else { format!("= {:.4}", lack.p) },
            lack.variance_ratio().sqrt()
        ));
    }
    if let Some(sentence) = held(all) {
        sentences.push(sentence);
    }
    if sentences.is_empty() {
        return String::new();
    }
    "\n".to_string() + &sentences.iter().map(|sentence| wrap("- ", sentence)).collect::<String>()
}

fn minima_in_doubt(laws: &Laws) -> Option<String> {
    let own = laws.minima.iter().filter(|m| m.method == laws.minima_method);
    let flagged: Vec<&Minimum> = own.filter(|m| !m.flags.is_empty()).collect();
    let name = |m: &&Minimum| {
        let out = if m.is_usable() { "" } else { "; not fitted" };
        format!("{} ({}{out})", count(m.budget_flops), flags_text(&m.flags))
    };
    let mut named = flagged.iter().take(MOST_NAMED).map(name).collect::<Vec<_>>().join(", ");
    if flagged.len() > MOST_NAMED {
        named += &format!(" and {} more", flagged.len() - MOST_NAMED);
    }
    (!flagged.is_empty()).then(|| format!("Minima in doubt: {named}."))
}

/// What the intervals hold, and what they do not.
fn held(laws: &Laws) -> Option<String> {
    let parts = &laws.judgement.interval_parts;
    let exponent = match laws.parameters {
        Parameters::Split => laws.power_laws.params_nonvocab.as_ref()?,
        Parameters::Total => laws.power_laws.params.as_ref()?,
    };
    exponent.exponent_ci95?;
    let width = |[low, high]: [f64; 2]| (high - low) / 2.0;
    let told = parts.iter().filter_map(|part| {
        let half = width(part.exponent_nonvocab?);
        Some(format!("{} ±{half:.3}", part.part))
    });
    let told: Vec<String> = told.collect();
    let missing = missing(laws).map_or(String::new(), |missing| format!("; not {missing}"));
    let one_seed = match laws.noise.map(|noise| noise.source) {
        Some(NoiseSource::Surface { .. }) => {
            " Too few cells have a second seed: the runs' noise is what a smooth surface through them leaves."
        }
        _ => "",
    };
    (!told.is_empty()).then(|| {
        format!(
            "Intervals hold, here for the exponent of {}: {}{missing}.{one_seed}{}",
            laws.parameters.size(),
            told.join(", "),
            of_test_split(laws)
        )
    })
}

/// What no interval holds.
fn missing(laws: &Laws) -> Option<&'static str> {
    let Judgement { tokenizer_noise: tokenizers, test_noise: test, .. } = &laws.judgement;
    match (tokenizers, test) {
        (None, None) if !laws.from_sweep => Some("what was not varied"),
        (Some(_), Some(_)) => None,
        (Some(_), None) => Some("the test split"),
        (None, Some(_)) => Some("the tokenizers, one a vocabulary"),
        (None, None) => Some("the test split and the tokenizers, one a vocabulary"),
    }
}

fn of_test_split(laws: &Laws) -> String {
    let told = |noise: &TestNoise| {
        let half = student_t95(noise.blocks - 1) * noise.sd;
        format!(
            " Losses are those on these test clips: on others of their kind all of them may lie up \
             to {half:.2} nats higher or lower (95 %)."
        )
    };
    laws.judgement.test_noise.as_ref().map_or(String::new(), told)
}
