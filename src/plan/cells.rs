//! The cells of a grid: axes crossed or zipped, less what is excluded.

use crate::spec::{GeneratorKind, QuantizerSection, QuantizerSpec};
use crate::sweep::condition::Condition;
use crate::sweep::{Axis, ModelEntry, Sweep, VocabSpec, models};

/// One cell: a generator with its sizes, a quantizer and a budget.
#[derive(Clone, Debug, PartialEq)]
pub struct GridCell {
    pub generator: GeneratorKind,
    pub model: ModelEntry,
    pub quantizer: QuantizerSpec,
    pub budget_flops: f64,
}

/// Every cell that no condition excludes, and those that one does, with the condition.
pub fn cells(sweep: &Sweep) -> (Vec<GridCell>, Vec<(GridCell, String)>) {
    let grid = &sweep.grid;
    let (models, section) = (models(&grid.models), sweep.tokenizer.quantizer());
    let quantizers: Vec<_> = grid.vocab.iter().map(|entry| quantizer(entry, &section)).collect();
    let lengths = [models.len(), quantizers.len(), grid.budgets.len()];
    let triples = indices(lengths, &grid.zip);
    let of_kind = |generator: &GeneratorKind| {
        let generator = *generator;
        triples.iter().map(move |&[m, v, b]| (generator, m, v, b))
    };
    let all = sweep.generator.0.iter().flat_map(of_kind).map(|(generator, m, v, b)| GridCell {
        generator,
        model: models[m].clone(),
        quantizer: quantizers[v].clone(),
        budget_flops: grid.budgets[b],
    });
    let conditions: Vec<(Condition, &String)> =
        grid.exclude.iter().filter_map(|text| Some((Condition::parse(text).ok()?, text))).collect();
    let (mut kept, mut excluded) = (Vec::new(), Vec::new());
    for cell in all {
        match conditions.iter().find(|(condition, _)| condition.holds(|f| field(&cell, f))) {
            None => kept.push(cell),
            Some((_, text)) => excluded.push((cell, format!("excluded by `{text}`"))),
        }
    }
    (kept, excluded)
}

fn field(cell: &GridCell, name: &str) -> f64 {
    match name {
        "n_layer" => cell.model.n_layer as f64,
        "n_head" => cell.model.n_head as f64,
        "d_model" => cell.model.d_model as f64,
        "n_vocab" => cell.quantizer.n_vocab() as f64,
        _ => cell.budget_flops,
    }
}

/// The quantizer of a vocabulary entry that the check has let pass.
fn quantizer(entry: &VocabSpec, section: &QuantizerSection) -> QuantizerSpec {
    entry.quantizer(section).expect("checked when the sweep was read")
}

/// Index triples (model, vocabulary, budget): groups of zipped axes advance together.
fn indices(lengths: [usize; 3], zip: &[Vec<Axis>]) -> Vec<[usize; 3]> {
    let position = |axis: &Axis| match axis {
        Axis::Models => 0,
        Axis::Vocab => 1,
        Axis::Budgets => 2,
    };
    let mut groups: Vec<Vec<usize>> =
        zip.iter().map(|group| group.iter().map(position).collect()).collect();
    for axis in 0..3 {
        if !groups.iter().any(|group| group.contains(&axis)) {
            groups.push(vec![axis]);
        }
    }
    groups.sort();
    groups.iter().fold(vec![[0; 3]], |found, group| {
        let length = group.first().map_or(1, |&axis| lengths[axis]);
        let grown = found.iter().flat_map(|triple| {
            (0..length).map(|i| {
                let mut triple = *triple;
                group.iter().for_each(|&axis| triple[axis] = i);
                triple
            })
        });
        grown.collect()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_are_crossed_unless_zipped() {
        let crossed = indices([2, 2, 3], &[]);
        assert_eq!(crossed.len(), 12);
        assert_eq!(crossed[..3], [[0, 0, 0], [0, 0, 1], [0, 0, 2]]);
        let zipped = indices([2, 3, 2], &[vec![Axis::Models, Axis::Budgets]]);
        assert_eq!(zipped, [[0, 0, 0], [0, 1, 0], [0, 2, 0], [1, 0, 1], [1, 1, 1], [1, 2, 1]]);
    }
}
