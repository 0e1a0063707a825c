//! [`TokenizerSpec`]: everything that a tokenizer follows from, beside its data.

use serde::{Deserialize, Serialize};

use super::architecture::{ArchitectureSpec, ConvolutionalSpec, PatchSpec};
use super::error::{SpecError, require};
use super::grid::Grid;
use super::quantizer::{QuantizerKind, QuantizerSpec};
use super::tokenizer_training::{
    TokenizerKind, TokenizerLoss, TokenizerSchedule, TokenizerSection, TokenizerTraining,
};

/// A tokenizer, resolved: what is hashed.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TokenizerSpec {
    pub architecture: ArchitectureSpec,
    /// By default FSQ with levels 8, 6, 5 (240 codes).
    pub quantizer: QuantizerSpec,
    pub training: TokenizerTraining,
}

impl Default for QuantizerSpec {
    fn default() -> Self {
        Self::Fsq { levels: vec![8, 6, 5] }
    }
}

impl TokenizerSection {
    /// The kind of its quantizer.
    pub fn quantizer_kind(&self) -> QuantizerKind {
        let written = self.quantizer.map(|section| section.kind);
        match self.kind {
            TokenizerKind::Fsq => QuantizerKind::Fsq,
            TokenizerKind::Vq => QuantizerKind::Vq,
            TokenizerKind::Convolutional => written.unwrap_or_default(),
            TokenizerKind::Patch => written.unwrap_or(QuantizerKind::Vq),
        }
    }

    /// The tokenizers with a quantizer, one a seed.
    pub fn specs(&self, quantizer: &QuantizerSpec) -> Vec<TokenizerSpec> {
        let own = self.spec(quantizer.clone());
        let seeded = |seed: &u64| {
            let mut spec = own.clone();
            spec.training.seed = *seed;
            spec
        };
        if self.seeds.is_empty() { vec![own] } else { self.seeds.iter().map(seeded).collect() }
    }

    /// The tokenizer with a quantizer and the first seed.
    pub fn spec(&self, quantizer: QuantizerSpec) -> TokenizerSpec {
        let defaults = match self.kind {
            TokenizerKind::Patch => TokenizerTraining::of_patches(),
            _ => TokenizerTraining::default(),
        };
        let mut training = self.training_over(defaults);
        if training.loss == TokenizerLoss::Features {
            // Bodies are mixed for the loss of joints alone, unless somebody writes otherwise.
            training.mix_body = self.mix_body.unwrap_or(0.0);
            training.mix_arm = self.mix_arm.unwrap_or(0.0);
        }
        TokenizerSpec { architecture: self.architecture(), quantizer, training }
    }

    fn architecture(&self) -> ArchitectureSpec {
        if self.kind == TokenizerKind::Patch {
            let default = PatchSpec::default();
            return ArchitectureSpec::Patch(PatchSpec {
                width: self.width.unwrap_or(default.width),
                frames: self.frames.unwrap_or(default.frames),
                latent: self.latent.unwrap_or(default.latent),
                encoder_blocks: self.encoder_blocks.unwrap_or(default.encoder_blocks),
                decoder_blocks: self.decoder_blocks.unwrap_or(default.decoder_blocks),
            });
        }
        let default = ConvolutionalSpec::default();
        ArchitectureSpec::Convolutional(ConvolutionalSpec {
            width: self.width.unwrap_or(default.width),
            depth: self.depth.unwrap_or(default.depth),
            down: self.down.unwrap_or(default.down),
        })
    }

    /// The first setting that no training can use.
    ///
    /// # Errors
    /// [`SpecError`].
    pub fn check(&self) -> Result<(), SpecError> {
        let short = matches!(self.kind, TokenizerKind::Fsq | TokenizerKind::Vq);
        let both = short && self.quantizer.is_some();
        require(!both, "quantizer", "`kind: fsq` and `kind: vq` name one already")?;
        let twice = self.seed.is_some() && !self.seeds.is_empty();
        require(!twice, "seed", "is one of `seeds`: leave one of the two out")?;
        self.check_kind()?;
        let spec = self.spec(QuantizerSpec::default());
        self.check_use(&spec.training)?;
        spec.check()
    }

    /// No key is written that nothing reads.
    fn check_use(&self, training: &TokenizerTraining) -> Result<(), SpecError> {
        let joints = training.loss == TokenizerLoss::Joints;
        let step = training.schedule == TokenizerSchedule::Step;
        let vq = self.quantizer_kind() == QuantizerKind::Vq;
        let written = [
            ("decay_at", self.decay_at, step, "belongs to `schedule: step`"),
            ("position_weight", self.position_weight, !joints, "belongs to `loss: features`"),
            ("feature_weight", self.feature_weight, joints, "belongs to `loss: joints`"),
            ("velocity_weight", self.velocity_weight, joints, "belongs to `loss: joints`"),
            ("commitment", self.commitment, vq, "belongs to VQ"),
            ("reset_share", self.reset_share, vq, "belongs to VQ"),
        ];
        for (field, value, is_read, problem) in written {
            require(is_read || value.is_none(), field, problem)?;
        }
        Ok(())
    }

