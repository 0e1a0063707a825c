//! Checks for impossible settings of the grid: models, vocabularies, budgets and their combination.

use crate::spec::{QuantizerSection, VocabularyError, is_torch};
use crate::sweep::cells::{Condition, MODEL_LISTS, models, named_models};
use crate::sweep::problem::{Problem, nearest};
use crate::sweep::sections::{Axis, GridPart, GridSection, ModelList, Sweep, VocabSpec};

/// Problems of the grid.
pub fn check(sweep: &Sweep) -> Vec<Problem> {
    [
        model_list(sweep),
        vocab(sweep),
        budgets(sweep),
        cells(sweep),
        zip(sweep),
        repeated(sweep),
        conditions("grid.exclude", &sweep.grid.exclude),
        also(sweep),
        shares(sweep),
    ]
    .concat()
}

/// Problems of further parts, each checked as a separate grid.
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

fn model_list(sweep: &Sweep) -> Vec<Problem> {
    let problem = match &sweep.grid.models {
        ModelList::Named(name) if named_models(name).is_none() => {
            Problem::value("grid.models", format!("no list of models is named `{name}`"))
                .with_help(nearest(name, &MODEL_LISTS))
        }
        ModelList::Rule(rule) if rule.d_model.is_empty() => {
            Problem::value("grid.models", "the rule makes no model")
        }
        ModelList::List(list) if list.is_empty() => {
            Problem::value("grid.models", "no model, so no run")
        }
        ModelList::Named(_) => return Vec::new(),
        _ => return every_model(sweep),
    };
    vec![problem]
}

