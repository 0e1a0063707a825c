//! What a person reads of scored runs: a screen.

use std::fmt::Write;

use isoflop::jobs::ResultsFolder;
use isoflop::record::Quality;
use isoflop::scores::RankCorrelation;

use super::agreement::Agreement;
use super::best::{Best, Cell};
use super::fid_law::{Curve, FidLaw};
use super::ranks::{LossRanks, Ranks};
use crate::commands::screen::{dash, more, table};

/// Runs, and budgets, that are listed, at most.
const LISTED: usize = 12;

/// Runs by FID, the best of each budget, laws and rank correlations.
pub fn text(
    folder: &ResultsFolder,
    rows: &[Quality],
    (ranks, agreements): (&[LossRanks], &[Agreement]),
    (best, laws): (&[Best], &[FidLaw]),
) -> String {
    let row = |row: &Quality| {
        let planned = &row.run.planned;
        let [codes, size] = [planned.n_vocab, planned.params_nonvocab].map(|n| n.to_string());
        let budget = format!("{:.1e}", planned.budget_flops);
        let loss = dash(row.run.loss_normalised().ok(), |loss| format!("{loss:.3}"));
        let [fid, first] = [with_interval(row, "fid", 4), with_interval(row, "r_precision_1", 3)];
        [row.generator().to_string(), codes, size, budget, loss, fid, first]
    };
    let heads = ["<scored runs", "V", "N_nv", "C", "L_u", "<FID", "<R@1"];
    let mut text = table(heads, rows.iter().take(LISTED).map(row));
    text += &more(rows.len(), LISTED, "");
    let truth = with_interval(&rows[0], "truth_r_precision_1", 3);
    let _ = writeln!(text, "true motions: R@1 {truth}; means and 95 % intervals of repeats");
    text += &of_budgets(best);
    laws.iter().for_each(|law| text += &of_law(law));
    // Nothing of generators that have too few runs.
    let ranks = ranks.iter().filter(|own| own.ranks.fid.is_some());
    let ranks = ranks.map(|own| (&own.generator, &own.ranks)).collect();
    text += &of_ranks("<rank correlation with L_u", ranks);
    let agreements = agreements.iter().map(|own| (&own.evaluator_id, &own.ranks)).collect();
    text += &of_ranks("<with those by evaluator", agreements);
    let root = folder.root().display();
    let evaluator = &rows[0].evaluator_id;
    let _ = writeln!(text, "{root}/scores.parquet, {root}/figures/quality.svg");
    text + &format!("comparable only with scores of the same evaluator, {evaluator}")
}

/// A law, and what becomes of it as budgets are left out, one at a time.
fn of_law(law: &FidLaw) -> String {
    let FidLaw { generator, reference_flops, curve, floor_range, exponent_range, budgets } = law;
    let Curve { floor, coefficient, exponent } = curve;
    let ([least, most], [slowest, fastest]) = (floor_range, exponent_range);
    let curve = format!("{floor:.3} + {coefficient:.3} (C / {reference_flops:.0e})^-{exponent:.2}");
    format!(
        "FID of {generator}: {curve}, {budgets} budgets;\n  one left out: floor {least:.3} to {most:.3}, \
         exponent {slowest:.2} to {fastest:.2}\n"
    )
}

/// Whether runs are ordered alike by what the title says, one after another; nothing of nobody.
fn of_ranks(title: &str, all: Vec<(&String, &Ranks)>) -> String {
    if all.is_empty() {
        return String::new();
    }
    let shown = |rank: Option<RankCorrelation>| {
        dash(rank, |RankCorrelation { value, interval: [low, high], .. }| {
            format!("{value:.2} ({low:.2} to {high:.2})")
        })
    };
    let row = |(name, ranks): (&String, &Ranks)| {
        [name.clone(), shown(ranks.fid), shown(ranks.r_precision_1)]
    };
    table([title, "<FID", "<R@1"], all.into_iter().map(row))
}

/// The best run of each budget by loss, and by FID.
fn of_budgets(best: &[Best]) -> String {
    let cell = |Cell { params_nonvocab, n_vocab, fid, .. }: &Cell| {
        [params_nonvocab.to_string(), n_vocab.to_string(), format!("{fid:.4}")]
    };
    let row = |Best { generator, budget_flops, by_loss, by_fid }: &Best| {
        let ([size, codes, fid], [size_by, codes_by, fid_by]) = (cell(by_loss), cell(by_fid));
        let budget = format!("{budget_flops:.1e}");
        [generator.clone(), budget, size, codes, fid, size_by, codes_by, fid_by]
    };
    let heads = ["<best", "C", "L_u:N_nv", "V", "FID", "FID:N_nv", "V", "FID"];
    let rows = table(heads, best.iter().take(LISTED).map(row));
    format!("\n{rows}{}\n", more(best.len(), LISTED, ""))
}

fn with_interval(row: &Quality, name: &str, digits: usize) -> String {
    let score = row.scores.iter().find(|(own, _)| *own == name).and_then(|(_, score)| *score);
    dash(score, |score| score.shown(digits))
}
