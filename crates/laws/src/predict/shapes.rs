//! Models and vocabularies that can be built: shapes, and FSQ levels.

use std::borrow::Cow;
use std::sync::LazyLock;

use crate::laws::Laws;

/// The shape of a LLaMA-like decoder.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shape {
    pub n_layer: u64,
    pub n_head: u64,
    pub d_model: u64,
    pub d_ff: u64,
}

impl Shape {
    /// A shape with a SwiGLU of width ⌊8d/3⌋ rounded up to `multiple` (LLaMA's rule; ScaMo's code
    /// rounds to 256).
    pub fn swiglu(n_layer: u64, n_head: u64, d_model: u64, multiple: u64) -> Self {
        let d_ff = (8 * d_model / 3).div_ceil(multiple) * multiple;
        Self { n_layer, n_head, d_model, d_ff }
    }

    /// N_nv = L(4d² + 3 d d_ff + 2d) + d: attention, SwiGLU and norms of each block, and the last
    /// norm. The text projection is a separate group and not counted.
    pub fn params_nonvocab(&self) -> u64 {
        let Self { n_layer, d_model: d, d_ff, .. } = self;
        n_layer * (4 * d * d + 3 * d * d_ff + 2 * d) + d
    }
}

/// Shapes from d = 16 to 16384 at the paper's usual proportion d = 64 L.
///
/// From d = 128 widths are multiples of 64 with heads of 64; below they are multiples of 8, with at
/// least two heads of at most 32. No shape has fewer than two layers. The SwiGLU rounds to 256 from
/// d = 512, the paper's smallest, and to 8 below, where 256 would dwarf it.
pub fn default_ladder() -> &'static [Shape] {
    static LADDER: LazyLock<Vec<Shape>> = LazyLock::new(|| widths(16).map(rung).collect());
    &LADDER
}

/// The shapes of the models that laws were fitted to, where all have one depth: widths from 8 at that depth; else
/// the [`default_ladder`].
pub fn ladder_of(laws: &Laws) -> Cow<'static, [Shape]> {
    match laws.judgement.tried.and_then(|tried| tried.n_layer) {
        Some(n_layer) => widths(8).map(|d_model| of_width(d_model, n_layer as u64)).collect(),
        None => Cow::Borrowed(default_ladder()),
    }
}

/// Multiples of 8 up to 128, then of 64.
fn widths(smallest: usize) -> impl Iterator<Item = u64> {
    (smallest..128).step_by(8).chain((128..=16_384).step_by(64)).map(|d_model| d_model as u64)
}

fn rung(d_model: u64) -> Shape {
    of_width(d_model, ((d_model + 32) / 64).max(2))
}

fn of_width(d_model: u64, n_layer: u64) -> Shape {
    let multiple = if d_model >= 512 { 256 } else { 8 };
    Shape::swiglu(n_layer, d_model / head_width(d_model), d_model, multiple)
}

fn head_width(d_model: u64) -> u64 {
    let fits = |width: &u64| d_model.is_multiple_of(*width) && d_model / width >= 2;
    match d_model {
        128.. => 64,
        _ => [32, 16, 8].into_iter().find(fits).unwrap_or(d_model),
    }
}

/// The candidate whose `size` is nearest to `target` in logarithm; none of none.
pub(super) fn nearest<T>(candidates: &[T], target: f64, size: impl Fn(&T) -> f64) -> Option<&T> {
    let distance = |candidate: &&T| (size(candidate) / target).ln().abs();
    candidates.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)))
}

// Codebooks.

/// A vocabulary and the FSQ levels that make it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Codebook {
    /// V, the product of the levels.
    pub n_vocab: u64,
    /// The largest first; empty if V is no product of them.
    pub levels: Vec<u32>,
}

/// Levels of a dimension, at most, as in ScaMo's Table 8.
const MOST_LEVELS: u32 = 8;
/// Least levels of a dimension (Mentzer et al. 2023), and the fallback if no product is near.
const FEWEST_LEVELS: [u32; 2] = [5, 4];
/// A product this far off is near.
const NEAR: f64 = 1.05;
/// Dimensions are added while a product is below this multiple of the target.
const OVERSHOOT: f64 = 2.0;

/// Codes of the largest codebook that is looked at; a product of more levels may not be countable.
const LARGEST: f64 = 1e15;

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

    /// The codebook nearest to `n_vocab` codes by ratio: with 5 to 8 levels per dimension, or with 4 to 8 if none of
    /// those is within 5 %.
    pub fn near(n_vocab: f64) -> Self {
        let [few, fewer] = FEWEST_LEVELS.map(|fewest| codebook_nearest(n_vocab, fewest));
        let off = |codebook: &Self| (codebook.n_vocab as f64 / n_vocab).ln().abs();
        if off(&few) <= NEAR.ln() || off(&few) <= off(&fewer) { few } else { fewer }
    }
}

fn codebook_nearest(n_vocab: f64, fewest: u32) -> Codebook {
    let mut found = Vec::new();
    let most = (n_vocab * OVERSHOOT).min(LARGEST);
    products(&mut Vec::new(), fewest..=MOST_LEVELS, most, &mut found);
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
    use crate::laws::{Tried, scamo};

    const TRIED: Tried = Tried {
        runs: 0,
        n_budgets: 0,
        budgets: [0.0; 2],
        sizes: [0.0; 2],
        vocabularies: [0.0; 2],
        n_layer: None,
        unique_tokens: None,
        epochs: None,
    };

    #[test]
    fn the_papers_shapes_have_their_published_counts() {
        let counts = [
            ((8, 8, 512), 27_271_680),
            ((12, 12, 768), 84_953_856),
            ((24, 16, 1024), 308_331_520),
            ((36, 20, 1280), 731_475_200),
            ((48, 24, 1536), 1_359_103_488),
            ((24, 32, 3200), 2_988_598_400),
        ];
        for ((n_layer, n_head, d_model), params) in counts {
            let shape = Shape::swiglu(n_layer, n_head, d_model, 256);
            assert_eq!(shape.params_nonvocab(), params, "{shape:?}");
        }
    }

    #[test]
    fn every_rung_can_be_built_and_rungs_grow() {
        let ladder = default_ladder();
        assert!(ladder.contains(&Shape::swiglu(8, 8, 512, 256)));
        for shape in ladder {
            assert_eq!(shape.d_model % 8, 0, "{shape:?}");
            assert_eq!(shape.d_model % (2 * shape.n_head), 0, "rotary needs even heads {shape:?}");
        }
        let mut laws = scamo();
        assert_eq!(ladder_of(&laws)[..], *ladder);
        let tried = Tried { n_layer: Some(4), ..TRIED };
        laws.judgement.tried = Some(tried);
        let own = ladder_of(&laws);
        assert!(
            own.iter().all(|shape| shape.n_layer == 4 && shape.d_model % (2 * shape.n_head) == 0)
        );
        let grows = |pair: &[Shape]| pair[0].params_nonvocab() < pair[1].params_nonvocab();
        assert!(ladder.windows(2).all(grows));
    }

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
