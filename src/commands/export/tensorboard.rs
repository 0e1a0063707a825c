//! Runs as TensorBoard reads them: a folder a run.

use std::path::PathBuf;

use anyhow::{Context, Result, bail};
use isoflop::files::tensorboard::{NAME, Scalar, events};
use isoflop::files::{atomic, read_text_if_there};
use isoflop::generator::LogLine;
use isoflop::record::{RunRecord, table};

use super::exporter::Exporter;

/// Loss and learning rate along the training of each run that is in the folder, and its result.
pub fn write(exporter: &Exporter) -> Result<Vec<PathBuf>> {
    exporter.needs(&["runs.parquet"])?;
    let mut paths = Vec::new();
    for record in table::read(exporter.folder.root())? {
        let log = exporter.folder.run(&record.planned.run_id).join("log.jsonl");
        let Some(lines) = read_text_if_there(&log)? else { continue };
        let lines = lines.lines().map(|line| {
            serde_json::from_str(line).with_context(|| format!("{} is damaged", log.display()))
        });
        let lines: Vec<LogLine> = lines.collect::<Result<_>>()?;
        let path = exporter.out.join(name(&record)).join(format!("{NAME}.0.isoflop"));
        atomic::write_bytes(&path, &events(&scalars(&record, &lines)))?;
        paths.push(path);
    }
    if paths.is_empty() {
        let runs = exporter.folder.file("runs");
        bail!("{} holds no log of a run: only the table was kept", runs.display());
    }
    Ok(paths)
}

/// `L2-d16-V240-C1e10-seed0`: what tells runs of a sweep apart, and their generator and tokenizer.
fn name(record: &RunRecord) -> String {
    let planned = &record.planned;
    let number = |value: Option<usize>| value.map_or("-".to_string(), |value| value.to_string());
    let (layers, d, v) = (number(planned.n_layer), number(planned.d_model), planned.n_vocab);
    let seed = planned.seed.unwrap_or_default();
    let (budget, id) = (planned.budget_flops, &planned.run_id);
    let generator = planned.generator.as_deref().unwrap_or("run");
    format!("{generator}-L{layers}-d{d}-V{v}-C{budget:e}-seed{seed}-{}", &id[..id.len().min(6)])
}

fn scalars(record: &RunRecord, lines: &[LogLine]) -> Vec<Scalar> {
    // The log holds no times: steps are taken to last alike.
    let steps = lines.last().map_or(1, |line| line.step.max(1));
    let wall_s = record.measured.wall_s.unwrap_or(0.0);
    let at = |line: &LogLine| wall_s * line.step as f64 / steps as f64;
    let of_line = |line: &LogLine| {
        let scalar = |tag, value| Scalar { tag, step: line.step, time_s: at(line), value };
        [
            scalar("train/loss_nats", line.train_loss_nats),
            scalar("train/lr", line.lr),
            scalar("train/tokens", line.tokens as f64),
            scalar("val/loss_normalised", line.val_loss_normalised),
        ]
    };
    let mut scalars: Vec<Scalar> = lines.iter().flat_map(of_line).collect();
    if let Ok(value) = record.loss_normalised() {
        scalars.push(Scalar { tag: "test/loss_normalised", step: steps, time_s: wall_s, value });
    }
    scalars
}
