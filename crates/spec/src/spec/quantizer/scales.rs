//! [`ScaleSpec`]: the scales of a multi-scale quantizer, by name or one by one.

use schemars::JsonSchema;
use serde::{Deserialize, Deserializer, Serialize};
use serde_yaml::Value;

use crate::units::{Ways, named, number};

/// The scales of a multi-scale quantizer, as they are written in a sweep file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum ScaleSpec {
    /// Ten scales by name.
    Named(ScaleName),
    /// Codes of each scale, the coarsest first.
    List(Vec<usize>),
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
