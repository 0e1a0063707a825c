//! [`TokenizerSpec`]: everything that a tokenizer follows from, beside its data; and the `tokenizer`
//! section of a sweep file, which has the same keys.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::architecture::{ArchitectureSpec, ConvolutionalSpec};
use super::error::{SpecError, require};
use super::grid::Grid;
use super::quantizer::{QuantizerKind, QuantizerSpec};
use crate::units::number;

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

/// Which tokenizer, as it is written in a sweep file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum TokenizerKind {
    /// The convolutional autoencoder, with the quantizer of `tokenizer.quantizer`.
    Convolutional,
    /// Short for the convolutional autoencoder with FSQ.
    #[default]
    Fsq,
    /// Short for the convolutional autoencoder with VQ.
    Vq,
}

/// The `tokenizer.quantizer` section.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct QuantizerSection {
    pub kind: QuantizerKind,
}

/// The training of a tokenizer and the section of a sweep file, from one list of keys.
macro_rules! keys {
    ($($(#[$about:meta])* $key:ident: $type:ty = $default:expr, $read:literal;)*) => {
        /// How a tokenizer is trained.
        ///
        /// The defaults suit small widths on a CPU: T2M-GPT's recipe (width 512, batch 256, lr 2e-4,
        /// 300 thousand steps, the drop at 2/3) with a higher rate, far fewer steps and a later drop.
        /// Without normalisation layers the codes collapse at rates of 3e-3 and more.
        #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
        #[serde(deny_unknown_fields, default)]
        pub struct TokenizerTraining {
            $($(#[$about])* pub $key: $type,)*
        }

        impl Default for TokenizerTraining {
            fn default() -> Self {
                Self { $($key: $default,)* }
            }
        }

        /// The `tokenizer` section: one tokenizer of this kind is trained for each vocabulary.
        #[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
        #[serde(deny_unknown_fields, default)]
        pub struct TokenizerSection {
            pub kind: TokenizerKind,
            /// With `kind: convolutional`: the quantizer, `{kind: fsq}` by default.
            #[serde(skip_serializing_if = "Option::is_none")]
            pub quantizer: Option<QuantizerSection>,
            /// Channels of the convolutions; ScaMo has 512.
            #[serde(deserialize_with = "number::count")]
            pub width: usize,
            /// Residual blocks at each resolution.
            #[serde(deserialize_with = "number::count")]
            pub depth: usize,
            /// Halvings of the frame rate; 2 make 4 frames a code.
            #[serde(deserialize_with = "number::count")]
            pub down: usize,
            $($(#[$about])* #[serde(deserialize_with = $read)] pub $key: $type,)*
        }

        impl Default for TokenizerSection {
            fn default() -> Self {
                let ConvolutionalSpec { width, depth, down } = ConvolutionalSpec::default();
                let (kind, quantizer) = (TokenizerKind::default(), None);
                Self { kind, quantizer, width, depth, down, $($key: $default,)* }
            }
        }

        impl TokenizerSection {
            /// How its tokenizers are trained.
            fn training(&self) -> TokenizerTraining {
                TokenizerTraining { $($key: self.$key,)* }
            }
        }
    };
}

keys! {
    /// Frames of a training window, whole codes. Shorter clips are not trained on.
    window: usize = 64, "number::count";
    /// Windows a step.
    batch: usize = 32, "number::count";
    /// Training steps.
    steps: usize = 600, "number::count";
    /// Learning rate after the warm-up.
    lr: f64 = 1e-3, "number::number";
    /// Steps over which the rate rises linearly.
    warmup_steps: usize = 50, "number::count";
    /// Share of the steps after which the rate falls; 0.6 in ScaMo.
    decay_at: f64 = 0.8, "number::number";
    /// What the rate is multiplied by then.
    decay_factor: f64 = 0.05, "number::number";
    /// Weight of the joints' positions in the loss, beside all features.
    position_weight: f64 = 0.5, "number::number";
    /// AdamW's β₁.
    beta_1: f64 = 0.9, "number::number";
    /// AdamW's β₂.
    beta_2: f64 = 0.99, "number::number";
    /// AdamW's decoupled weight decay.
    weight_decay: f64 = 0.0, "number::number";
    /// Clips of the training split that are held in memory and trained on.
    pool_clips: usize = 2048, "number::count";
    /// Seed of the weights, the pool and the windows.
    seed: u64 = 0, "number::seed";
}

impl TokenizerSection {
    /// The kind of its quantizer.
    pub fn quantizer_kind(&self) -> QuantizerKind {
        match self.kind {
            TokenizerKind::Fsq => QuantizerKind::Fsq,
            TokenizerKind::Vq => QuantizerKind::Vq,
            TokenizerKind::Convolutional => self.quantizer.unwrap_or_default().kind,
        }
    }

    /// The tokenizer with a quantizer.
    pub fn spec(&self, quantizer: QuantizerSpec) -> TokenizerSpec {
        let Self { width, depth, down, .. } = *self;
        let architecture =
            ArchitectureSpec::Convolutional(ConvolutionalSpec { width, depth, down });
        TokenizerSpec { architecture, quantizer, training: self.training() }
    }

    /// The first setting that no training can use.
    ///
    /// # Errors
    /// [`SpecError`].
    pub fn check(&self) -> Result<(), SpecError> {
        let short = self.kind != TokenizerKind::Convolutional;
        let both = short && self.quantizer.is_some();
        require(!both, "quantizer", "belongs to `kind: convolutional`; `fsq` and `vq` name one")?;
        self.spec(QuantizerSpec::default()).check()
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

    /// The rate of a step, counted from 0: linear warm-up, then flat, then one drop.
    pub fn learning_rate(&self, step: usize) -> f64 {
        let TokenizerTraining { lr, warmup_steps, decay_at, decay_factor, steps, .. } =
            self.training;
        let warmup = ((step + 1) as f64 / (warmup_steps + 1) as f64).min(1.0);
        let dropped = step as f64 >= decay_at * steps as f64;
        lr * warmup * if dropped { decay_factor } else { 1.0 }
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

impl TokenizerTraining {
    fn check(&self) -> Result<(), SpecError> {
        let counts =
            [("batch", self.batch), ("steps", self.steps), ("pool_clips", self.pool_clips)];
        for (field, value) in counts {
            require(value > 0, field, "must be at least 1")?;
        }
        let rates = [
            ("lr", self.lr),
            ("decay_at", self.decay_at),
            ("decay_factor", self.decay_factor),
            ("position_weight", self.position_weight),
            ("weight_decay", self.weight_decay),
        ];
        for (field, value) in rates {
            require(value.is_finite() && value >= 0.0, field, "must not be negative")?;
        }
        require(self.lr > 0.0, "lr", "a rate is above 0")?;
        for (field, value) in [("beta_1", self.beta_1), ("beta_2", self.beta_2)] {
            require((0.0..1.0).contains(&value), field, "a beta lies in [0, 1)")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn with(change: impl FnOnce(&mut TokenizerSection)) -> TokenizerSection {
        let mut section = TokenizerSection::default();
        change(&mut section);
        section
    }

    #[test]
    fn the_rate_rises_stays_and_falls_once() {
        let section = with(|s| (s.steps, s.lr, s.warmup_steps) = (10, 1.0, 3));
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
            (with(|s| s.window = 30), "window"),
            (with(|s| s.lr = f64::NAN), "lr"),
            (with(|s| s.lr = 0.0), "lr"),
            (with(|s| s.down = 0), "down"),
            (with(|s| s.beta_2 = 1.0), "beta_2"),
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
