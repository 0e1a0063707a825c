//! What a person reads of scored runs: a screen.

use std::fmt::Write;

use isoflop::jobs::ResultsFolder;
use isoflop::record::Quality;
use isoflop::scores::RankCorrelation;

use super::agreement::Agreement;
use super::best::Best;
use super::fid_law::{Curve, FidLaw};
use super::ranks::Ranks;

/// Runs, and budgets, that are listed, at most.
const LISTED: usize = 12;

/// Runs by FID, the best of each budget, laws and rank correlations.
pub fn text(
    folder: &ResultsFolder,
    rows: &[Quality],
    (ranks, agreements): (&[Ranks], &[Agreement]),
    (best, laws): (&[Best], &[FidLaw]),
) -> String {
    let mut text = format!(
        "{:<14} {:>5} {:>8} {:>8} {:>7}  {:<16} {}\n",
        "scored runs", "V", "N_nv", "C", "L_u", "FID", "R@1"
    );
    for row in rows.iter().take(LISTED) {
        let planned = &row.run.planned;
        let loss = row.run.loss_normalised().map_or("-".to_string(), |loss| format!("{loss:.3}"));
        let _ = writeln!(
            text,
            "{:<14} {:>5} {:>8} {:>8.1e} {loss:>7}  {:<16} {}",
            row.generator(),
            planned.n_vocab,
            planned.params_nonvocab,
            planned.budget_flops,
            with_interval(row, "fid", 4),
            with_interval(row, "r_precision_1", 3),
        );
    }
    if rows.len() > LISTED {
        let _ = writeln!(text, "  and {} more", rows.len() - LISTED);
    }
    let truth = with_interval(&rows[0], "truth_r_precision_1", 3);
    let _ = writeln!(text, "true motions: R@1 {truth}; means and 95 % intervals of repeats");
    text += &of_budgets(best);
    laws.iter().for_each(|law| text += &of_law(law));
    text += &of_ranks(ranks);
    text += &of_agreements(agreements);
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

/// Whether loss orders runs as their motions do; nothing where each generator has too few.
fn of_ranks(ranks: &[Ranks]) -> String {
    let told: Vec<&Ranks> = ranks.iter().filter(|ranks| ranks.fid.is_some()).collect();
    if told.is_empty() {
        return String::new();
    }
    let mut text = format!("{:<28}{:<24}R@1\n", "rank correlation with L_u", "FID");
    for Ranks { generator, fid, r_precision_1 } in told {
        text += &of_correlations(generator, *fid, *r_precision_1);
    }
    text
}

/// Whether other evaluators order the runs alike.
fn of_agreements(agreements: &[Agreement]) -> String {
    if agreements.is_empty() {
        return String::new();
    }
    let mut text = format!("{:<28}{:<24}R@1\n", "with those by evaluator", "FID");
    for Agreement { evaluator_id, fid, r_precision_1 } in agreements {
        text += &of_correlations(evaluator_id, Some(*fid), Some(*r_precision_1));
    }
    text
}

fn of_correlations(
    name: &str,
    fid: Option<RankCorrelation>,
    r_precision_1: Option<RankCorrelation>,
) -> String {
    let shown = |rank: Option<RankCorrelation>| {
        rank.map_or("-".to_string(), |RankCorrelation { value, interval: [low, high], .. }| {
            format!("{value:.2} ({low:.2} to {high:.2})")
        })
    };
    format!("{name:<28}{:<24}{}\n", shown(fid), shown(r_precision_1))
}

/// The best run of each budget by loss, and by FID.
fn of_budgets(best: &[Best]) -> String {
    let mut text = format!(
        "\n{:<14} {:>8}  {:>8} {:>5} {:>7}  {:>8} {:>5} {:>7}\n",
        "best", "C", "L_u:N_nv", "V", "FID", "FID:N_nv", "V", "FID"
    );
    for Best { generator, budget_flops, by_loss, by_fid } in best.iter().take(LISTED) {
        let _ = writeln!(
            text,
            "{generator:<14} {budget_flops:>8.1e}  {:>8} {:>5} {:>7.4}  {:>8} {:>5} {:>7.4}",
            by_loss.params_nonvocab,
            by_loss.n_vocab,
            by_loss.fid,
            by_fid.params_nonvocab,
            by_fid.n_vocab,
            by_fid.fid,
        );
    }
    if best.len() > LISTED {
        let _ = writeln!(text, "  and {} more", best.len() - LISTED);
    }
    text + "\n"
}

fn with_interval(row: &Quality, name: &str, digits: usize) -> String {
    let score = row.scores.iter().find(|(own, _)| *own == name).and_then(|(_, score)| *score);
    score.map_or("-".to_string(), |score| score.shown(digits))
}
