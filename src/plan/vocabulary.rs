//! Vocabularies that FSQ makes smaller than their names.

use serde::Serialize;

use crate::sweep::{Sweep, VocabSpec};

/// A size of `grid.vocab` that stands for levels with another product (ScaMo Table 8).
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Renamed {
    /// The size that the sweep names.
    pub named: usize,
    /// Codes of a codebook: the product of the levels.
    pub codes: usize,
    pub levels: Vec<usize>,
}

/// Those of a sweep, in its order.
pub(super) fn renamed(sweep: &Sweep) -> Vec<Renamed> {
    let of_entry = |entry: &VocabSpec| {
        let VocabSpec::Size(named) = *entry else { return None };
        let quantizer = sweep.quantizer(entry).ok()?;
        let levels = quantizer.levels()?.to_vec();
        let codes = levels.iter().product();
        (codes != named).then_some(Renamed { named, codes, levels })
    };
    let parts = sweep.grid.also.iter().flat_map(|part| &part.vocab);
    let mut renamed = Vec::new();
    for entry in sweep.grid.vocab.iter().chain(parts).filter_map(of_entry) {
        if !renamed.contains(&entry) {
            renamed.push(entry);
        }
    }
    renamed
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sweep;

    #[test]
    fn sizes_whose_levels_have_another_product_are_named() {
        let text = "name: t\ngrid: {models: scamo, vocab: [64, 256, {levels: [3, 5]}, 1024], budgets: [1e18]}\n";
        let of = |settings: &[&str]| {
            let settings: Vec<String> = settings.iter().map(ToString::to_string).collect();
            renamed(&sweep::parse("t.yaml", text, &settings).expect("a sweep"))
        };
        let fsq = of(&["tokenizer.kind=fsq"]);
        assert_eq!(fsq[0], Renamed { named: 256, codes: 240, levels: vec![8, 6, 5] });
        assert_eq!(fsq.iter().map(|entry| entry.codes).collect::<Vec<_>>(), [240, 1000]);
        assert_eq!(of(&["tokenizer.kind=vq", "grid.vocab=[64, 256]"]), []);
        assert_eq!(of(&["data.source=none", "trainer={command: 't {spec} {out}'}"]), []);
    }
}