    /// No key of one kind is written for the other.
    fn check_kind(&self) -> Result<(), SpecError> {
        let patch = self.kind == TokenizerKind::Patch;
        for (field, written) in [("depth", self.depth), ("down", self.down)] {
            require(!patch || written.is_none(), field, "is not of `kind: patch`")?;
        }
        let patches = [
            ("frames", self.frames),
            ("latent", self.latent),
            ("encoder_blocks", self.encoder_blocks),
            ("decoder_blocks", self.decoder_blocks),
        ];
        for (field, written) in patches {
            require(patch || written.is_none(), field, "belongs to `kind: patch`")?;
        }
        Ok(())
    }
}

impl TokenizerSpec {
    /// Codes (V).
    pub fn n_vocab(&self) -> usize {
        self.quantizer.n_vocab()
    }

    /// The codes that it gives clips.
    pub fn grid(&self) -> Grid {
        self.quantizer.grid(self.architecture.frames_per_latent())
    }

    /// The rate of a step, counted from 0.
    pub fn learning_rate(&self, step: usize) -> f64 {
        self.training.learning_rate(step)
    }

    /// The first field that no training can use.
    ///
    /// # Errors
    /// [`SpecError`].
    pub fn check(&self) -> Result<(), SpecError> {
        self.architecture.check()?;
        let quantizer = self.quantizer.clone().checked();
        quantizer.map_err(|error| SpecError { field: "quantizer", problem: error.problem })?;
        self.check_window()?;
        self.training.check()
    }

    fn check_window(&self) -> Result<(), SpecError> {
        let stride = self.architecture.frames_per_latent();
        let whole = self.training.window > 0 && self.training.window.is_multiple_of(stride);
        require(whole, "window", &format!("must be a multiple of the {stride} frames of a code"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spec::QuantizerSection;

    fn with(change: impl FnOnce(&mut TokenizerSection)) -> TokenizerSection {
        let mut section = TokenizerSection::default();
        change(&mut section);
        section
    }

    #[test]
    fn the_rate_rises_stays_and_falls_once() {
        let section = with(|s| (s.steps, s.lr, s.warmup_steps) = (Some(10), Some(1.0), Some(3)));
        let spec = section.spec(QuantizerSpec::default());
        let rates: Vec<f64> = (0..10).map(|step| spec.learning_rate(step)).collect();
        assert_eq!(rates, [0.25, 0.5, 0.75, 1.0, 1.0, 1.0, 1.0, 1.0, 0.05, 0.05]);
    }

    #[test]
    fn a_written_spec_reads_back_and_unknown_fields_are_refused() {
        let spec =
            TokenizerSpec { quantizer: QuantizerSpec::Vq { n_vocab: 32 }, ..Default::default() };
        let text = serde_json::to_string(&spec).unwrap();
        assert_eq!(serde_json::from_str::<TokenizerSpec>(&text).unwrap(), spec);
        let text = r#"{"training": {"widht": 8}}"#;
        let error = serde_json::from_str::<TokenizerSpec>(text).unwrap_err();
        assert!(error.to_string().contains("widht"), "{error}");
    }

    #[test]
    fn a_bad_field_is_named() {
        assert!(TokenizerSection::default().check().is_ok());
        let section = QuantizerSection { kind: QuantizerKind::Vq };
        let bad = [
            (with(|s| s.window = Some(30)), "window"),
            (with(|s| s.lr = Some(f64::NAN)), "lr"),
            (with(|s| s.lr = Some(0.0)), "lr"),
            (with(|s| s.down = Some(0)), "down"),
            (with(|s| s.beta_2 = Some(1.0)), "beta_2"),
            (with(|s| s.quantizer = Some(section)), "quantizer"),
        ];
        for (section, field) in bad {
            let error = section.check().unwrap_err().to_string();
            assert!(error.starts_with(&format!("tokenizer.{field}: ")), "{error}");
        }
        let levels = |levels: &[usize]| QuantizerSpec::Fsq { levels: levels.to_vec() };
        for quantizer in [levels(&[8, 1]), levels(&[usize::MAX, 9]), levels(&[])] {
            let spec = TokenizerSpec { quantizer, ..TokenizerSpec::default() };
            assert_eq!(spec.check().unwrap_err().field, "quantizer");
        }
    }

    #[test]
    fn the_short_form_and_the_long_one_are_the_same() {
        let quantizer = Some(QuantizerSection { kind: QuantizerKind::Vq });
        let long = with(|s| (s.kind, s.quantizer) = (TokenizerKind::Convolutional, quantizer));
        let short = with(|s| s.kind = TokenizerKind::Vq);
        assert_eq!(long.quantizer_kind(), short.quantizer_kind());
        let spec = |section: &TokenizerSection| section.spec(QuantizerSpec::default());
        assert_eq!(spec(&long), spec(&short));
    }
}
