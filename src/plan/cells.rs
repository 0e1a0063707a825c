//! The cells of a grid: axes crossed or zipped, minus excluded ones; and vocabularies with nominal sizes.

use std::collections::HashSet;

use serde::Serialize;

use crate::spec::{GeneratorKind, QuantizerSpec, Share};
use crate::sweep::{Axis, Condition, GridSection, ModelEntry, Sweep, VocabSpec, models};

/// One cell: a generator with its sizes, a quantizer and a budget.
#[derive(Clone, Debug, PartialEq)]
pub struct GridCell {
    pub generator: GeneratorKind,
    pub model: ModelEntry,
    pub quantizer: QuantizerSpec,
    pub budget_flops: f64,
    pub share: Share,
}

/// The cells that remain, and the excluded ones with their condition.
pub fn cells(sweep: &Sweep) -> (Vec<GridCell>, Vec<(GridCell, String)>) {
    let exclude = &sweep.grid.exclude;
    let conditions: Vec<(Condition, &String)> =
        exclude.iter().filter_map(|text| Some((Condition::parse(text).ok()?, text))).collect();
    let (mut kept, mut excluded) = (Vec::new(), Vec::new());
    for cell in all_parts(sweep) {
        match conditions.iter().find(|(condition, _)| condition.holds(cell.values())) {
            None => kept.push(cell),
            Some((_, text)) => excluded.push((cell, format!("excluded by `{text}`"))),
        }
    }
    (kept, excluded)
}

/// The cells of the grid, then further cells of its other parts.
fn all_parts(sweep: &Sweep) -> Vec<GridCell> {
    let mut all: Vec<GridCell> = crossed(sweep, &sweep.grid);
    if sweep.grid.also.is_empty() {
        return all;
    }
    let key = |cell: &GridCell| format!("{cell:?}");
    let mut seen: HashSet<String> = all.iter().map(key).collect();
    for part in &sweep.grid.also {
        let own = crossed(sweep, &part.alone());
        all.extend(own.into_iter().filter(|cell| seen.insert(key(cell))));
    }
    all
}

/// The cells of one grid, generator after generator.
fn crossed(sweep: &Sweep, grid: &GridSection) -> Vec<GridCell> {
    let models = models(&grid.models);
    let quantizer = |entry| sweep.quantizer(entry).expect("checked when the sweep was read");
    let quantizers: Vec<QuantizerSpec> = grid.vocab.iter().map(quantizer).collect();
    let lengths = [models.len(), quantizers.len(), grid.budgets.len()];
    let triples = indices(lengths, &grid.zip);
    let shares: Vec<Share> = grid.shares.iter().filter_map(|share| Share::new(*share)).collect();
    let mut all = Vec::with_capacity(sweep.generator.0.len() * triples.len() * shares.len());
    for generator in &sweep.generator.0 {
        for &[m, v, b] in &triples {
            all.extend(shares.iter().map(|share| GridCell {
                generator: *generator,
                model: models[m].clone(),
                quantizer: quantizers[v].clone(),
                budget_flops: grid.budgets[b],
                share: *share,
            }));
        }
    }
    all
}

impl GridCell {
    /// The quantities of conditions.
    fn values(&self) -> [f64; Condition::FIELDS.len()] {
        let ModelEntry { n_layer, n_head, d_model, .. } = self.model;
        let sizes = [n_layer, n_head, d_model, self.quantizer.n_vocab()];
        let [n_layer, n_head, d_model, n_vocab] = sizes.map(|n| n as f64);
        [n_layer, n_head, d_model, n_vocab, self.budget_flops, self.share.value()]
    }
}

/// Index triples (model, vocabulary, budget): groups of zipped axes advance together.
fn indices(lengths: [usize; 3], zip: &[Vec<Axis>]) -> Vec<[usize; 3]> {
    let positions = |group: Vec<Axis>| group.into_iter().map(|axis| axis as usize).collect();
    let mut groups: Vec<Vec<usize>> = Axis::groups(zip).into_iter().map(positions).collect();
    groups.sort();
    groups.iter().fold(vec![[0; 3]], |found, group| {
        let at = |triple: [usize; 3], i| {
            std::array::from_fn(|axis| if group.contains(&axis) { i } else { triple[axis] })
        };
        let grown = |triple| (0..lengths[group[0]]).map(move |i| at(triple, i));
        found.into_iter().flat_map(grown).collect()
    })
}

