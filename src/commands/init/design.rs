//! [`Design`]: a grid around the expected optimum.

use crate::commands::prelude::*;
use crate::commands::sizes;

/// Budgets of a study, each twice the one before.
const BUDGETS: i32 = 5;
/// Sizes of a budget lie within this factor of the expected N_nv.
const SIZES_WITHIN: f64 = 4.5;
/// Vocabularies lie within this factor of the expected V, over all budgets.
const VOCAB_WITHIN: f64 = 3.0;
/// Layers: one depth, so that sizes differ in width alone.
const LAYERS: usize = 2;
/// Widths a factor of about 1.25 apart: N_nv a factor of at most 1.6.
const WIDTHS: [usize; 30] = [
    6, 8, 10, 12, 14, 16, 20, 24, 28, 36, 44, 54, 64, 80, 96, 120, 144, 176, 216, 264, 320, 392,
    480, 576, 704, 864, 1056, 1296, 1584, 1920,
];
const SMALLEST_VOCAB: usize = 32;
const LARGEST_VOCAB: usize = 65536;
/// Vocabularies at least, so that one lies between two.
const VOCABULARIES: usize = 3;

/// A grid of sizes, vocabularies and budgets.
#[derive(Clone, Debug, PartialEq)]
pub struct Design {
    /// Ascending.
    pub budgets: Vec<f64>,
    pub widths: Vec<usize>,
    pub vocab: Vec<usize>,
    /// Conditions that leave out cells far from the expected optimum.
    pub exclude: Vec<String>,
    pub seeds: Vec<u64>,
    /// Seeds of each vocabulary's tokenizer.
    pub tokenizer_seeds: Vec<u64>,
}

impl Design {
    /// Budgets up to `largest`, each with the sizes and vocabularies that may be optimal.
    ///
    /// `unique_tokens` bounds the vocabulary: a code should occur twenty times in the data.
    pub fn up_to(largest: f64, unique_tokens: Option<usize>) -> Self {
        let budgets: Vec<f64> =
            (0..BUDGETS).rev().map(|halvings| rounded(largest / 2f64.powi(halvings))).collect();
        let expected: Vec<Expected> = budgets.iter().map(|budget| Expected::at(*budget)).collect();
        let windows: Vec<[usize; 2]> = expected.iter().map(Expected::widths).collect();
        let within =
            |width: &usize| windows.iter().any(|[low, high]| (low..=high).contains(&width));
        let widths: Vec<usize> = WIDTHS.into_iter().filter(within).collect();
        let least = SMALLEST_VOCAB << (VOCABULARIES - 1);
        let most = unique_tokens.map_or(LARGEST_VOCAB, |tokens| (tokens / 20).max(least));
        let low = expected.iter().map(|e| e.n_vocab).fold(f64::INFINITY, f64::min) / VOCAB_WITHIN;
        let high = expected.iter().map(|e| e.n_vocab).fold(0.0, f64::max) * VOCAB_WITHIN;
        let powers = (0..).map(|power| SMALLEST_VOCAB << power).take_while(|v| *v <= LARGEST_VOCAB);
        let possible: Vec<usize> =
            powers.filter(|v| *v <= most && *v as f64 <= high.max(least as f64)).collect();
        let near = possible.iter().filter(|v| **v as f64 >= low).count().max(VOCABULARIES);
        let vocab = possible[possible.len() - near.min(possible.len())..].to_vec();
        let exclude = budgets.iter().zip(&windows).flat_map(|(budget, [low, high])| {
            let [from, to] = [0.9 * budget, 1.1 * budget].map(written);
            let here = format!("budget > {from} and budget < {to}");
            let below = widths.iter().any(|width| width < low);
            let above = widths.iter().any(|width| width > high);
            let below = below.then(|| format!("{here} and d_model < {low}"));
            below.into_iter().chain(above.then(|| format!("{here} and d_model > {high}")))
        });
        let exclude = exclude.collect();
        Self { exclude, widths, vocab, budgets, seeds: vec![0], tokenizer_seeds: vec![0] }
    }

