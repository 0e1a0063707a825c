//! [`CodebookSpec`]: the codes of one scale, for FSQ by its levels; [`ScaleSpec`]: the scales of a multi-scale
//! quantizer.

use schemars::JsonSchema;
use serde::{Deserialize, Deserializer, Serialize};
use serde_yaml::Value;

use crate::units::{Ways, named, number};

/// Codes beyond which a codebook is taken for a slip of the pen.
const MOST_CODES: usize = 1 << 24;

/// A codebook, resolved for hashing.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase", deny_unknown_fields)]
pub enum CodebookSpec {
    /// Finite scalar quantization with so many levels in each dimension.
    Fsq { levels: Vec<usize> },
    /// Vector quantization, its codes learned by moving averages.
    Vq { n_vocab: usize },
}

/// A kind of codebook, as it is written in a sweep file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum CodebookKind {
    /// Vector quantization with moving averages and resets.
    #[default]
    Vq,
    /// Finite scalar quantization.
    Fsq,
}

/// Why a vocabulary is none of a kind of quantizer.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{problem}")]
pub struct VocabularyError {
    pub problem: String,
    /// The remedy.
    pub help: Option<String>,
}

impl VocabularyError {
    /// A problem that needs no help.
    pub(super) fn new(problem: impl Into<String>) -> Self {
        Self { problem: problem.into(), help: None }
    }
}

impl CodebookKind {
    /// The codebook of so many codes; for FSQ a size that ScaMo's Table 8 names, or its product.
    ///
    /// # Errors
    /// There is none.
    pub fn of_size(self, n: usize) -> Result<CodebookSpec, VocabularyError> {
        match self {
            Self::Vq => Ok(CodebookSpec::Vq { n_vocab: n }),
            Self::Fsq => {
                let levels = levels_for(n).ok_or_else(|| no_levels(n))?;
                Ok(CodebookSpec::Fsq { levels: levels.to_vec() })
            }
        }
    }

    /// The codebook of levels.
    ///
    /// # Errors
    /// VQ has no levels.
    pub fn of_levels(self, levels: &[usize]) -> Result<CodebookSpec, VocabularyError> {
        match self {
            Self::Fsq => Ok(CodebookSpec::Fsq { levels: levels.to_vec() }),
            Self::Vq => {
                Err(VocabularyError::new("levels belong to `kind: fsq`; vq wants a number"))
            }
        }
    }
}

fn no_levels(n: usize) -> VocabularyError {
    let known: Vec<String> = nominal_sizes().map(|n| n.to_string()).collect();
    let help = format!("one of {}, or {{levels: [8, 4, 4]}}", known.join(", "));
    VocabularyError { problem: format!("ScaMo gives no levels for {n} codes"), help: Some(help) }
}

impl CodebookSpec {
    /// Codes: for FSQ the product of its levels.
    pub fn n_vocab(&self) -> usize {
        match self {
            Self::Fsq { levels } => n_codes(levels),
            Self::Vq { n_vocab } => *n_vocab,
        }
    }

    /// The levels of FSQ.
    pub fn levels(&self) -> Option<&[usize]> {
        match self {
            Self::Fsq { levels } => Some(levels),
            Self::Vq { .. } => None,
        }
    }

    /// Nothing, if it makes codes.
    ///
    /// # Errors
    /// It has no code, too few, or too many to count.
    pub fn check(&self) -> Result<(), VocabularyError> {
        let levels = self.levels().unwrap_or(&[2]);
        let codes = match self {
            Self::Fsq { levels } => levels.iter().try_fold(1usize, |n, l| n.checked_mul(*l)),
            Self::Vq { n_vocab } => Some(*n_vocab),
        };
        if levels.is_empty() {
            Err(VocabularyError::new("no level, so no code"))
        } else if levels.iter().any(|level| *level < 2) {
            Err(VocabularyError::new("a level holds at least 2 values"))
        } else if codes.is_none_or(|codes| codes > MOST_CODES) {
            Err(VocabularyError::new(format!("more than {MOST_CODES} codes")))
        } else if codes.is_some_and(|codes| codes < 2) {
            Err(VocabularyError::new("a vocabulary holds at least 2 codes"))
        } else {
            Ok(())
        }
    }
}

// FSQ's levels for a codebook size, and their mixed-radix numbers.

/// ScaMo Table 8: the size a set of levels is named after, and the levels.
///
/// The size that counts as V is always the product: 240 codes where the paper says 2^8.
const TABLE: [(usize, &[usize]); 9] = [
    (16, &[5, 3]),
    (64, &[8, 8]),
    (256, &[8, 6, 5]),
    (512, &[8, 8, 8]),
    (1024, &[8, 5, 5, 5]),
    (2048, &[8, 8, 6, 5]),
    (4096, &[7, 5, 5, 5, 5]),
    (16384, &[8, 8, 8, 6, 5]),
    (65536, &[8, 8, 8, 5, 5, 5]),
];

/// The levels for a codebook size, nominal (256) or real (240); `None` if ScaMo has none.
pub fn levels_for(nominal: usize) -> Option<&'static [usize]> {
    let wanted =
        |&&(name, levels): &&(usize, &[usize])| name == nominal || n_codes(levels) == nominal;
    TABLE.iter().find(wanted).map(|&(_, levels)| levels)
}

