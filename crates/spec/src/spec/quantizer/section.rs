//! [`QuantizerSection`]: the quantizer as a sweep file has it.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::codebook::{
    CodebookKind, CodebookSpec, ScaleSpec, VocabularyError, are_increasing, codebook_sizes,
};
use super::{MultiscaleSpec, QuantizerSpec, ResidualSpec};
use crate::spec::{SpecError, require, require_all};
use crate::units::number::{self, plain};

plain!(QuantizerSection);

/// MoMask's layers, and how often it drops the last of them.
const LAYERS: usize = 6;
const DROPOUT: f64 = 0.2;
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
    /// Residual quantization (MoMask): several codes per latent, each for the residual of the previous ones.
    Residual,
    /// So many codes for a clip of any length, scale after scale, LG-Tok's.
    Multiscale,
}

/// The `tokenizer.quantizer` section.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct QuantizerSection {
    pub kind: QuantizerKind,
    /// Residual and multi-scale: the kind of each codebook, `vq` by default. `grid.vocab` is the size of a
    /// codebook; those of a multi-scale quantizer rise in equal steps from half of it to three halves.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub inner: Option<CodebookKind>,
    /// Residual: codebooks, 6.
    #[serde(default, deserialize_with = "number::read")]
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1, max = 64))]
    pub layers: Option<usize>,
    /// Residual: how often a training step uses only the first layers, a random number of them: 0.2.
    #[serde(default, deserialize_with = "number::read")]
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0, max = 1))]
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
    #[schemars(range(min = 0, max = 1e6))]
    pub beta: Option<f64>,
    /// Multi-scale: weight of a convolution in the contribution of a scale (VAR). 0 means LG-Tok's two
    /// convolutions with ReLU, which are never negative: 0, for patches 0.5.
    #[serde(default, deserialize_with = "number::read")]
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0, max = 1))]
    pub mix: Option<f64>,
}

impl QuantizerKind {
    /// The section with this kind alone.
    pub fn section(self) -> QuantizerSection {
        QuantizerSection { kind: self, ..QuantizerSection::default() }
    }
}

impl QuantizerSection {
    /// The kind of each codebook.
    pub fn codebook_kind(&self) -> CodebookKind {
        match self.kind {
            QuantizerKind::Fsq => CodebookKind::Fsq,
            QuantizerKind::Vq => CodebookKind::Vq,
            QuantizerKind::Residual | QuantizerKind::Multiscale => self.inner.unwrap_or_default(),
        }
    }

    /// The number of codebooks.
    pub fn n_codebooks(&self) -> usize {
        match self.kind {
            QuantizerKind::Fsq | QuantizerKind::Vq => 1,
            QuantizerKind::Residual => self.layers.unwrap_or(LAYERS),
            QuantizerKind::Multiscale => self.scale_lengths().len(),
        }
    }

    /// Codes of a clip on each scale of a fixed length; none if lengths follow the clip.
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
        let of_layers = "belongs to `kind: residual`";
        let of_scales = "belongs to `kind: multiscale`";
        let directions = "belongs to `kind: multiscale` with `inner: vq`";
        let increasing = self.scales.is_none() || are_increasing(&self.scale_lengths());
        let not_increasing =
            "must be one or more numbers above 0, each larger than the one before it";
        require_all(belonging! {
            self, "quantizer.";
            several, inner => inner;
            residual, of_layers => layers, dropout;
            multiscale, of_scales => scales;
            compared, directions => cosine;
            multiscale, of_scales => beta, mix;
        })?;
        require(increasing, "quantizer.scales", not_increasing)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spec::ScaleName;

    fn section(
        change: impl FnOnce(&mut QuantizerSection),
        kind: QuantizerKind,
    ) -> QuantizerSection {
        let mut section = kind.section();
        change(&mut section);
        section
    }

    fn sizes(spec: &QuantizerSpec) -> Vec<usize> {
        spec.codebooks().iter().map(CodebookSpec::n_vocab).collect()
    }

