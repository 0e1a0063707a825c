//! The cells of a grid: axes crossed or zipped, less what is excluded.

use crate::spec::{QuantizerSpec, levels_for};
use crate::sweep::condition::Condition;
use crate::sweep::models;
use crate::sweep::{Axis, GridSpec, ModelEntry, TokenizerKind, VocabSpec};

/// One cell: a model, a quantizer and a budget.
#[derive(Clone, Debug, PartialEq)]
pub struct Cell {
    pub model: ModelEntry,
    pub quantizer: QuantizerSpec,
    pub budget_flops: f64,
}

/// Every cell that no condition excludes, and those that one does, with the condition.
pub fn cells(grid: &GridSpec, kind: TokenizerKind) -> (Vec<Cell>, Vec<(Cell, String)>) {
    let models = models(&grid.models);
    let quantizers: Vec<_> = grid.vocab.iter().map(|entry| quantizer(entry, kind)).collect();
    let lengths = [models.len(), quantizers.len(), grid.budgets.len()];
    let all = indices(lengths, &grid.zip).into_iter().map(|[m, v, b]| Cell {
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

fn field(cell: &Cell, name: &str) -> f64 {
    match name {
        "n_layer" => cell.model.n_layer as f64,
        "n_head" => cell.model.n_head as f64,
        "d_model" => cell.model.d_model as f64,
        "n_vocab" => cell.quantizer.n_vocab() as f64,
        _ => cell.budget_flops,
    }
}

/// The quantizer of a vocabulary entry that the check has let pass.
fn quantizer(entry: &VocabSpec, kind: TokenizerKind) -> QuantizerSpec {
    match (entry, kind) {
        (VocabSpec::Size(n), TokenizerKind::Vq) => QuantizerSpec::Vq { n_vocab: *n },
        (VocabSpec::Size(n), TokenizerKind::Fsq) => {
            let levels = levels_for(*n).expect("checked when the sweep was read");
            QuantizerSpec::Fsq { levels: levels.to_vec() }
        }
        (VocabSpec::Levels(spec), _) => QuantizerSpec::Fsq { levels: spec.levels.clone() },
    }
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