    /// The design with other numbers of seeds of each run, and of each tokenizer.
    pub fn with_seeds(self, [runs, tokenizers]: [u64; 2]) -> Self {
        let (seeds, tokenizer_seeds) = ((0..runs).collect(), (0..tokenizers).collect());
        Self { seeds, tokenizer_seeds, ..self }
    }

    /// D of the expected optimum of the largest budget.
    pub fn most_tokens(&self) -> f64 {
        self.budgets.last().map_or(0.0, |budget| Expected::at(*budget).tokens)
    }

    /// The sweep file's `models`, a line each.
    pub fn models(&self) -> String {
        let line = |width: &usize| {
            format!("    - {{n_layer: {LAYERS}, n_head: {}, d_model: {width}}}\n", heads(*width))
        };
        self.widths.iter().map(line).collect()
    }
}

/// The fewest heads of up to 128 channels, an even number each.
fn heads(width: usize) -> usize {
    let is_good = |heads: &usize| width.is_multiple_of(2 * heads);
    (width.div_ceil(128)..).find(is_good).unwrap_or(1)
}

/// The expected optimum of a budget.
struct Expected {
    params_nonvocab: f64,
    n_vocab: f64,
    tokens: f64,
}

impl Expected {
    fn at(budget: f64) -> Self {
        let law = sizes::Expected::by_own_studies(budget);
        let (params_nonvocab, params_vocab) = (law.params_nonvocab, law.params_vocab);
        let width = (params_nonvocab / (12 * LAYERS) as f64).sqrt();
        let tokens = budget / (6.0 * (params_nonvocab + params_vocab));
        Self { params_nonvocab, n_vocab: params_vocab / width, tokens }
    }

    /// The least and the largest width within the factor, three at least.
    fn widths(&self) -> [usize; 2] {
        let width = |n: f64| (n / (12 * LAYERS) as f64).sqrt();
        let ends = [self.params_nonvocab / SIZES_WITHIN, self.params_nonvocab * SIZES_WITHIN];
        let [low, high] = ends.map(width);
        let inside: Vec<usize> =
            WIDTHS.into_iter().filter(|w| (low..=high).contains(&(*w as f64))).collect();
        match inside[..] {
            [first, _, .., last] => [first, last],
            _ if low < WIDTHS[0] as f64 => [WIDTHS[0], WIDTHS[2]],
            _ => [WIDTHS[WIDTHS.len() - 3], WIDTHS[WIDTHS.len() - 1]],
        }
    }
}

/// A budget in a sweep file, with two digits.
pub fn written(flops: f64) -> String {
    format!("{:e}", rounded(flops))
}

/// Rounds to two digits.
fn rounded(x: f64) -> f64 {
    format!("{x:.1e}").parse().unwrap_or(x)
}

// The sweep file with comments.

