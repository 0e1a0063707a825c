//! What types alone cannot say: every impossible setting, with its path and how to mend it.

pub mod engine;
mod grid;
mod repeated;
mod train;

use super::command::{CommandError, PLACEHOLDERS, TrainerCommand};
use super::nearest::nearest;
use crate::spec::{SpecError, TextEncoderKind};
use crate::sweep::problem::Problem;
use crate::sweep::sections::{Clips, DataSource, Sweep};

/// All problems of a sweep whose types are right.
pub fn check(sweep: &Sweep) -> Vec<Problem> {
    [
        name(sweep),
        data(sweep),
        text(sweep),
        grid::check(sweep),
        train::check(sweep),
        tokenizer(sweep),
        trainer(sweep),
        engine::check(sweep),
    ]
    .into_iter()
    .flatten()
    .collect()
}

fn name(sweep: &Sweep) -> Vec<Problem> {
    let allowed = |c: char| c.is_ascii_alphanumeric() || "-_.".contains(c);
    let good =
        !sweep.name.is_empty() && sweep.name.chars().all(allowed) && !sweep.name.starts_with('.');
    let mut problems = Vec::new();
    if !good {
        problems.push(
            Problem::value("name", format!("`{}` cannot name a folder", sweep.name))
                .with_help("use letters, digits, `-`, `_` and `.`"),
        );
    }
    if sweep.seeds.is_empty() {
        problems.push(Problem::value("seeds", "no seed, so no run").with_help("seeds: [0]"));
    }
    if sweep.generator.0.is_empty() {
        problems.push(Problem::value("generator", "no kind of generator, so no run"));
    }
    problems
}

fn data(sweep: &Sweep) -> Vec<Problem> {
    let data = &sweep.data;
    let mut problems = Vec::new();
    if data.source == DataSource::HumanMl3d && data.path.is_none() {
        problems.push(
            Problem::value("data", "`source: humanml3d` needs a `path`")
                .with_help("path: the folder that holds new_joint_vecs, texts and train.txt"),
        );
    }
    if data.source == DataSource::None && sweep.trainer.is_none() {
        problems.push(
            Problem::value("data.source", "without motion the built-in trainer has nothing to do")
                .with_help("name a `trainer`, or another source"),
        );
    }
    if data.clips == Clips::Count(0) {
        problems.push(Problem::value("data.clips", "no clip to train on"));
    }
    if data.val_clips == 0 || data.test_clips == 0 {
        problems.push(Problem::value("data", "`val_clips` and `test_clips` must be at least 1"));
    }
    problems
}

fn text(sweep: &Sweep) -> Vec<Problem> {
    let text = &sweep.text;
    let mut problems = Vec::new();
    if text.max_tokens == 0 || text.dim == 0 {
        problems.push(Problem::value("text", "`dim` and `max_tokens` must be at least 1"));
    }
    match (text.encoder, &text.path) {
        (TextEncoderKind::File, None) => problems.push(
            Problem::value("text", "`encoder: file` needs a `path`")
                .with_help("path: a file that experiments/embed_captions.py made"),
        ),
        (TextEncoderKind::HashedNgrams, Some(_)) => problems.push(
            Problem::value("text.path", "`encoder: hashed-ngrams` reads no file")
                .with_help("take `path` out, or set `encoder: file`"),
        ),
        (TextEncoderKind::File, Some(_)) | (TextEncoderKind::HashedNgrams, None) => {}
    }
    problems
}

fn tokenizer(sweep: &Sweep) -> Vec<Problem> {
    let problem =
        sweep.tokenizer.check().err().map(|SpecError { field, problem }| {
            Problem::value(format!("tokenizer.{field}"), problem)
        });
    problem.into_iter().collect()
}

fn trainer(sweep: &Sweep) -> Vec<Problem> {
    let Some(trainer) = &sweep.trainer else { return Vec::new() };
    let Err(error) = TrainerCommand::parse(&trainer.command) else { return Vec::new() };
    let help = match &error {
        CommandError::Unknown(name) => nearest(name, &PLACEHOLDERS),
        _ => "as `python3 train.py --spec {spec} --out {out}`".to_string(),
    };
    vec![Problem::value("trainer.command", error.to_string()).with_help(help)]
}
