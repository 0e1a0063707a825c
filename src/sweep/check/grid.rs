//! Impossible settings of the grid: models, vocabularies, budgets and how they are combined.

use super::repeated::{self, model_path};
use crate::spec::VocabularyError;
use crate::sweep::condition::Condition;
use crate::sweep::model_lists;
use crate::sweep::nearest::nearest;
use crate::sweep::problem::Problem;
use crate::sweep::sections::{Axis, GridPart, GridSection, ModelList, Sweep, VocabSpec};

/// What is wrong with the grid.
pub fn check(sweep: &Sweep) -> Vec<Problem> {
    [
        models(sweep),
        vocab(sweep),
        budgets(sweep),
        cells(sweep),
        zip(sweep),
        repeated::check(sweep),
        conditions("grid.exclude", &sweep.grid.exclude),
        also(sweep),
    ]
    .concat()
}

/// What is wrong with further parts, each looked at as a grid of its own.
fn also(sweep: &Sweep) -> Vec<Problem> {
    let of_part = |(i, part): (usize, &GridPart)| {
        let own = Sweep { grid: part.alone(), ..sweep.clone() };
        let placed = move |problem: Problem| {
            let path = problem.path.strip_prefix("grid.")?;
            Some(Problem { path: format!("grid.also[{i}].{path}"), ..problem })
        };
        check(&own).into_iter().filter_map(placed)
    };
    sweep.grid.also.iter().enumerate().flat_map(of_part).collect()
}

fn models(sweep: &Sweep) -> Vec<Problem> {
    match &sweep.grid.models {
        ModelList::Named(name) if model_lists::models(name).is_none() => {
            vec![
                Problem::value("grid.models", format!("no list of models is named `{name}`"))
                    .with_help(nearest(name, &model_lists::NAMES)),
            ]
        }
        ModelList::Named(_) => Vec::new(),
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

fn vocab(sweep: &Sweep) -> Vec<Problem> {
    let grid = &sweep.grid;
    if grid.vocab.is_empty() {
        return vec![Problem::value("grid.vocab", "no vocabulary, so no run")];
    }
    let section = sweep.tokenizer.quantizer();
    if section.check().is_err() {
        // The problem is told at its own key.
        return Vec::new();
    }
    let wrong = |(i, entry): (usize, &VocabSpec)| {
        let VocabularyError { problem, help } = sweep.quantizer(entry).err()?;
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

/// Runs of a grid at most: a plan holds each of them.
const MOST_RUNS: f64 = 1e6;

/// Values of an axis.
fn length(grid: &GridSection, axis: &Axis) -> usize {
    match axis {
        Axis::Models => crate::sweep::models(&grid.models).len(),
        Axis::Vocab => grid.vocab.len(),
        Axis::Budgets => grid.budgets.len(),
    }
}

/// More runs than a plan can hold, axes that are zipped counted as one.
fn cells(sweep: &Sweep) -> Vec<Problem> {
    let length = |axis: &Axis| length(&sweep.grid, axis);
    let groups = Axis::groups(&sweep.grid.zip).into_iter();
    let lengths = groups.filter_map(|group| group.iter().map(length).max());
    let seeds = [sweep.seeds.len(), sweep.tokenizer.seeds.len(), sweep.generator.0.len()];
    let runs: f64 = lengths.chain(seeds).map(|n| n.max(1) as f64).product();
    let problem = || {
        Problem::value("grid", format!("makes {runs:e} runs"))
            .with_help(format!("at most {MOST_RUNS:e}; list fewer values"))
    };
    (runs > MOST_RUNS).then(problem).into_iter().collect()
}

fn zip(sweep: &Sweep) -> Vec<Problem> {
    let grid = &sweep.grid;
    let length = |axis: &Axis| length(&sweep.grid, axis);
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

/// Conditions at a path that are none.
pub(super) fn conditions(path: &str, texts: &[String]) -> Vec<Problem> {
    let problem = |(i, text): (usize, &String)| {
        let message = Condition::parse(text).err()?;
        Some(Problem::value(format!("{path}[{i}]"), message))
    };
    texts.iter().enumerate().filter_map(problem).collect()
}