/// A sweep file.
pub fn text(name: &str, data: Option<&Path>, design: &Design) -> String {
    let data = match data {
        Some(path) => format!(
            "data:\n  source: humanml3d\n  path: {:?}\n  mirror: true      # also train on each clip mirrored left-right\n",
            path.display().to_string()
        ),
        None => "# The built-in motion; for your own: {source: humanml3d, path: data/mine}\n\
                 data: {source: procedural, clips: auto, val_clips: 64, test_clips: 256}\n"
            .to_string(),
    };
    fn list<T: ToString>(values: impl IntoIterator<Item = T>) -> String {
        values.into_iter().map(|value| value.to_string()).collect::<Vec<_>>().join(", ")
    }
    let seeds = list(&design.seeds);
    let of_tokenizers = match design.tokenizer_seeds[..] {
        [_] => String::new(),
        _ => format!(", seeds: [{}]", list(&design.tokenizer_seeds)),
    };
    let vocab = list(&design.vocab);
    let budgets = list(design.budgets.iter().map(|budget| written(*budget)));
    let largest = design.budgets.last().copied().unwrap_or_default();
    let predict = written(10.0 * largest);
    let lines: String = design.exclude.iter().map(|line| format!("    - {line}\n")).collect();
    let exclude = match &lines[..] {
        "" => String::new(),
        _ => format!(
            "  # At each budget, keep only the sizes near its optimum.\n  exclude:\n{lines}"
        ),
    };
    let models = design.models();
    format!(
        "# Sized by `isoflop init`. `isoflop plan` prices it, `isoflop run` trains it and fits the laws; every key is in\n\
         # docs/sweep-file.md, and `isoflop schema` prints the schema for editors.\n\
         name: {name}\n\
         seeds: [{seeds}]      # several seeds measure the noise of runs\n\
         {data}\
         # Captions as hashed n-grams; t5, clip, bert or llama read local weights.\n\
         text: {{encoder: hashed-ngrams, dim: 64, max_tokens: 32}}\n\
         # One tokenizer per vocabulary; `isoflop tokenizer eval` compares them with k-means.\n\
         # The weights and the factor keep motion continuous and the body's travel.\n\
         tokenizer:\n  {{kind: patch, steps: 800{of_tokenizers}, acceleration_weight: 1.5, root_weight: 0.02, sideways_scale: 2}}\n\
         # autoregressive, scalewise or masked; a list makes it an axis of the grid.\n\
         generator: autoregressive\n\
         grid:\n  # One depth, and sizes at most a factor 1.6 apart: minima at a gap or a change of depth are flagged.\n  \
         models:\n{models}  vocab: [{vocab}]\n  budgets: [{budgets}]\n{exclude}\
         train:\n  schedule: {{kind: wsd, warmup: 0.1}}\n\
         fit: {{minima: [parabola, argmin, cubic, surface], hold_out: largest-budget, bootstrap: 1000}}\n\
         # Ten times beyond the fit; `isoflop validate RESULTS --budget {predict}` tests it.\n\
         predict: {{budgets: [{predict}]}}\n"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn budgets_double_and_sizes_stand_round_the_expected_optimum() {
        let design = Design::up_to(1.6e11, None);
        assert_eq!(design.budgets, [1e10, 2e10, 4e10, 8e10, 1.6e11]);
        assert!(design.widths.len() >= 8 && design.vocab.len() >= 4, "{design:?}");
        for budget in &design.budgets {
            let expected = Expected::at(*budget);
            let [low, high] = expected.widths();
            let width = (expected.params_nonvocab / 24.0).sqrt();
            assert!((low as f64) < width && width < high as f64, "{low} {width} {high}");
            assert!(design.vocab.iter().any(|v| (*v as f64) < expected.n_vocab));
        }
        assert!(design.widths.iter().all(|width| (width / heads(*width)).is_multiple_of(2)));
    }

    #[test]
    fn small_data_bear_small_vocabularies() {
        let design = Design::up_to(2e10, Some(3000));
        assert_eq!(design.vocab, [32, 64, 128]);
        assert_eq!(Design::up_to(1e12, Some(10)).vocab, [32, 64, 128]);
        assert!(Design::up_to(1e8, None).vocab.len() >= 3);
        assert!(Design::up_to(1e10, None).most_tokens() < Design::up_to(1e11, None).most_tokens());
    }

    #[test]
    fn tiny_and_huge_budgets_still_have_three_sizes() {
        for largest in [1e7, 1e9, 1e13, 1e15, 1e17] {
            let design = Design::up_to(largest, None);
            assert!(design.widths.len() >= 3, "{largest:e}: {:?}", design.widths);
        }
        assert!(WIDTHS.iter().all(|width| width.is_multiple_of(2 * heads(*width))));
    }
}
