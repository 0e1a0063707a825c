//! A made-up sweep for tests: five models, four vocabularies, four budgets, two seeds.
//!
//! L_u = −E + A1/N_nv^α1 + A2/N_v^α2 + B/D^β (Tao et al. 2024, approach 3) with noise.

use crate::codes::TokenizerMetrics;
use crate::figures::FigureInput;
use crate::laws::*;
use crate::record::facts::LOSS_NORMALISED;
use crate::record::{Measured, Planned, RunRecord};

const SHAPES: [(usize, usize, usize); 5] =
    [(2, 2, 32), (2, 4, 64), (4, 4, 64), (4, 4, 128), (6, 6, 192)];
const VOCABS: [usize; 4] = [64, 256, 1024, 4096];
const BUDGETS: [f64; 4] = [1e11, 3e11, 1e12, 3e12];

/// Runs, laws and tokenizers of the made-up sweep.
pub struct Simulated {
    pub records: Vec<RunRecord>,
    pub laws: Laws,
    pub tokenizers: Vec<TokenizerMetrics>,
}

impl Simulated {
    pub fn input(&self) -> FigureInput<'_> {
        FigureInput {
            title: "quickstart",
            loss_name: None,
            records: &self.records,
            laws: Some(&self.laws),
            tokenizers: &self.tokenizers,
        }
    }
}

pub fn sweep() -> Simulated {
    let mut noise = Noise(1);
    let records = records(&SHAPES, &VOCABS, &BUDGETS, &mut noise);
    let laws = laws(&mut noise);
    Simulated { records, laws, tokenizers: tokenizers(&mut noise) }
}

fn loss(nonvocab: f64, vocab: f64, tokens: f64) -> f64 {
    -2.5 + 20.0 / nonvocab.powf(0.35) + 8.0 / vocab.powf(0.3) + 25.0 / tokens.powf(0.35)
}

fn nonvocab((n_layer, _, d_model): (usize, usize, usize)) -> usize {
    12 * n_layer * d_model * d_model + (2 * n_layer + 1) * d_model
}

/// More than any panel holds with ease: eight models, nine vocabularies, seven budgets.
pub fn large_grid() -> Vec<RunRecord> {
    let shapes = [
        (6, 6, 384),
        (8, 8, 512),
        (12, 12, 768),
        (24, 16, 1024),
        (36, 20, 1280),
        (48, 24, 1536),
        (24, 32, 3200),
        (48, 32, 3200),
    ];
    let vocabs = [240, 512, 1000, 1920, 4375, 8640, 15360, 32000, 64000];
    let budgets = [1e15, 3e15, 1e16, 3e16, 1e17, 3e17, 1e18];
    records(&shapes, &vocabs, &budgets, &mut Noise(3))
}

fn records(
    shapes: &[(usize, usize, usize)],
    vocabs: &[usize],
    budgets: &[f64],
    noise: &mut Noise,
) -> Vec<RunRecord> {
    let mut records = Vec::new();
    for &shape in shapes {
        for &n_vocab in vocabs {
            for &budget in budgets {
                for seed in [0, 1] {
                    records.push(record(shape, n_vocab, budget, seed, noise));
                }
            }
        }
    }
    records
}

fn record(
    shape: (usize, usize, usize),
    n_vocab: usize,
    budget_flops: f64,
    seed: u64,
    noise: &mut Noise,
) -> RunRecord {
    let (n_layer, n_head, d_model) = shape;
    let (params_nonvocab, params_vocab) = (nonvocab(shape), n_vocab * d_model);
    let per_token = 6.0 * (params_nonvocab + params_vocab) as f64;
    let batch_tokens = 1568;
    let steps = (budget_flops / per_token / batch_tokens as f64).round().max(1.0) as usize;
    let tokens = steps * batch_tokens;
    let spent = per_token * tokens as f64;
    let loss_normalised =
        loss(params_nonvocab as f64, params_vocab as f64, tokens as f64) + 0.008 * noise.next();
    let planned = Planned {
        run_id: format!("{n_layer}x{d_model}-v{n_vocab}-c{budget_flops:e}-s{seed}"),
        seed: Some(seed),
        n_layer: Some(n_layer),
        n_head: Some(n_head),
        d_model: Some(d_model),
        d_ff: Some(8 * d_model / 3),
        n_vocab,
        budget_flops,
        params_nonvocab,
        params_vocab,
        ..Planned::default()
    };
    let measured = Measured {
        flops_openai: Some(spent * 1.05),
        flops_6nd: Some(spent),
        flops_exact: Some(spent * 1.1),
        tokens,
        unique_tokens: Some(1_000_000),
        ..Measured::default()
    };
    let metrics = [(LOSS_NORMALISED, loss_normalised)].into_iter().collect();
    RunRecord::new(planned, measured, metrics)
}

fn tokenizers(noise: &mut Noise) -> Vec<TokenizerMetrics> {
    let of_kind = |kind| VOCABS.map(|n_vocab| (kind, n_vocab));
    let all = [of_kind("fsq"), of_kind("vq")].concat();
    all.into_iter().map(|(kind, n_vocab)| tokenizer(kind, n_vocab, noise)).collect()
}

fn tokenizer(kind: &str, n_vocab: usize, noise: &mut Noise) -> TokenizerMetrics {
    let v = n_vocab as f64;
    let (used, even) = if kind == "fsq" { (0.03, 0.93) } else { (0.35, 0.72) };
    let utilisation = (1.0 - used * (v / 4096.0).powf(0.8)).min(1.0) - 0.004 * noise.next().abs();
    let l1 = 0.16 * v.powf(-0.14) * if kind == "fsq" { 1.0 } else { 1.06 };
    TokenizerMetrics {
        tokenizer_id: format!("{kind}-{n_vocab}"),
        architecture: None,
        kind: kind.to_owned(),
        n_vocab,
        levels: None,
        reconstruction_l1: l1 + 0.0005 * noise.next(),
        mpjpe_mm: 620.0 * l1 + noise.next(),
        mpjpe_heading_mm: None,
        val_mpjpe_mm: None,
        val_mpjpe_heading_mm: None,
        utilisation,
        exponential_entropy: (v * utilisation).powf(even),
        parameters: 1_200_000,
        train_steps: 4000,
        wall_s: 61.0,
        scales: None,
        frames_per_code: Some(4),
        seed: Some(0),
        continuity: None,
        continuity_by_source: None,
        k_means: None,
    }
}

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
fn laws(noise: &mut Noise) -> Laws {
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
    let vocab_from_nonvocab =
        power_law(&minima[..3], |m| m.params_nonvocab, |m| m.params_vocab, 1e5, None);
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
        vocab_from_nonvocab: Some(vocab_from_nonvocab),
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

/// Noise that is the same everywhere: splitmix64 (Steele et al. 2014), as a value in −1..1.
struct Noise(u64);

impl Noise {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
}