// Vocabularies that FSQ makes smaller than their names.

/// A size of `grid.vocab` that means levels with a different product (ScaMo Table 8).
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Renamed {
    /// The size that the sweep names.
    pub named: usize,
    /// Codes of a codebook: the product of the levels.
    pub codes: usize,
    pub levels: Vec<usize>,
}

/// The nominal vocabularies of a sweep, in its order.
pub(super) fn renamed(sweep: &Sweep) -> Vec<Renamed> {
    let of_entry = |entry: &VocabSpec| {
        let VocabSpec::Size(named) = *entry else { return None };
        let quantizer = sweep.quantizer(entry).ok()?;
        let levels = quantizer.levels()?.to_vec();
        let codes = levels.iter().product();
        (codes != named).then_some(Renamed { named, codes, levels })
    };
    let parts = sweep.grid.also.iter().flat_map(|part| &part.vocab);
    let entries = sweep.grid.vocab.iter().chain(parts).filter_map(of_entry);
    let mut seen = HashSet::new();
    entries.filter(|entry| seen.insert((entry.named, entry.levels.clone()))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn further_parts_add_the_cells_that_are_not_there() {
        let text = "name: t\ntokenizer: {kind: fsq}\ngrid:\n  models: [{n_layer: 1, n_head: 1, d_model: 8}]\n  \
                    vocab: [64, 256]\n  budgets: [1e9, 2e9]\n  exclude: ['budget > 3e9']\n  also:\n    \
                    - models: [{n_layer: 1, n_head: 1, d_model: 8}, {n_layer: 1, n_head: 1, d_model: 12}]\n      \
                    vocab: [240]\n      budgets: [2e9, 4e9]\n";
        let sweep = crate::sweep::parse("t.yaml", text, &[]).expect("a sweep");
        let (kept, excluded) = cells(&sweep);
        // Of the part's four cells one is there already, under the name of 256, and two are excluded.
        assert_eq!((kept.len(), excluded.len()), (5, 2));
        assert_eq!((kept[4].model.d_model, kept[4].budget_flops), (12, 2e9));
        let slip = text.replace("d_model: 12", "d_model: 13");
        let told = crate::sweep::parse("t.yaml", &slip, &[]).expect_err("an odd head").to_string();
        assert!(told.contains("t.yaml:9:") && told.contains("13 channels"), "{told}");
    }

    #[test]
    fn axes_are_crossed_unless_zipped() {
        let crossed = indices([2, 2, 3], &[]);
        assert_eq!(crossed.len(), 12);
        assert_eq!(crossed[..3], [[0, 0, 0], [0, 0, 1], [0, 0, 2]]);
        let zipped = indices([2, 3, 2], &[vec![Axis::Models, Axis::Budgets]]);
        assert_eq!(zipped, [[0, 0, 0], [0, 1, 0], [0, 2, 0], [1, 0, 1], [1, 1, 1], [1, 2, 1]]);
    }

    #[test]
    fn sizes_whose_levels_have_another_product_are_named() {
        let text = "name: t\ngrid: {models: scamo, vocab: [64, 256, {levels: [3, 5]}, 1024], budgets: [1e18]}\n";
        let of = |settings: &[&str]| {
            let settings: Vec<String> = settings.iter().map(ToString::to_string).collect();
            renamed(&crate::sweep::parse("t.yaml", text, &settings).expect("a sweep"))
        };
        let fsq = of(&["tokenizer.kind=fsq"]);
        assert_eq!(fsq[0], Renamed { named: 256, codes: 240, levels: vec![8, 6, 5] });
        assert_eq!(fsq.iter().map(|entry| entry.codes).collect::<Vec<_>>(), [240, 1000]);
        assert_eq!(of(&["tokenizer.kind=vq", "grid.vocab=[64, 256]"]), []);
        assert_eq!(of(&["data.source=none", "trainer={command: 't {spec} {out}'}"]), []);
    }
}