    #[test]
    fn a_multi_scale_vocabulary_of_512_has_the_ten_codebooks_of_lg_tok() {
        let spec = QuantizerKind::Multiscale.section().of_size(512).unwrap();
        assert_eq!(sizes(&spec), [256, 313, 370, 427, 484, 540, 597, 654, 711, 768]);
        let grid = spec.grid(4);
        assert_eq!((grid.n_codes(40), grid.n_codes(196), grid.end_token), (236, 236, false));
        assert_eq!((spec.n_vocab(), grid.n_vocab()), (5120, 5120));
    }

    #[test]
    fn named_scales_have_the_published_sums() {
        let sums = [ScaleName::Mini, ScaleName::Mid, ScaleName::Full].map(|name| {
            assert!(are_increasing(&name.lengths()));
            name.lengths().iter().sum::<usize>()
        });
        assert_eq!(sums, [104, 160, 236]);
    }

    #[test]
    fn residual_layers_have_one_code_a_latent_each() {
        let spec = QuantizerKind::Residual.section().of_size(512).unwrap();
        let grid = spec.grid(4);
        assert_eq!((grid.n_codes(196), grid.n_vocab(), grid.end_token), (294, 3072, false));
        let fsq = section(|s| s.inner = Some(CodebookKind::Fsq), QuantizerKind::Residual);
        let spec = fsq.of_size(256).unwrap();
        assert_eq!((sizes(&spec), spec.levels()), (vec![240; 6], Some(&[8, 6, 5][..])));
        assert!(QuantizerKind::Residual.section().of_levels(&[8, 6, 5]).is_err());
    }

    #[test]
    fn a_spec_of_several_scales_reads_back() {
        let multiscale =
            section(|s| s.scales = Some(ScaleSpec::List(vec![1, 3])), QuantizerKind::Multiscale);
        let specs = [multiscale.of_size(64), QuantizerKind::Residual.section().of_size(64)];
        for spec in specs.map(Result::unwrap) {
            let text = serde_json::to_string(&spec).unwrap();
            assert_eq!(serde_json::from_str::<QuantizerSpec>(&text).unwrap(), spec, "{text}");
            let other = text.replacen("\"kind\"", "\"knid\": 1, \"kind\"", 1);
            assert!(serde_json::from_str::<QuantizerSpec>(&other).is_err(), "{other}");
        }
    }

    #[test]
    fn keys_of_another_kind_and_impossible_values_are_named() {
        use QuantizerKind::{Fsq, Multiscale, Residual, Vq};
        let scales = |list: &[usize]| Some(ScaleSpec::List(list.to_vec()));
        let bad = [
            (section(|s| s.layers = Some(2), Vq), "layers: belongs to `kind: residual`"),
            (section(|s| s.inner = Some(CodebookKind::Vq), Fsq), "inner: belongs to"),
            (
                section(|s| s.scales = scales(&[1, 2]), Residual),
                "scales: belongs to `kind: multiscale`",
            ),
            (
                section(|s| s.dropout = Some(0.1), Multiscale),
                "dropout: belongs to `kind: residual`",
            ),
            (section(|s| s.scales = scales(&[]), Multiscale), "scales: must be one or more"),
            (section(|s| s.scales = scales(&[3, 3]), Multiscale), "scales: must be one or more"),
            (section(|s| s.scales = scales(&[0, 3]), Multiscale), "scales: must be one or more"),
            (
                section(
                    |s| (s.inner, s.cosine) = (Some(CodebookKind::Fsq), Some(true)),
                    Multiscale,
                ),
                "cosine: belongs to `kind: multiscale` with `inner: vq`",
            ),
        ];
        for (section, sentence) in bad {
            let error = section.check().unwrap_err().to_string();
            assert!(error.starts_with(&format!("tokenizer.quantizer.{sentence}")), "{error}");
        }
        assert!([Fsq, Vq, Residual, Multiscale].iter().all(|kind| kind.section().check().is_ok()));
    }
}
