//! Laws of the made-up sweep.

use super::noise::Noise;
use super::{BUDGETS, loss};
use crate::laws::*;

/// The best point of a budget over a fine grid of models four layers deep.
fn minimum(method: MinimumMethod, budget_flops: f64, noise: &mut Noise) -> Minimum {
    let candidate = |d: f64, v: f64| {
        let (nonvocab, vocab) = (48.0 * d * d, v * d);
        let tokens = budget_flops / 6.0 / (nonvocab + vocab);
        (loss(nonvocab, vocab, tokens), nonvocab, v, tokens)
    };
    let widths = (0..120).map(|i| 16.0 * 1.03f64.powi(i));
    let all = widths.flat_map(|d| (0..110).map(move |j| candidate(d, 32.0 * 1.05f64.powi(j))));
    let (loss, nonvocab, n_vocab, tokens) =
        all.min_by(|a, b| a.0.total_cmp(&b.0)).expect("the grid is not empty");
    let stray = (0.15 * noise.next()).exp();
    let params_nonvocab = nonvocab * stray;
    Minimum {
        flops: budget_flops,
        method,
        budget_flops,
        params_nonvocab,
        params_vocab: n_vocab * (nonvocab / 48.0).sqrt() * (0.2 * noise.next()).exp(),
        n_vocab,
        tokens: tokens / stray,
        loss_normalised: loss + 0.01 * noise.next(),
        ci95: None,
        flags: Vec::new(),
        trusted: true,
    }
}

/// The laws of the made-up sweep.
pub fn laws(noise: &mut Noise) -> Laws {
    let mut minima: Vec<_> =
        BUDGETS.map(|budget| minimum(MinimumMethod::Parabola, budget, noise)).to_vec();
    minima[0].flags = vec![MinimumFlag::NotBracketed];
    let reference = (BUDGETS[0] * BUDGETS[1] * BUDGETS[2]).cbrt();
    let law = |of: fn(&Minimum) -> f64, ci: Option<[f64; 2]>| {
        power_law(&minima[..3], |m| m.budget_flops, of, reference, ci)
    };
    let params_nonvocab = law(|m| m.params_nonvocab, Some([0.531, 0.664]));
    let params_vocab = law(|m| m.params_vocab, Some([0.442, 0.681]));
    let tokens = law(|m| m.tokens, Some([0.322, 0.447]));
    let line = regression(&minima[..3], |m| m.budget_flops.log10(), |m| m.loss_normalised);
    let centre =
        [&params_vocab, &params_nonvocab, &tokens].map(|law| (law.ln_at_reference, law.exponent));
    let bootstrap = (0..200).map(|_| replicate(centre, line, reference, noise)).collect();
    let at = |c: f64| line.0 + line.1 * c.log10();
    let held_out = minima[3].clone();
    let names = ("quickstart", "6nd");
    Laws {
        from_sweep: true,
        fitted_budgets: BUDGETS[..3].to_vec(),
        minima_method: MinimumMethod::Parabola,
        held_out: Some(HeldOut {
            budget_flops: BUDGETS[3],
            minimum: held_out.clone(),
            exponents: Exponents::default(),
        }),
        vocab_from_nonvocab: Some(power_law(
            &minima[..3],
            |m| m.params_nonvocab,
            |m| m.params_vocab,
            1e5,
            None,
        )),
        loss: LossLaws {
            log: Some(LogLaw {
                slope_per_decade: line.1,
                intercept: line.0,
                r2: 0.991,
                aic: -20.1,
                held_out_error: Some(at(BUDGETS[3]) - held_out.loss_normalised),
                slope_ci95: Some([line.1 - 0.04, line.1 + 0.03]),
                intercept_ci95: None,
                n: 3,
            }),
            floor: Some(FloorLaw {
                floor: -2.5,
                coefficient: at(reference) + 2.5,
                exponent: 0.155,
                r2: 0.998,
                aic: -27.4,
                held_out_error: Some(0.006),
                floor_ci95: None,
                coefficient_ci95: None,
                exponent_ci95: None,
                n: 3,
            }),
        },
        power_laws: PowerLaws {
            params_vocab: Some(params_vocab),
            params_nonvocab: Some(params_nonvocab),
            tokens: Some(tokens),
            ..PowerLaws::default()
        },
        minima,
        bootstrap,
        warnings: vec!["The minimum at 1e11 is not bracketed.".to_owned()],
        ..Laws::unfitted(LawKind::Isoflop, names, Parameters::Split, reference)
    }
}

fn regression(
    minima: &[Minimum],
    x: impl Fn(&Minimum) -> f64,
    y: impl Fn(&Minimum) -> f64,
) -> (f64, f64) {
    let n = minima.len() as f64;
    let mean = |of: &dyn Fn(&Minimum) -> f64| minima.iter().map(of).sum::<f64>() / n;
    let (mean_x, mean_y) = (mean(&x), mean(&y));
    let cross = mean(&|m| (x(m) - mean_x) * (y(m) - mean_y));
    let slope = cross / mean(&|m| (x(m) - mean_x).powi(2));
    (mean_y - slope * mean_x, slope)
}

fn power_law(
    minima: &[Minimum],
    x: fn(&Minimum) -> f64,
    y: fn(&Minimum) -> f64,
    reference: f64,
    exponent_ci95: Option<[f64; 2]>,
) -> PowerLaw {
    let (intercept, exponent) = regression(minima, |m| x(m).log10(), |m| y(m).log10());
    PowerLaw {
        log10_coefficient: intercept,
        exponent,
        ln_at_reference: (intercept + exponent * reference.log10()) * std::f64::consts::LN_10,
        r2: 0.987,
        exponent_ci95,
        ln_at_reference_ci95: None,
        log10_coefficient_ci95: None,
        n: minima.len(),
    }
}

fn replicate(
    [vocab, nonvocab, tokens]: [(f64, f64); 3],
    (intercept, slope): (f64, f64),
    reference: f64,
    noise: &mut Noise,
) -> LawSample {
    let mut near =
        |(at, exponent): (f64, f64)| (at + 0.1 * noise.next(), exponent + 0.06 * noise.next());
    let (vocab, nonvocab, tokens) = (near(vocab), near(nonvocab), near(tokens));
    let turn = 0.04 * noise.next();
    LawSample {
        ln_vocab_at_reference: vocab.0,
        exponent_vocab: vocab.1,
        ln_nonvocab_at_reference: nonvocab.0,
        exponent_nonvocab: nonvocab.1,
        ln_tokens_at_reference: tokens.0,
        exponent_tokens: tokens.1,
        loss_intercept: intercept - turn * reference.log10() + 0.01 * noise.next(),
        loss_slope_per_decade: slope + turn,
        floor: None,
    }
}
