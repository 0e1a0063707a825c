//! The fit in a few sentences.

use super::names::{flags_text, law_name};
use super::text::count;
use super::warnings::ONE_VOCABULARY;
use super::{LawKind, Laws, Minimum, MinimumFlag, Parameters, PowerLaw, Sensitivity};

/// Two values of γ, or of an exponent by two methods, that differ by more than this disagree.
const DISAGREEMENT: f64 = 0.1;
/// An exponent whose 95 % interval is wider than this is not identified.
const UNIDENTIFIED: f64 = 0.5;

/// What the laws say, and how far to trust them, in plain sentences.
///
/// Every flagged minimum of the laws' method is named, and γ, the exponent of N_v in N_nv, is given
/// both ways: as the ratio of the exponents in C, and by the direct fit (ScaMo Eq. 10).
pub fn verdict(laws: &Laws) -> Vec<String> {
    let mut sentences = vec![scope(laws)];
    sentences.extend(exponents(laws));
    sentences.extend(not_identified(laws));
    sentences.extend(gamma(laws));
    sentences.extend(loss(laws));
    sentences.extend(methods_disagree(laws));
    sentences.extend(flagged(laws));
    sentences
}

fn scope(laws: &Laws) -> String {
    let held_out = match &laws.held_out {
        Some(held_out) => format!("; {} was held out", count(held_out.budget_flops)),
        None => String::new(),
    };
    let rule = &laws.flops_rule;
    let (Some(first), Some(last)) = (laws.fitted_budgets.first(), laws.fitted_budgets.last())
    else {
        return format!("{}: published laws (FLOP rule {rule}), not fitted here.", laws.name);
    };
    let range = format!("from {} to {} FLOPs (rule {rule})", count(*first), count(*last));
    match (laws.law, &laws.parametric) {
        (LawKind::Approach1, _) => format!(
            "{}: laws fitted to the running minimum of the loss, {range} (approach 1).",
            laws.name
        ),
        (_, Some(parametric)) => format!(
            "{}: {} fitted to {} runs {range} (approach 3).",
            laws.name,
            parametric.coefficients.form.equation(),
            parametric.n
        ),
        _ => format!(
            "{}: laws fitted to the {} minima of {} budgets {range}{held_out}.",
            laws.name,
            laws.minima_method,
            laws.fitted_budgets.len(),
        ),
    }
}

fn exponents(laws: &Laws) -> Option<String> {
    let part = |(name, law): (&str, &PowerLaw)| format!("{name} as C^{}", exponent(law));
    let parts: Vec<String> = law_name(laws).into_iter().map(part).collect();
    (!parts.is_empty()).then(|| format!("The optimum grows: {}.", parts.join(", ")))
}

fn exponent(law: &PowerLaw) -> String {
    match law.exponent_ci95 {
        Some([low, high]) => format!("{:.3} ({low:.3} to {high:.3})", law.exponent),
        None => format!("{:.3}", law.exponent),
    }
}

/// A sentence for every exponent that the runs do not tell.
fn not_identified(laws: &Laws) -> Vec<String> {
    let unknown = |(name, law): (&str, &PowerLaw)| {
        let [low, high] = law.exponent_ci95?;
        let why = if low <= 0.0 && high >= 0.0 {
            "holds 0"
        } else if high - low > UNIDENTIFIED {
            "is wider than 0.5"
        } else {
            return None;
        };
        Some(format!(
            "The exponent of {name} is not identified: its interval, {low:.3} to {high:.3}, {why}."
        ))
    };
    let one_vocabulary = laws.warnings.iter().any(|warning| warning == ONE_VOCABULARY);
    let intervals = law_name(laws).into_iter().filter_map(unknown);
    intervals.chain(one_vocabulary.then(|| ONE_VOCABULARY.into())).collect()
}

fn gamma(laws: &Laws) -> Option<String> {
    let (vocab, nonvocab) =
        (laws.power_laws.params_vocab.as_ref()?, laws.power_laws.params_nonvocab.as_ref()?);
    let direct = laws.vocab_from_nonvocab.as_ref()?;
    let ratio = vocab.exponent / nonvocab.exponent;
    let judgement = if (ratio - direct.exponent).abs() > DISAGREEMENT {
        "the two disagree, so quote neither alone"
    } else if ratio.min(direct.exponent) > 1.0 {
        "the vocabulary should grow faster than the model"
    } else {
        "the vocabulary need not grow faster than the model"
    };
    Some(format!(
        "N_v grows as N_nv^{ratio:.3} by the ratio of the exponents in C, and as N_nv^{} by the \
         direct fit (Eq. 10): {judgement}.",
        exponent(direct)
    ))
}

fn loss(laws: &Laws) -> Option<String> {
    let log = laws.loss.log.as_ref()?;
    let falls = format!(
        "{} changes by {:.3} nats per decade of C",
        laws.loss_symbol(),
        log.slope_per_decade
    );
    // A floor at its bound is the log law again, and no guide of its own.
    let floor = laws.loss.floor.as_ref().filter(|law| !law.is_at_bound());
    match (log.held_out_error, floor.and_then(|law| law.held_out_error)) {
        (Some(log), Some(floor)) => {
            let better = if floor.abs() < log.abs() { "floor" } else { "log" };
            Some(format!(
                "{falls}; at the held-out budget the log law is off by {log:+.4} and the floor law \
                 by {floor:+.4}, so the {better} law extrapolates better here."
            ))
        }
        (Some(log), None) => {
            Some(format!("{falls}; at the held-out budget the log law is off by {log:+.4}."))
        }
        _ => Some(format!("{falls}; no budget was held out to test that.")),
    }
}

