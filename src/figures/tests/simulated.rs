//! A made-up sweep for tests: five models, four vocabularies, four budgets, two seeds.
//!
//! L_u = −E + A1/N_nv^α1 + A2/N_v^α2 + B/D^β (Tao et al. 2024, approach 3) with noise.

use crate::laws::*;
use crate::record::facts::LOSS_NORMALISED;
use crate::record::{Measured, Planned, RunRecord};
use crate::tokenizer::TokenizerMetrics;

use crate::figures::FigureInput;
use noise::Noise;

mod laws;
mod noise;

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
    let laws = laws::laws(&mut noise);
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
        k_means: None,
    }
}
