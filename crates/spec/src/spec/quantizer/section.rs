//! [`QuantizerSection`]: the quantizer as a sweep file has it.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::codebook::{CodebookKind, CodebookSpec, VocabularyError};
use super::scales::{ScaleSpec, are_increasing, codebook_sizes};
use super::{MultiscaleSpec, QuantizerSpec, ResidualSpec};
use crate::spec::error::{SpecError, require_all};
use crate::units::number;

/// MoMask's layers, and how often it drops the last of them.
const LAYERS: usize = 6;
const DROPOUT: f64 = 0.2;
/// Layers beyond which a number is taken for a slip of the pen.
const MOST_LAYERS: usize = 64;
/// LG-Tok's weight of the term that draws latents to their codes.
const BETA: f64 = 1.0;

/// A kind of quantizer, as it is written in a sweep file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum QuantizerKind {
    /// Finite scalar quantization (Mentzer et al. 2023), ScaMo's.
    #[default]
    Fsq,
    /// Vector quantization with moving averages and resets, T2M-GPT's.
    Vq,
    /// Several codes for a latent, each of what those before it leave over, MoMask's.
    Residual,
    /// So many codes for a clip of any length, scale after scale, LG-Tok's.
    Multiscale,
}

/// The `tokenizer.quantizer` section.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct QuantizerSection {
    pub kind: QuantizerKind,
    /// Residual and multi-scale: what each codebook is, `vq` by default. `grid.vocab` is the size of a
    /// codebook; those of a multi-scale quantizer have half of it to three halves of it, in equal steps.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub inner: Option<CodebookKind>,
    /// Residual: codebooks, 6.
    #[serde(default, deserialize_with = "number::read")]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub layers: Option<usize>,
    /// Residual: how often a training step uses only the first layers, a random number of them: 0.2.
    #[serde(default, deserialize_with = "number::read")]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub dropout: Option<f64>,
    /// Multi-scale: codes of each scale, as a list or by name: `full`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scales: Option<ScaleSpec>,
    /// Multi-scale with `inner: vq`: codes are compared by direction and not by place: `true`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cosine: Option<bool>,
    /// Multi-scale: weight of the term that draws latents to their codes, beside the one that draws
    /// codes to latents: 1.
    #[serde(default, deserialize_with = "number::read")]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub beta: Option<f64>,
    /// Multi-scale: share of a convolution in what a scale adds (VAR). 0 stands for LG-Tok's two
    /// convolutions with ReLU, after which a scale adds nothing below 0: 0, for patches 0.5.
    #[serde(default, deserialize_with = "number::read")]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mix: Option<f64>,
}

impl QuantizerKind {
    /// The section with this kind alone.
    pub fn section(self) -> QuantizerSection {
        QuantizerSection { kind: self, ..QuantizerSection::default() }
    }
}

impl QuantizerSection {
    /// What each codebook is.
    pub fn codebook_kind(&self) -> CodebookKind {
        match self.kind {
            QuantizerKind::Fsq => CodebookKind::Fsq,
            QuantizerKind::Vq => CodebookKind::Vq,
            QuantizerKind::Residual | QuantizerKind::Multiscale => self.inner.unwrap_or_default(),
        }
    }

    /// How many codebooks there are.
    pub fn n_codebooks(&self) -> usize {
        match self.kind {
            QuantizerKind::Fsq | QuantizerKind::Vq => 1,
            QuantizerKind::Residual => self.layers.unwrap_or(LAYERS),
            QuantizerKind::Multiscale => self.scale_lengths().len(),
        }
    }

    /// Codes of a clip on each scale of a fixed length; none where lengths follow the clip.
    pub fn scale_lengths(&self) -> Vec<usize> {
        match self.kind {
            QuantizerKind::Multiscale => self.scales.clone().unwrap_or_default().lengths(),
            _ => Vec::new(),
        }
    }

    /// The quantizer whose codebooks have so many codes.
    ///
    /// # Errors
    /// There is none.
    pub fn of_size(&self, n: usize) -> Result<QuantizerSpec, VocabularyError> {
        let kind = self.codebook_kind();
        match (self.kind, kind) {
            (QuantizerKind::Multiscale, CodebookKind::Vq) => {
                let sizes = codebook_sizes(n, self.n_codebooks());
                let codebooks = sizes.into_iter().map(|n_vocab| CodebookSpec::Vq { n_vocab });
                self.of_codebooks(codebooks.collect())
            }
            _ => self.of_codebooks(vec![kind.of_size(n)?; self.n_codebooks()]),
        }
    }