/// The two kinds of minimum whose exponents of N_nv lie furthest apart, where that is far.
fn methods_disagree(laws: &Laws) -> Option<String> {
    let rows = laws.sensitivity.iter();
    let size = laws.parameters.size();
    let known = || rows.clone().filter_map(|r| Some((own_exponent(laws, r)?, r.variant.as_str())));
    let (low, low_name) = known().min_by(|a, b| a.0.total_cmp(&b.0))?;
    let (high, high_name) = known().max_by(|a, b| a.0.total_cmp(&b.0))?;
    (high - low > DISAGREEMENT).then(|| {
        format!(
            "The exponent of {size} depends on a choice: {low:.3} ({low_name}) against {high:.3} \
             ({high_name})."
        )
    })
}

/// The exponent of what the laws take for the size.
fn own_exponent(laws: &Laws, row: &Sensitivity) -> Option<f64> {
    match laws.parameters {
        Parameters::Split => row.exponent_nonvocab,
        Parameters::Total => row.exponent_params,
    }
}

fn flagged(laws: &Laws) -> impl Iterator<Item = String> {
    let own = laws.minima.iter().filter(|m| m.method == laws.minima_method);
    own.filter(|m| !m.flags.is_empty()).map(|m| {
        let reasons: Vec<_> = m.flags.iter().map(|flag| reason(*flag)).collect();
        let fitted = if is_fitted(laws, m) { "used all the same" } else { "not fitted" };
        format!(
            "Budget {} ({}, {fitted}): {}.",
            count(m.budget_flops),
            flags_text(&m.flags),
            reasons.join("; ")
        )
    })
}

fn is_fitted(laws: &Laws, minimum: &Minimum) -> bool {
    laws.fitted_budgets.contains(&minimum.budget_flops)
}

fn reason(flag: MinimumFlag) -> &'static str {
    match flag {
        MinimumFlag::NotBracketed => {
            "the best model is the smallest or largest tried, so add sizes on that side"
        }
        MinimumFlag::NotConvex => "the loss has no minimum in the model size",
        MinimumFlag::WeakCurvature => "the curve is flat within its noise, so add sizes or seeds",
        MinimumFlag::FewLevels => "too few model sizes for a curve",
        MinimumFlag::VocabNotBracketed => {
            "the best vocabulary is the smallest or largest tried, so add vocabularies on that side"
        }
        MinimumFlag::EdgeVocab => {
            "a size beside the minimum is best with the smallest or largest vocabulary tried"
        }
        MinimumFlag::LackOfFit => "the runs lie further from the curve than they scatter",
        MinimumFlag::BelowRuns => {
            "the curve lies further below the best run than noise allows, so it is not used"
        }
        MinimumFlag::Gap => "the sizes on either side are more than a factor 2.5 apart",
        MinimumFlag::DepthChange => "the models on either side differ in depth",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::scamo;

    #[test]
    fn the_published_gammas_are_given_both_ways_and_called_inconsistent() {
        let sentences = verdict(&scamo()).join("\n");
        assert!(sentences.contains("N_nv^1.316"), "{sentences}");
        assert!(sentences.contains("N_nv^1.467"), "{sentences}");
        assert!(sentences.contains("disagree"), "{sentences}");
    }

    #[test]
    fn an_exponent_whose_interval_is_wide_or_holds_0_is_not_identified() {
        let mut laws = scamo();
        let naming = |laws: &Laws| {
            verdict(laws).into_iter().filter(|s| s.contains("not identified")).collect::<Vec<_>>()
        };
        assert!(naming(&laws).is_empty());
        let set = |law: &mut Option<PowerLaw>, ci| law.as_mut().unwrap().exponent_ci95 = Some(ci);
        set(&mut laws.power_laws.params_nonvocab, [0.5, 0.6]);
        set(&mut laws.power_laws.params_vocab, [-0.1, 0.3]);
        set(&mut laws.power_laws.tokens, [0.1, 0.7]);
        let sentences = naming(&laws);
        assert_eq!(sentences.len(), 2, "{sentences:?}");
        assert!(sentences[0].contains("of N_v") && sentences[0].contains("holds 0"));
        assert!(sentences[1].contains("of D") && sentences[1].contains("wider than 0.5"));
    }

    #[test]
    fn every_flagged_minimum_is_named() {
        let mut laws = scamo();
        let minimum = |budget_flops, flags| Minimum {
            method: laws.minima_method,
            budget_flops,
            flops: budget_flops,
            params_nonvocab: 1.0,
            params_vocab: 1.0,
            n_vocab: 1.0,
            tokens: 1.0,
            loss_normalised: -1.0,
            ci95: None,
            trusted: false,
            flags,
        };
        laws.minima = vec![
            minimum(1e15, vec![MinimumFlag::VocabNotBracketed]),
            minimum(3e15, vec![]),
            minimum(1e16, vec![MinimumFlag::NotBracketed, MinimumFlag::WeakCurvature]),
        ];
        let sentences = verdict(&laws);
        let naming = |budget: &str| sentences.iter().filter(|s| s.contains(budget)).count();
        assert_eq!([naming("1e15"), naming("3e15"), naming("1e16")], [1, 0, 1], "{sentences:?}");
    }
}
