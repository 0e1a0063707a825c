//! What `isoflop tune` says.

use anyhow::Result;
use isoflop::jobs::ResultsFolder;
use isoflop::rates::{CellRate, Rule};
use isoflop::sweep::{LrRule, ScheduleKind, Sweep};
use isoflop::words::wrap;
use serde_json::json;

use super::trials::Asked;
use crate::commands::screen::{dash, table};

/// What the next trials cost.
pub fn price(asked: &[Asked], so_far: usize) -> String {
    let runs = || asked.iter().filter_map(|asked| asked.run.as_ref());
    let flops: f64 = runs().map(|run| run.spec.budget_flops).sum();
    format!("{} trials, {flops:.2e} FLOPs; {so_far} so far", runs().count())
}

/// The best rate of each cell, the rule, and what it is worth.
pub fn text(rule: &Rule, n_trials: usize, folder: &ResultsFolder) -> String {
    let heads = ["C", "N_nv", "V", "D", "own lr", "best lr", "L_u", "gain"];
    let mut out = table(heads, rule.cells.iter().map(row));
    out += "\n";
    sentences(rule, n_trials).iter().for_each(|sentence| out += &wrap("- ", sentence));
    out + &format!("\n{}: the rule, as a sweep takes it\n", folder.file("rates.yaml").display())
}

fn row(cell: &CellRate) -> [String; 8] {
    let CellRate { place, optimal_lr, best_loss, own_loss, .. } = cell;
    [
        format!("{:e}", place.budget_flops),
        format!("{:.3e}", place.params_nonvocab),
        place.n_vocab.to_string(),
        format!("{:.2e}", place.tokens),
        format!("{:.4}", place.lr),
        format!("{optimal_lr:.4}"),
        format!("{best_loss:.3}"),
        dash(*own_loss, |own| format!("{:.3}", own - best_loss)),
    ]
}

fn sentences(rule: &Rule, n_trials: usize) -> Vec<String> {
    let nats = |regret: Option<f64>| dash(regret, |x| format!("{x:.3}"));
    let [exponent, error] = rule.vocab_exponent;
    let known = if exponent.abs() > 2.0 * error { "which the rule leaves out" } else { "none" };
    let mut all = vec![
        format!(
            "{n_trials} trials: lr = {}, {} nats above each cell's own best ({} where the cell took no \
             part in the fit); the sweep's own rule is {} above.",
            formula(&rule.lr),
            nats(rule.regret),
            nats(rule.regret_left_out),
            nats(rule.regret_own)
        ),
        format!(
            "At one N_nv and D the best rate goes as V^{exponent:.2} (standard error {error:.2}): {known}."
        ),
    ];
    all.push(match rule.batch_gain {
        Some([gain, error]) => format!(
            "A batch of {} times the sweep's changes L_u by {gain:+.3} nats (standard error {error:.3}).",
            2f64.powi(rule.batch_doublings)
        ),
        None => "No other batch is better than the sweep's.".into(),
    });
    if let Some([gain, error]) = rule.schedule_gain {
        all.push(format!(
            "The other schedule changes L_u by {gain:+.3} nats (standard error {error:.3}): {} is taken.",
            match rule.schedule {
                ScheduleKind::Cosine => "the cosine",
                ScheduleKind::Wsd => "wsd",
            }
        ));
    }
    all
}

fn formula(lr: &LrRule) -> String {
    let tokens = if lr.tokens_exponent == 0.0 {
        String::new()
    } else {
        format!(" D^{}", lr.tokens_exponent)
    };
    format!("{} N_nv^{}{tokens}", lr.coefficient, lr.params_exponent)
}

/// The rule as the `train` section of a sweep.
pub fn yaml(rule: &Rule, sweep: &Sweep) -> Result<String> {
    let mut schedule = sweep.train.schedule.clone();
    schedule.kind = rule.schedule;
    let section = json!({ "train": { "schedule": schedule, "lr": rule.lr, "batch": rule.batch } });
    let head =
        format!("# Found by `isoflop tune` at {} cells of {}.\n", rule.cells.len(), sweep.name);
    Ok(head + &serde_yaml::to_string(&section)?)
}
