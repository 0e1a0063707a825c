//! Checks beyond types: every impossible setting, with its path and remedy.

pub mod engine;
mod grid;
mod vary;

use super::problem::{Problem, nearest};
use super::sections::{CommandError, PLACEHOLDERS, ScheduleKind, Sweep, TrainerCommand};
use crate::spec::{DataSource, GeneratorKind, KeyProblem, Precision, Scales, SpecError, is_torch};

/// All problems of a sweep whose types are right.
pub fn check(sweep: &Sweep) -> Vec<Problem> {
    let mut problems = of_one_variant(sweep);
    problems.extend(vary::problems(sweep, of_one_variant));
    problems
}

/// The problems that do not come from varied keys.
fn of_one_variant(sweep: &Sweep) -> Vec<Problem> {
    [
        name(sweep),
        generators(sweep),
        data(sweep),
        of_section("text", sweep.text.problems()),
        grid::check(sweep),
        training(sweep),
        tokenizer(sweep),
        trainer(sweep),
        evaluator(sweep),
        scores(sweep),
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
        let problem = Problem::value("name", format!("`{}` cannot name a folder", sweep.name));
        problems.push(problem.with_help("use letters, digits, `-`, `_` and `.`"));
    }
    if sweep.seeds.is_empty() {
        problems.push(Problem::value("seeds", "no seed, so no run").with_help("seeds: [0]"));
    }
    if sweep.generator.0.is_empty() {
        problems.push(Problem::value("generator", "no kind of generator, so no run"));
    }
    problems
}

/// Some generators make codes of several scales, and some of one length.
fn generators(sweep: &Sweep) -> Vec<Problem> {
    let quantizer = sweep.tokenizer.quantizer();
    let has_scales = quantizer.n_codebooks() > 1;
    let has_lengths = quantizer.scale_lengths().len() > 1;
    let problem = |kind: &GeneratorKind| {
        let (problem, help) = match kind.scales() {
            Scales::Several if !has_scales => (
                "makes codes scale after scale, and the quantizer has one",
                "tokenizer: {kind: patch, quantizer: {kind: multiscale}}",
            ),
            Scales::OneLength if has_lengths => (
                "makes codes of one length, and the quantizer has scales of several",
                "tokenizer: {kind: patch, quantizer: {kind: residual}}",
            ),
            _ => return None,
        };
        let problem = format!("`{}` {problem}", kind.name());
        Some(Problem::value("generator", problem).with_help(help))
    };
    sweep.generator.0.iter().filter_map(problem).collect()
}

fn data(sweep: &Sweep) -> Vec<Problem> {
    let mut problems = of_section("data", sweep.data.problems());
    if sweep.data.source == DataSource::None && sweep.trainer.is_none() {
        let problem = "without motion the built-in trainer has nothing to do";
        let problem = Problem::value("data.source", problem);
        problems.push(problem.with_help("name a `trainer`, or another source"));
    }
    problems
}

fn of_section(section: &str, problems: Vec<KeyProblem>) -> Vec<Problem> {
    let problem = |KeyProblem { field, problem, help }| {
        let path =
            if field.is_empty() { section.to_string() } else { format!("{section}.{field}") };
        Problem { help: help.map(Into::into), ..Problem::value(path, problem) }
    };
    problems.into_iter().map(problem).collect()
}

fn tokenizer(sweep: &Sweep) -> Vec<Problem> {
    let problem =
        sweep.tokenizer.check().err().map(|SpecError { field, problem }| {
            Problem::value(format!("tokenizer.{field}"), problem)
        });
    problem.into_iter().collect()
}

/// An evaluator is trained on motion.
fn evaluator(sweep: &Sweep) -> Vec<Problem> {
    let Some(evaluator) = &sweep.evaluator else { return Vec::new() };
    let mut problems = of_section("evaluator", evaluator.problems());
    if sweep.data.source == DataSource::None {
        let problem = "an evaluator is trained on motion, and `data.source` is none";
        problems.push(Problem::value("evaluator", problem));
    }
    problems
}

/// Scores are taken by an evaluator, of runs whose weights are at hand.
fn scores(sweep: &Sweep) -> Vec<Problem> {
    let Some(scores) = &sweep.scores else { return Vec::new() };
    let mut problems = of_section("scores", scores.problems());
    if sweep.evaluator.is_none() {
        let problem = Problem::value("scores", "no evaluator to score by");
        problems.push(problem.with_help("evaluator: {}"));
    }
    problems.extend(grid::conditions("scores.only", &scores.only));
    problems
}

fn trainer(sweep: &Sweep) -> Vec<Problem> {
    let Some(trainer) = &sweep.trainer else { return Vec::new() };
    if is_torch(&trainer.command) && sweep.train.precision == Precision::F16 {
        let problem = "the torch trainer computes in f32 or bf16";
        return vec![Problem::value("train.precision", problem).with_help("precision: bf16")];
    }
    let Err(error) = TrainerCommand::parse(&trainer.command) else { return Vec::new() };
    let help = match &error {
        CommandError::Unknown(name) => nearest(name, &PLACEHOLDERS),
        _ => "as `python3 train.py --spec {spec} --out {out}`".to_string(),
    };
    vec![Problem::value("trainer.command", error.to_string()).with_help(help)]
}

/// Problems of `train` and `fit`, beside the ranges of their numbers.
fn training(sweep: &Sweep) -> Vec<Problem> {
    let train = &sweep.train;
    let (schedule, batch) = (&train.schedule, &train.batch);
    let wsd = schedule.kind == ScheduleKind::Wsd;
    let whole = "a trainer of one's own trains each run whole: take `share` out";
    let rules = [
        (
            !schedule.share || wsd,
            "train.schedule.share",
            "only runs of `kind: wsd` begin alike and can share a trunk",
        ),
        (!schedule.share || sweep.trainer.is_none(), "train.schedule.share", whole),
        (
            !wsd || schedule.warmup + schedule.decay <= 1.0,
            "train.schedule.warmup",
            "warm-up and decay together are more than the run",
        ),
        (train.betas.len() == 2, "train.betas", "AdamW has two betas"),
        (batch.max >= batch.min, "train.batch.max", "must not be below `min`"),
        (!sweep.fit.minima.is_empty(), "fit.minima", "at least one kind of minimum"),
    ];
    let wrong = rules.into_iter().filter(|(good, ..)| !good);
    wrong.map(|(_, path, message)| Problem::value(path, message)).collect()
}