/// The nominal sizes of ScaMo Table 8, in ascending order.
pub fn nominal_sizes() -> impl Iterator<Item = usize> {
    TABLE.iter().map(|&(name, _)| name)
}

/// Codes that a set of levels makes: their product.
pub fn n_codes(levels: &[usize]) -> usize {
    levels.iter().product()
}

/// Σ digitᵢ · Π_{j<i} Lⱼ: the first dimension runs fastest. Digits are in 0..Lᵢ.
pub fn index_of_digits(levels: &[usize], digits: impl IntoIterator<Item = usize>) -> u32 {
    let add = |(index, basis), (digit, &level)| (index + digit * basis, basis * level);
    digits.into_iter().zip(levels).fold((0, 1), add).0 as u32
}

/// The digits of an index, the first dimension's first; inverse of [`index_of_digits`].
pub fn digits_of_index(levels: &[usize], index: u32) -> impl Iterator<Item = usize> {
    let split = |rest: &mut usize, &level: &usize| {
        let digit = *rest % level;
        *rest /= level;
        Some(digit)
    };
    levels.iter().scan(index as usize, split)
}

// Scales, by name or one by one.

/// The scales of a multi-scale quantizer, as they are written in a sweep file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum ScaleSpec {
    /// Ten scales by name.
    Named(ScaleName),
    /// Codes of each scale, the coarsest first.
    List(#[schemars(inner(range(min = 1, max = 16_384)))] Vec<usize>),
}

/// Scales by name. LG-Tok's paper names all three; its code holds `full`, its Listing 1 `mid`. Of
/// `mini` only the sum and both ends are published: what lies between them is ours.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum ScaleName {
    /// 104 codes a clip in ten scales of 1 to 25.
    Mini,
    /// 160 codes a clip in ten scales of 2 to 36 (LG-Tok, Listing 1).
    Mid,
    /// 236 codes a clip in ten scales of 3 to 49 (LG-Tok's default).
    #[default]
    Full,
}

impl ScaleName {
    /// Codes of each scale.
    pub fn lengths(self) -> [usize; 10] {
        match self {
            Self::Mini => [1, 2, 3, 5, 7, 10, 13, 17, 21, 25],
            Self::Mid => [2, 4, 6, 9, 12, 16, 20, 25, 30, 36],
            Self::Full => [3, 6, 10, 15, 20, 25, 30, 36, 42, 49],
        }
    }
}

impl Default for ScaleSpec {
    fn default() -> Self {
        Self::Named(ScaleName::default())
    }
}

impl ScaleSpec {
    /// Codes of each scale.
    pub fn lengths(&self) -> Vec<usize> {
        match self {
            Self::Named(name) => name.lengths().to_vec(),
            Self::List(lengths) => lengths.clone(),
        }
    }
}

impl<'de> Deserialize<'de> for ScaleSpec {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Ways::read(deserializer)
    }
}

impl Ways for ScaleSpec {
    const EXPECTED: &'static str = "`mini`, `mid`, `full`, or a list of the codes of each scale";

    fn of_scalar(name: &Value) -> Option<Result<Self, String>> {
        named(name).map(|name| name.map(Self::Named))
    }

    fn of_list<'de, D: Deserializer<'de>>(list: D) -> Option<Result<Self, D::Error>> {
        Some(number::read(list).map(Self::List))
    }
}

/// Whether there is a scale, each has a code, and each is longer than the one before it.
pub(super) fn are_increasing(scales: &[usize]) -> bool {
    scales.first().is_some_and(|first| *first > 0) && scales.is_sorted_by(|a, b| a < b)
}

/// Codes of each of `n_scales` codebooks: from V/2 to 3V/2 in equal steps, so that V = 512 makes the
/// 256 to 768 of LG-Tok's ten. A single one has V.
pub(super) fn codebook_sizes(n_vocab: usize, n_scales: usize) -> Vec<usize> {
    if n_scales < 2 {
        return vec![n_vocab; n_scales];
    }
    let (v, steps) = (n_vocab as f64, (n_scales - 1) as f64);
    let size = |n: usize| (0.5 * v + v * n as f64 / steps).round_ties_even() as usize;
    (0..n_scales).map(size).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nominal_and_real_sizes_name_the_same_levels() {
        let real = [15, 64, 240, 512, 1000, 1920, 4375, 15360, 64000];
        for (nominal, real) in nominal_sizes().zip(real) {
            let levels = levels_for(nominal).unwrap();
            assert_eq!(n_codes(levels), real);
            assert_eq!(levels_for(real), Some(levels));
        }
        assert_eq!(levels_for(128), None);
    }

    #[test]
    fn indices_and_digits_are_one_to_one_over_every_code() {
        for levels in nominal_sizes().filter_map(levels_for) {
            let mut seen = vec![false; n_codes(levels)];
            for index in 0..n_codes(levels) as u32 {
                let digits: Vec<_> = digits_of_index(levels, index).collect();
                assert!(digits.iter().zip(levels).all(|(digit, level)| digit < level));
                assert_eq!(index_of_digits(levels, digits), index);
                seen[index as usize] = true;
            }
            assert!(seen.into_iter().all(|met| met));
        }
    }

    #[test]
    fn the_first_dimension_runs_fastest() {
        assert_eq!(digits_of_index(&[8, 6, 5], 9).collect::<Vec<_>>(), [1, 1, 0]);
    }
}