    /// The quantizer whose codebooks have so many codes, whatever their kind: FSQ's levels bind no codes but
    /// those of a tokenizer.
    ///
    /// # Errors
    /// Fewer codes than two, or too many to count.
    pub fn of_codes(&self, n: usize) -> Result<QuantizerSpec, VocabularyError> {
        match self.codebook_kind() {
            CodebookKind::Vq => self.of_size(n),
            CodebookKind::Fsq => {
                self.of_codebooks(vec![CodebookSpec::Vq { n_vocab: n }; self.n_codebooks()])
            }
        }
    }

    /// The quantizer whose codebooks have these levels.
    ///
    /// # Errors
    /// Its codebooks have no levels, or these make no codes.
    pub fn of_levels(&self, levels: &[usize]) -> Result<QuantizerSpec, VocabularyError> {
        let codebook = self.codebook_kind().of_levels(levels)?;
        self.of_codebooks(vec![codebook; self.n_codebooks()])
    }

    fn of_codebooks(&self, codebooks: Vec<CodebookSpec>) -> Result<QuantizerSpec, VocabularyError> {
        let none = || VocabularyError::new("no codebook, so no code");
        let first = codebooks.first().cloned().ok_or_else(none)?;
        let spec = match self.kind {
            QuantizerKind::Fsq | QuantizerKind::Vq => QuantizerSpec::of_codebook(first),
            QuantizerKind::Residual => QuantizerSpec::Residual(ResidualSpec {
                layers: self.n_codebooks(),
                codebook: first,
                dropout: self.dropout.unwrap_or(DROPOUT),
            }),
            QuantizerKind::Multiscale => QuantizerSpec::Multiscale(MultiscaleSpec {
                scales: self.scale_lengths(),
                codebooks,
                cosine: self.codebook_kind() == CodebookKind::Vq && self.cosine.unwrap_or(true),
                beta: self.beta.unwrap_or(BETA),
                mix: self.mix.filter(|mix| *mix > 0.0),
            }),
        };
        spec.checked()
    }

    /// The first key that does not belong to its kind, or has an impossible value.
    ///
    /// # Errors
    /// [`SpecError`].
    pub fn check(&self) -> Result<(), SpecError> {
        let residual = self.kind == QuantizerKind::Residual;
        let multiscale = self.kind == QuantizerKind::Multiscale;
        let several = residual || multiscale;
        let compared = multiscale && self.codebook_kind() == CodebookKind::Vq;
        let inner = "belongs to `kind: residual` and `kind: multiscale`";
        let (of_layers, of_scales) =
            ("belongs to `kind: residual`", "belongs to `kind: multiscale`");
        let directions = "belongs to `kind: multiscale` with `inner: vq`";
        let layers = (1..=MOST_LAYERS).contains(&self.n_codebooks()) || self.layers.is_none();
        let share = |value: Option<f64>| value.is_none_or(|value| (0.0..=1.0).contains(&value));
        let beta = self.beta.is_none_or(|beta| beta.is_finite() && beta >= 0.0);
        let increasing = self.scales.is_none() || are_increasing(&self.scale_lengths());
        let not_increasing =
            "must be one or more numbers above 0, each larger than the one before it";
        let most = format!("must be 1 to {MOST_LAYERS}");
        require_all([
            (several || self.inner.is_none(), "quantizer.inner", inner),
            (residual || self.layers.is_none(), "quantizer.layers", of_layers),
            (residual || self.dropout.is_none(), "quantizer.dropout", of_layers),
            (multiscale || self.scales.is_none(), "quantizer.scales", of_scales),
            (compared || self.cosine.is_none(), "quantizer.cosine", directions),
            (multiscale || self.beta.is_none(), "quantizer.beta", of_scales),
            (multiscale || self.mix.is_none(), "quantizer.mix", of_scales),
            (layers, "quantizer.layers", &most),
            (share(self.dropout), "quantizer.dropout", "lies between 0 and 1"),
            (share(self.mix), "quantizer.mix", "lies between 0 and 1"),
            (beta, "quantizer.beta", "must not be negative"),
            (increasing, "quantizer.scales", not_increasing),
        ])
    }
}
