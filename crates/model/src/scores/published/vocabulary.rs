//! ScaMo's Table 6, read: from which size of the model on a larger vocabulary pays.

use std::collections::BTreeMap;

use super::named;

/// The scores of its cells, the better the larger, by codebook and model; models are in the order of their sizes.
struct Grid {
    models: Vec<String>,
    /// A row of models a codebook.
    cells: BTreeMap<usize, Vec<f64>>,
}

impl Grid {
    /// The grid of a score, of which `sign` times the printed number is the better the larger.
    fn of(score: &str, sign: f64) -> Self {
        let (mut models, mut cells) = (Vec::new(), BTreeMap::<usize, Vec<f64>>::new());
        for row in named("scamo-6").iter().flat_map(|table| table.rows()) {
            let codebook = row.setting.rsplit(' ').next().and_then(|n| n.parse().ok());
            let value = row.scores.get(score).map_or(f64::NAN, |printed| sign * printed.mean);
            cells.entry(codebook.unwrap_or(0)).or_default().push(value);
            if !models.contains(&row.system) {
                models.push(row.system);
            }
        }
        Self { models, cells }
    }

    /// The codebook that is best at a model.
    fn best(&self, model: usize) -> usize {
        let best = self.cells.iter().max_by(|a, b| a.1[model].total_cmp(&b.1[model]));
        best.map_or(0, |(codebook, _)| *codebook)
    }

    /// The smallest model at which a codebook is better than another, and no worse at any larger model.
    fn pays_from(&self, codebook: usize, other: usize) -> &str {
        let (own, other) = (&self.cells[&codebook], &self.cells[&other]);
        let no_worse = (0..own.len()).rev().take_while(|model| own[*model] >= other[*model]);
        let from = no_worse.filter(|model| own[*model] > other[*model]).last();
        from.map_or("none", |model| &self.models[model])
    }
}

/// The section of the page.
pub fn section() -> String {
    let [fid, found] = [Grid::of("fid", -1.0), Grid::of("r_precision_1", 1.0)];
    let mut text = "\n## When does a larger vocabulary pay?\n\n\
        Computed from `scamo-6`, one run a cell and no intervals. The codebook that is best at each size of the \
        model:\n\n| model | V by FID | V by R@1 |\n| --- | --- | --- |\n"
        .to_string();
    for (model, name) in fid.models.iter().enumerate() {
        text += &format!("| {name} | {} | {} |\n", fid.best(model), found.best(model));
    }
    text += "\nThe smallest model at which V codes are better than fewer, and no worse at any larger model:\n\n\
        | V | than the fewest, by FID | by R@1 | than the next fewer, by FID | by R@1 |\n\
        | --- | --- | --- | --- | --- |\n";
    let codebooks: Vec<usize> = fid.cells.keys().copied().collect();
    for pair in codebooks.windows(2) {
        let (fewer, own) = (pair[0], pair[1]);
        let than = |other| [&fid, &found].map(|grid| grid.pays_from(own, other));
        let cells = [than(codebooks[0]), than(fewer)].concat().join(" | ");
        text += &format!("| {own} | {cells} |\n");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_models_want_few_codes_and_large_ones_many() {
        let grids = [Grid::of("fid", -1.0), Grid::of("r_precision_1", 1.0)];
        for grid in grids {
            assert_eq!(grid.models, ["44M", "111M", "343M", "775M", "1B", "3B"]);
            let best: Vec<usize> = (0..6).map(|model| grid.best(model)).collect();
            assert_eq!(best, [256, 256, 65536, 65536, 65536, 65536]);
            assert_eq!(grid.pays_from(65536, 256), "343M");
            assert_eq!(grid.pays_from(16384, 4096), "none");
        }
    }
}
