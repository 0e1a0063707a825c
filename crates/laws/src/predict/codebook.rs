//! [`Codebook`]: a vocabulary, and the FSQ levels that make it.

/// A vocabulary and the FSQ levels that make it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Codebook {
    /// V, the product of the levels.
    pub n_vocab: u64,
    /// The largest first; empty where V is no product of them.
    pub levels: Vec<u32>,
}

/// Levels of a dimension, at most, as in ScaMo's Table 8.
const MOST_LEVELS: u32 = 8;
/// Levels of a dimension, at least (Mentzer et al. 2023); and where no product of such is near.
const FEWEST_LEVELS: [u32; 2] = [5, 4];
/// A product this far off is near.
const NEAR: f64 = 1.05;
/// Dimensions are added while a product is below this multiple of what is wanted.
const OVERSHOOT: f64 = 2.0;

impl Codebook {
    /// The codebook of levels.
    pub fn of(levels: &[u32]) -> Self {
        let n_vocab = levels.iter().map(|level| u64::from(*level)).product();
        Self { n_vocab, levels: levels.to_vec() }
    }

    /// A vocabulary that no levels make.
    pub fn without_levels(n_vocab: f64) -> Self {
        Self { n_vocab: n_vocab.round() as u64, levels: Vec::new() }
    }

    /// The codebook nearest to `n_vocab` codes by ratio: of 5 to 8 levels a dimension, or of 4 to 8
    /// where none of those is within 5 %.
    pub fn near(n_vocab: f64) -> Self {
        let [few, fewer] = FEWEST_LEVELS.map(|fewest| nearest(n_vocab, fewest));
        let off = |codebook: &Self| (codebook.n_vocab as f64 / n_vocab).ln().abs();
        if off(&few) <= NEAR.ln() || off(&few) <= off(&fewer) { few } else { fewer }
    }
}

fn nearest(n_vocab: f64, fewest: u32) -> Codebook {
    let mut found = Vec::new();
    products(&mut Vec::new(), fewest..=MOST_LEVELS, n_vocab * OVERSHOOT, &mut found);
    let off = |codebook: &Codebook| (codebook.n_vocab as f64 / n_vocab).ln().abs();
    let nearest = found.into_iter().min_by(|a, b| off(a).total_cmp(&off(b)));
    nearest.unwrap_or_else(|| Codebook::of(&[fewest]))
}

/// Every product up to `most`, levels in falling order.
fn products(
    levels: &mut Vec<u32>,
    allowed: std::ops::RangeInclusive<u32>,
    most: f64,
    found: &mut Vec<Codebook>,
) {
    for level in allowed.clone() {
        levels.push(level);
        let codebook = Codebook::of(levels);
        if codebook.n_vocab as f64 <= most {
            found.push(codebook);
            products(levels, *allowed.start()..=level, most, found);
        }
        levels.pop();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn any_vocabulary_has_a_codebook_within_a_few_percent() {
        let codebook = Codebook::near(8615.0);
        assert_eq!((codebook.n_vocab, codebook.levels), (8640, vec![8, 6, 6, 6, 5]));
        for n in (64..1_000_000).step_by(997) {
            let near = Codebook::near(n as f64);
            let off = (near.n_vocab as f64 / n as f64).ln().abs();
            assert!(off < 0.12 && near.levels.iter().all(|level| *level >= 4), "{n}: {near:?}");
        }
    }

    #[test]
    fn sizes_of_the_table_are_met() {
        let sizes = [64, 240, 512, 1000, 1920, 4375, 15_360, 64_000];
        assert!(sizes.iter().all(|n| Codebook::near(*n as f64).n_vocab == *n as u64));
    }

    #[test]
    fn four_levels_are_taken_where_five_are_far_off() {
        assert_eq!(Codebook::near(20.0).levels, [5, 4]);
        assert_eq!(Codebook::near(3.0).levels, [4]);
    }
}