fn every_model(sweep: &Sweep) -> Vec<Problem> {
    let models = models(&sweep.grid.models);
    models
        .iter()
        .enumerate()
        .filter_map(|(i, model)| {
            let (d, h) = (model.d_model, model.n_head);
            let wrong = if d % h != 0 {
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
        // The problem is reported at its own key.
        return Vec::new();
    }
    let wrong = |(i, entry): (usize, &VocabSpec)| {
        let VocabularyError { problem, help } = sweep.quantizer(entry).err()?;
        let problem = Problem::value(format!("grid.vocab[{i}]"), problem);
        Some(help.into_iter().fold(problem, Problem::with_help))
    };
    grid.vocab.iter().enumerate().filter_map(wrong).collect()
}

fn budgets(sweep: &Sweep) -> Vec<Problem> {
    let none = || Problem::value("grid.budgets", "no budget, so no run");
    sweep.grid.budgets.is_empty().then(none).into_iter().collect()
}

/// Runs of a grid at most: a plan holds each of them.
const MOST_RUNS: f64 = 1e6;

/// Values of an axis.
fn length(grid: &GridSection, axis: &Axis) -> usize {
    match axis {
        Axis::Models => models(&grid.models).len(),
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

/// Problems of `grid.shares`.
fn shares(sweep: &Sweep) -> Vec<Problem> {
    const PATH: &str = "grid.shares";
    let shares = &sweep.grid.shares;
    if shares.is_empty() {
        return vec![Problem::value(PATH, "no share, so no run").with_help("shares: [1]")];
    }
    let problem = |i: usize, message: String| Problem::value(format!("{PATH}[{i}]"), message);
    let wrong = |(i, share): (usize, &f64)| {
        let twice = || problem(i, "stands in the list a second time".into());
        shares[..i].contains(share).then(twice)
    };
    let mut problems: Vec<Problem> = shares.iter().enumerate().filter_map(wrong).collect();
    let may_not_know = sweep.trainer.as_ref().is_some_and(|trainer| !is_torch(&trainer.command));
    if may_not_know && shares.iter().any(|share| *share != 1.0) {
        let problem = Problem::value(PATH, "a trainer of your own sees all of the training split");
        problems.push(problem.with_help("leave it out, and make a data set of each share"));
    }
    problems
}

// Repeated entries: each would train the same runs twice, in parallel in one folder.

/// The second of each pair of equal seeds, and of equal entries of an axis or a group of axes.
fn repeated(sweep: &Sweep) -> Vec<Problem> {
    let seed = second(&sweep.seeds).map(|i| format!("seeds[{i}]"));
    let kind = second(&sweep.generator.0).map(|i| format!("generator[{i}]"));
    let tokenizer = second(&sweep.tokenizer.seeds).map(|i| format!("tokenizer.seeds[{i}]"));
    let of_group = |group: Vec<Axis>| Some(path(sweep, group[0], second(&rows(sweep, &group))?));
    let lists = [seed, kind, tokenizer].into_iter().flatten();
    let paths = lists.chain(Axis::groups(&sweep.grid.zip).into_iter().filter_map(of_group));
    paths.map(|path| Problem::value(path, "stands in the list a second time")).collect()
}

/// The values of a group of axes at each index, up to the end of its shortest axis.
fn rows(sweep: &Sweep, group: &[Axis]) -> Vec<Vec<String>> {
    let columns: Vec<Vec<String>> = group.iter().map(|axis| entries(sweep, *axis)).collect();
    let length = columns.iter().map(Vec::len).min().unwrap_or(0);
    (0..length).map(|i| columns.iter().map(|column| column[i].clone()).collect()).collect()
}

fn entries(sweep: &Sweep, axis: Axis) -> Vec<String> {
    let grid = &sweep.grid;
    match axis {
        Axis::Models => models(&grid.models).iter().map(|model| format!("{model:?}")).collect(),
        Axis::Vocab => {
            grid.vocab.iter().map(|entry| vocabulary(entry, &sweep.tokenizer.quantizer())).collect()
        }
        Axis::Budgets => grid.budgets.iter().map(f64::to_string).collect(),
    }
}

fn path(sweep: &Sweep, axis: Axis, i: usize) -> String {
    match axis {
        Axis::Models => model_path(&sweep.grid.models, i),
        Axis::Vocab => format!("grid.vocab[{i}]"),
        Axis::Budgets => format!("grid.budgets[{i}]"),
    }
}

/// By its quantizer, if it has one: 256 and `{levels: [8, 6, 5]}` are the same.
fn vocabulary(entry: &VocabSpec, section: &QuantizerSection) -> String {
    entry
        .quantizer(section)
        .map_or_else(|_| format!("{entry:?}"), |quantizer| format!("{quantizer:?}"))
}

/// The first index whose value stood before it.
fn second<T: PartialEq>(values: &[T]) -> Option<usize> {
    (1..values.len()).find(|&i| values[..i].contains(&values[i]))
}

/// The path of a model by index: in a list, or as a width of a rule.
fn model_path(models: &ModelList, i: usize) -> String {
    match models {
        ModelList::Rule(_) => format!("grid.models.d_model[{i}]"),
        _ => format!("grid.models[{i}]"),
    }
}

#[cfg(test)]
mod tests {
    use crate::sweep::parse;

    fn problems(text: &str) -> Vec<String> {
        match parse("sweep.yaml", text, &[]) {
            Ok(_) => Vec::new(),
            Err(errors) => errors.problems.into_iter().map(|problem| problem.path).collect(),
        }
    }

    const MODELS: &str =
        "[{n_layer: 1, n_head: 1, d_model: 8}, {n_layer: 1, n_head: 1, d_model: 8}]";

    #[test]
    fn what_stands_twice_is_named_by_its_second_place() {
        let text = format!(
            "{{name: a, seeds: [3, 4, 3], tokenizer: {{seeds: [1, 1]}}, grid: {{models: {MODELS}, vocab: [64, 240, \
             {{levels: [8, 6, 5]}}], budgets: [1e9, 10e8]}}}}"
        );
        let lists = ["seeds[2]", "tokenizer.seeds[1]"];
        let axes = ["grid.models[1]", "grid.vocab[2]", "grid.budgets[1]"];
        let paths: Vec<&str> = lists.into_iter().chain(axes).collect();
        assert_eq!(problems(&text), paths);
    }

    #[test]
    fn a_zipped_axis_may_repeat_what_its_partner_tells_apart() {
        let grid = |budgets: &str| {
            format!(
                "{{name: a, grid: {{models: {MODELS}, vocab: [64], budgets: {budgets}, \
                 zip: [[models, budgets]]}}}}"
            )
        };
        assert_eq!(problems(&grid("[1e9, 2e9]")), [""; 0]);
        assert_eq!(problems(&grid("[1e9, 1e9]")), ["grid.models[1]"]);
    }
}
