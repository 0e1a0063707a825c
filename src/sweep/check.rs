//! What types alone cannot say: every impossible setting, with its path and how to mend it.

use super::check_engine;
use super::command::{CommandError, PLACEHOLDERS, TrainerCommand};
use super::condition::Condition;
use super::presets;
use super::problem::Problem;
use super::read::nearest;
use super::repeated;
use crate::spec::{SpecError, TextEncoderKind, VocabularyError};
use crate::sweep::sections::{Axis, Clips, DataSource, ModelList, ScheduleKind, Sweep, VocabSpec};

/// All problems of a sweep whose types are right.
pub fn check(sweep: &Sweep) -> Vec<Problem> {
    [
        name(sweep),
        data(sweep),
        text(sweep),
        models(sweep),
        vocab(sweep),
        budgets(sweep),
        zip(sweep),
        repeated::check(sweep),
        exclude(sweep),
        train(sweep),
        tokenizer(sweep),
        trainer(sweep),
        check_engine::check(sweep),
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

fn models(sweep: &Sweep) -> Vec<Problem> {
    match &sweep.grid.models {
        ModelList::Preset(name) if presets::models(name).is_none() => {
            vec![
                Problem::value("grid.models", format!("no preset is named `{name}`"))
                    .with_help(nearest(name, &presets::NAMES)),
            ]
        }
        ModelList::Preset(_) => Vec::new(),
        ModelList::Rule(rule) if rule.d_model.is_empty() || rule.head_dim == 0 => {
            vec![Problem::value("grid.models", "the rule makes no model")]
        }
        ModelList::Rule(rule) if rule.width_per_layer == 0 => {
            vec![Problem::value("grid.models.width_per_layer", "must be at least 1")]
        }
        ModelList::List(list) if list.is_empty() => {
            vec![Problem::value("grid.models", "no model, so no run")]
        }
        _ => every_model(sweep),
    }
}

fn every_model(sweep: &Sweep) -> Vec<Problem> {
    let models = crate::sweep::models(&sweep.grid.models);
    models
        .iter()
        .enumerate()
        .filter_map(|(i, model)| {
            let (d, h) = (model.d_model, model.n_head);
            let wrong = if model.n_layer == 0 || h == 0 || d == 0 || model.d_ff == Some(0) {
                "n_layer, n_head, d_model and d_ff must be at least 1".to_string()
            } else if d % h != 0 {
                format!("{h} heads do not divide a width of {d}")
            } else if d / h % 2 != 0 {
                format!("heads of {} channels: RoPE turns pairs, so the number must be even", d / h)
            } else {
                return None;
            };
            Some(Problem::value(model_path(&sweep.grid.models, i), wrong))
        })
        .collect()
}

/// Where the model of an index stands: in a list, or as a width of a rule.
pub(super) fn model_path(models: &ModelList, i: usize) -> String {
    match models {
        ModelList::Rule(_) => format!("grid.models.d_model[{i}]"),
        _ => format!("grid.models[{i}]"),
    }
}

fn vocab(sweep: &Sweep) -> Vec<Problem> {
    let grid = &sweep.grid;
    if grid.vocab.is_empty() {
        return vec![Problem::value("grid.vocab", "no vocabulary, so no run")];
    }
    let kind = sweep.tokenizer.quantizer_kind();
    let wrong = |(i, entry): (usize, &VocabSpec)| {
        let VocabularyError { problem, help } = entry.quantizer(kind).err()?;
        let problem = Problem::value(format!("grid.vocab[{i}]"), problem);
        Some(help.into_iter().fold(problem, Problem::with_help))
    };
    grid.vocab.iter().enumerate().filter_map(wrong).collect()
}

/// FLOPs beyond which a budget is taken for a slip of the pen.
const LARGEST_BUDGET: f64 = 1e30;

fn budgets(sweep: &Sweep) -> Vec<Problem> {
    if sweep.grid.budgets.is_empty() {
        return vec![Problem::value("grid.budgets", "no budget, so no run")];
    }
    let listed = |path: &'static str, budgets: &[f64]| -> Vec<Problem> {
        let possible = |budget: f64| budget > 0.0 && budget <= LARGEST_BUDGET;
        let wrong = budgets.iter().enumerate().filter(|(_, budget)| !possible(**budget));
        wrong
            .map(|(i, budget)| {
                Problem::value(format!("{path}[{i}]"), format!("a budget of {budget:e} FLOPs"))
                    .with_help(format!("above 0 and at most {LARGEST_BUDGET:e}"))
            })
            .collect()
    };
    let mut problems = listed("grid.budgets", &sweep.grid.budgets);
    problems.extend(listed("predict.budgets", &sweep.predict.budgets));
    problems
}

fn zip(sweep: &Sweep) -> Vec<Problem> {
    let grid = &sweep.grid;
    let length = |axis: &Axis| match axis {
        Axis::Models => crate::sweep::models(&grid.models).len(),
        Axis::Vocab => grid.vocab.len(),
        Axis::Budgets => grid.budgets.len(),
    };
    let mut seen = Vec::new();
    let mut problems = Vec::new();
    for (i, group) in grid.zip.iter().enumerate() {
        let path = format!("grid.zip[{i}]");
        let lengths: Vec<usize> = group.iter().map(length).collect();
        if lengths.windows(2).any(|pair| pair[0] != pair[1]) {
            let message = format!("zipped axes have lengths {lengths:?}");
            problems.push(Problem::value(path.clone(), message));
        }
        if group.iter().any(|axis| seen.contains(axis)) {
            problems.push(Problem::value(path, "an axis stands in two groups"));
        }
        seen.extend(group.iter().copied());
    }
    problems
}

fn exclude(sweep: &Sweep) -> Vec<Problem> {
    let parsed = sweep.grid.exclude.iter().enumerate();
    parsed
        .filter_map(|(i, text)| {
            let message = Condition::parse(text).err()?;
            Some(Problem::value(format!("grid.exclude[{i}]"), message))
        })
        .collect()
}

fn train(sweep: &Sweep) -> Vec<Problem> {
    let train = &sweep.train;
    let share = |x: f64| (0.0..=1.0).contains(&x);
    let rules = [
        (share(train.schedule.warmup), "train.schedule.warmup", "a share lies between 0 and 1"),
        (
            share(train.schedule.final_share),
            "train.schedule.final_share",
            "a share lies between 0 and 1",
        ),
        (
            train.schedule.decay > 0.0 && train.schedule.decay < 1.0,
            "train.schedule.decay",
            "a share lies between 0 and 1, both left out",
        ),
        (
            !train.schedule.share || train.schedule.kind == ScheduleKind::Wsd,
            "train.schedule.share",
            "only runs of `kind: wsd` begin alike and can share a trunk",
        ),
        (
            !train.schedule.share || sweep.trainer.is_none(),
            "train.schedule.share",
            "a trainer of one's own trains each run whole: take `share` out",
        ),
        (
            train.schedule.kind == ScheduleKind::Cosine
                || train.schedule.warmup + train.schedule.decay <= 1.0,
            "train.schedule.warmup",
            "warm-up and decay together are more than the run",
        ),
        (train.betas.len() == 2, "train.betas", "AdamW has two betas"),
        (
            train.betas.iter().all(|b| (0.0..1.0).contains(b)),
            "train.betas",
            "a beta lies in [0, 1)",
        ),
        (train.lr.coefficient > 0.0 && train.lr.max > 0.0, "train.lr", "a rate is above 0"),
        (train.batch.min > 0, "train.batch.min", "at least one token a step"),
        (train.batch.max >= train.batch.min, "train.batch.max", "must not be below `min`"),
        (train.min_steps > 0, "train.min_steps", "at least one step"),
        (train.weight_decay >= 0.0, "train.weight_decay", "must not be negative"),
        (train.clip_norm >= 0.0, "train.clip_norm", "must not be negative; 0 for none"),
        (train.epsilon >= 0.0, "train.epsilon", "must not be negative"),
        (
            (0.0..=1e9).contains(&train.checkpoint_s),
            "train.checkpoint_s",
            "seconds, between 0 and 1e9",
        ),
        (
            (0.0..=1e9).contains(&train.hang_s),
            "train.hang_s",
            "seconds, between 0 and 1e9; 0 for never",
        ),
        (sweep.model.rope_base > 0.0, "model.rope_base", "must be above 0"),
        (sweep.model.ffn_multiple > 0, "model.ffn_multiple", "must be at least 1"),
        (sweep.model.motion_slots > 2, "model.motion_slots", "must be at least 3"),
        (!sweep.fit.minima.is_empty(), "fit.minima", "at least one kind of minimum"),
    ];
    let wrong = rules.into_iter().filter(|(good, ..)| !good);
    wrong.map(|(_, path, message)| Problem::value(path, message)).collect()
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
