//! Entries that stand twice: each would train the same runs twice, side by side in one folder.

use crate::spec::QuantizerSection;
use crate::sweep::problem::Problem;
use crate::sweep::sections::{Axis, ModelList, Sweep, VocabSpec};

/// The second of each pair of equal seeds, and of equal entries of an axis or a group of axes.
pub fn check(sweep: &Sweep) -> Vec<Problem> {
    let seed = second(&sweep.seeds).map(|i| format!("seeds[{i}]"));
    let kind = second(&sweep.generator.0).map(|i| format!("generator[{i}]"));
    let tokenizer = second(&sweep.tokenizer.seeds).map(|i| format!("tokenizer.seeds[{i}]"));
    let of_group = |group: Vec<Axis>| Some(path(sweep, group[0], second(&rows(sweep, &group))?));
    let lists = [seed, kind, tokenizer].into_iter().flatten();
    let paths = lists.chain(Axis::groups(&sweep.grid.zip).into_iter().filter_map(of_group));
    paths.map(|path| Problem::value(path, "stands in the list a second time")).collect()
}

/// What a group of axes holds at each index, up to the end of its shortest axis.
fn rows(sweep: &Sweep, group: &[Axis]) -> Vec<Vec<String>> {
    let columns: Vec<Vec<String>> = group.iter().map(|axis| entries(sweep, *axis)).collect();
    let length = columns.iter().map(Vec::len).min().unwrap_or(0);
    (0..length).map(|i| columns.iter().map(|column| column[i].clone()).collect()).collect()
}

fn entries(sweep: &Sweep, axis: Axis) -> Vec<String> {
    let grid = &sweep.grid;
    match axis {
        Axis::Models => {
            crate::sweep::models(&grid.models).iter().map(|model| format!("{model:?}")).collect()
        }
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

/// By its quantizer, where it has one: 256 and `{levels: [8, 6, 5]}` are the same.
fn vocabulary(entry: &VocabSpec, section: &QuantizerSection) -> String {
    entry
        .quantizer(section)
        .map_or_else(|_| format!("{entry:?}"), |quantizer| format!("{quantizer:?}"))
}

/// The first index whose value stood before it.
fn second<T: PartialEq>(values: &[T]) -> Option<usize> {
    (1..values.len()).find(|&i| values[..i].contains(&values[i]))
}

/// Where the model of an index stands: in a list, or as a width of a rule.
pub(super) fn model_path(models: &ModelList, i: usize) -> String {
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
