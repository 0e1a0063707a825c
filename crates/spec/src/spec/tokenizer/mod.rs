//! [`TokenizerSpec`]: the full specification of a tokenizer, without its data.

mod architecture;
mod pieces;
mod section;
mod training;
mod transformer;

use serde::{Deserialize, Serialize};

pub use architecture::{ArchitectureSpec, BegunFrom, Codes, ConvolutionalSpec, PatchSpec};
pub use pieces::Piece;
pub use training::{
    Plateau, TokenizerKind, TokenizerLoss, TokenizerSchedule, TokenizerSection, TokenizerTrainer,
    TokenizerTraining,
};
pub use transformer::{
    Detokenizer, LanguagePlace, LanguageSection, LanguageSpec, Positions, TokenizerNorm,
    TransformerSpec,
};

use super::{
    CodebookSpec, Grid, QuantizerSpec, Representation, ResidualSpec, SpecError, out_of_range,
    require, require_all,
};

/// A tokenizer, resolved for hashing.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TokenizerSpec {
    pub architecture: ArchitectureSpec,
    /// By default FSQ with levels 8, 6, 5 (240 codes).
    pub quantizer: QuantizerSpec,
    #[serde(skip_serializing_if = "crate::units::is_default")]
    pub representation: Representation,
    pub training: TokenizerTraining,
    /// `None` if all steps are taken and the last weights kept.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub plateau: Option<Plateau>,
    /// Left out of ids and files for the built-in trainer.
    #[serde(skip_serializing_if = "TokenizerTrainer::is_built_in")]
    pub trainer: TokenizerTrainer,
}

/// Clips that the centres of [`TokenizerSpec::k_means_beside`] are placed by, and their mirror images.
const K_MEANS_CLIPS: usize = 512;

impl TokenizerSpec {
    /// Codes (V).
    pub fn n_vocab(&self) -> usize {
        self.quantizer.n_vocab()
    }

    /// Patches of training clips that it begins from, where the pool has as many; none if it begins
    /// from no data.
    pub fn begun_from(&self) -> Option<BegunFrom> {
        let ArchitectureSpec::Patch(patch) = &self.architecture else { return None };
        let learned = |codebook: &CodebookSpec| match codebook {
            CodebookSpec::Vq { n_vocab } => *n_vocab,
            CodebookSpec::Fsq { .. } => 0,
        };
        let n_codes = self.quantizer.codebooks().iter().map(learned).max().unwrap_or(0);
        Some(patch.begun_from(n_codes))
    }

    /// The codes that it gives clips.
    pub fn grid(&self) -> Grid {
        self.quantizer.grid(self.stride())
    }

    /// Frames that clips are cut to multiples of: [`ArchitectureSpec::stride`].
    pub fn stride(&self) -> usize {
        self.architecture.stride()
    }

    /// FLOPs that training on a frame counts for, beside the budgets of runs.
    pub fn flops_per_frame(&self) -> f64 {
        let products = self.quantizer.products_per_latent(self.architecture.code_dim());
        self.architecture.flops_per_frame() + 6.0 * products * self.architecture.latents_per_frame()
    }

    /// Bytes that the backward pass keeps of a frame of a step: those of the architecture, and of each
    /// convolution of a quantizer's scales its taps, what it gives, and what is added up.
    pub fn training_bytes_per_frame(&self) -> f64 {
        let c = self.architecture.code_dim();
        let floats = 2.0 * self.quantizer.products_per_latent(c) / c as f64;
        self.architecture.training_bytes_per_frame()
            + 4.0 * floats * self.architecture.latents_per_frame()
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
        let mut numbers = out_of_range::<TokenizerSection>(&self.architecture);
        numbers.extend(out_of_range::<TokenizerSection>(&self.training));
        numbers.into_iter().next().map_or(Ok(()), |problem| Err(SpecError::from(problem)))?;
        self.architecture.check()?;
        let quantizer = self.quantizer.clone().checked();
        quantizer
            .map_err(|error| SpecError { field: "quantizer".into(), problem: error.problem })?;
        self.check_latents()?;
        self.check_window()?;
        self.check_captions()?;
        self.plateau.map_or(Ok(()), |plateau| plateau.check(self.training.steps))?;
        self.check_trainer()?;
        self.training.check()
    }

    /// No window is parted from its caption.
    fn check_captions(&self) -> Result<(), SpecError> {
        let TokenizerTraining { mirror, mix_body, mix_arm, .. } = self.training;
        let unread = self.architecture.language().is_none();
        let mirrored = "shows mirrored clips the captions of their originals where `language` is set: \
                        leave it out, or set data.mirror";
        let mixed =
            "shows parts of other clips under a caption where `language` is set: leave it out";
        require_all([
            (unread || !mirror, "mirror", mirrored),
            (unread || mix_body == 0.0, "mix_body", mixed),
            (unread || mix_arm == 0.0, "mix_arm", mixed),
        ])
    }

    fn check_window(&self) -> Result<(), SpecError> {
        let (stride, window) = (self.stride(), self.training.window);
        let whole = window > 0 && window.is_multiple_of(stride);
        require(whole, "window", &format!("must be a multiple of the {stride} frames of a code"))?;
        let (scale, latents) =
            (self.quantizer.longest_scale(), self.architecture.n_latents(window));
        let (key, least) = match self.architecture.fixed_latents() {
            Some(_) => ("latents", scale),
            None => ("window", scale * stride),
        };
        let problem = format!(
            "a scale of {scale} codes is longer than a window, which has {latents} latents: set it to \
             {least} or more, or shorten tokenizer.quantizer.scales"
        );
        require(scale <= latents, key, &problem)
    }

    /// Codes of other quantizers than those of several scales are as many as there are strides.
    fn check_latents(&self) -> Result<(), SpecError> {
        let scales = matches!(self.quantizer, QuantizerSpec::Multiscale(_));
        require(scales || self.architecture.fixed_latents().is_none(), "latents", OF_SCALES)
    }

    /// The first setting that the trainer of the spec cannot follow.
    fn check_trainer(&self) -> Result<(), SpecError> {
        if self.trainer.is_built_in() {
            return Ok(());
        }
        let patches = matches!(self.architecture, ArchitectureSpec::Patch(_));
        let residual = matches!(self.quantizer, QuantizerSpec::Residual(_));
        let TokenizerTraining { mix_body, mix_arm, .. } = self.training;
        let TokenizerTraining { acceleration_weight, root_weight, .. } = self.training;
        let mixes = mix_body > 0.0 || mix_arm > 0.0;
        let unweighted = acceleration_weight == 0.0 && root_weight == 0.0;
        let all_steps = self.plateau.is_none();
        let rules = [
            (!patches, "`torch` trains no patches: leave `trainer` out"),
            (!residual, "`torch` trains no residual quantizers: leave `trainer` out"),
            (!mixes, "`torch` mixes no bodies: set mix_body and mix_arm to 0"),
            (unweighted, "`torch` lacks acceleration_weight and root_weight: leave both out"),
            (all_steps, "`torch` takes all steps: leave tokenizer.plateau out"),
        ];
        require_all(rules.map(|(holds, problem)| (holds, "trainer", problem)))
    }

    /// The k-means that it is measured beside, as a tokenizer of its own: of patches as long as what a code
    /// stands for, four frames at most, since principal components of longer ones take minutes and
    /// gigabytes; with as many codebooks of as many codes as this tokenizer has. None for scales of
    /// several lengths, which it cannot place.
    pub fn k_means_beside(&self) -> Option<Self> {
        let n_vocab = self.quantizer.codebooks().first()?.n_vocab();
        let codebook = CodebookSpec::Vq { n_vocab };
        let quantizer = match &self.quantizer {
            QuantizerSpec::Fsq { .. } | QuantizerSpec::Vq { .. } => QuantizerSpec::Vq { n_vocab },
            QuantizerSpec::Residual(own) => {
                QuantizerSpec::Residual(ResidualSpec { codebook, ..own.clone() })
            }
            QuantizerSpec::Multiscale(_) => return None,
        };
        let longest = PatchSpec::default();
        let frames = self.stride().min(longest.frames);
        Some(Self {
            architecture: ArchitectureSpec::Patch(PatchSpec { frames, ..longest }),
            quantizer,
            training: TokenizerTraining {
                pool_clips: K_MEANS_CLIPS,
                ..TokenizerTraining::of_patches()
            },
            ..Self::default()
        })
    }
}

/// Why a fixed number of latents is refused.
const OF_SCALES: &str = "belongs to `quantizer: {kind: multiscale}`: other quantizers make a code of each latent, and \
                         their generators want one for so many frames";

#[cfg(test)]
mod tests {
    use super::training::with;
    use super::*;
    use crate::spec::{QuantizerKind, TextSpec};

    #[test]
    fn a_written_spec_reads_back_and_unknown_fields_are_refused() {
        let spec =
            TokenizerSpec { quantizer: QuantizerSpec::Vq { n_vocab: 32 }, ..Default::default() };
        let text = serde_json::to_string(&spec).unwrap();
        assert_eq!(serde_json::from_str::<TokenizerSpec>(&text).unwrap(), spec);
        let error = serde_json::from_str::<TokenizerSpec>(r#"{"widht": 8}"#).unwrap_err();
        assert!(error.to_string().contains("widht"), "{error}");
    }

    #[test]
    fn a_bad_field_is_named() {
        assert!(TokenizerSection::default().check().is_ok());
        let bad = [
            (with(|s| s.window = Some(30)), "window"),
            (with(|s| s.lr = Some(0.0)), "lr"),
            (with(|s| s.down = Some(0)), "down"),
            (with(|s| s.beta_2 = Some(1.0)), "beta_2"),
            (with(|s| s.quantizer = Some(QuantizerKind::Vq.section())), "quantizer"),
        ];
        for (section, field) in bad {
            let error = section.check().unwrap_err().to_string();
            assert!(error.starts_with(&format!("tokenizer.{field}: ")), "{error}");
        }
        for levels in [vec![8, 1], vec![usize::MAX, 9], vec![]] {
            let quantizer = QuantizerSpec::Fsq { levels };
            let spec = TokenizerSpec { quantizer, ..TokenizerSpec::default() };
            assert_eq!(spec.check().unwrap_err().field, "quantizer");
        }
    }

    #[test]
    fn the_short_form_and_the_long_one_are_the_same() {
        let quantizer = Some(QuantizerKind::Vq.section());
        let long = with(|s| (s.kind, s.quantizer) = (TokenizerKind::Convolutional, quantizer));
        let short = with(|s| s.kind = TokenizerKind::Vq);
        assert_eq!(long.quantizer(), short.quantizer());
        let spec = |one: &TokenizerSection| one.spec(QuantizerSpec::default(), &Default::default());
        assert_eq!(spec(&long), spec(&short));
    }

    #[test]
    fn a_window_holds_the_longest_scale_and_patches_mix() {
        let mut section = with(|s| s.kind = TokenizerKind::Patch);
        section.quantizer = Some(QuantizerKind::Multiscale.section());
        let quantizer = section.quantizer().of_size(64).unwrap();
        assert_eq!(section.spec(quantizer, &TextSpec::default()).training.window, 196);
        assert!(section.check().is_ok());
        let mix = |section: &TokenizerSection| {
            let quantizer = section.quantizer().of_size(64).unwrap();
            if let QuantizerSpec::Multiscale(own) = quantizer { own.mix } else { Some(f64::NAN) }
        };
        let mut plain = section.quantizer.clone().unwrap();
        plain.mix = Some(0.0);
        assert_eq!(mix(&section), Some(0.5));
        assert_eq!(mix(&TokenizerSection { quantizer: Some(plain), ..section.clone() }), None);
        section.window = Some(96);
        let error = section.check().unwrap_err().to_string();
        assert!(error.contains("a scale of 49 codes") && error.contains("196 or more"), "{error}");
    }

    #[test]
    fn a_fixed_number_of_latents_holds_the_longest_scale_in_any_window() {
        let quantizer = Some(QuantizerKind::Multiscale.section());
        let of = |latents, window| {
            with(|s| {
                (s.kind, s.quantizer) = (TokenizerKind::Transformer, quantizer.clone());
                (s.latents, s.window) = (latents, window);
            })
        };
        let spec = |section: &TokenizerSection| {
            let quantizer = section.quantizer().of_size(64).unwrap();
            section.spec(quantizer, &TextSpec::default())
        };
        let fixed = of(Some(49), None);
        assert!(fixed.check().is_ok() && of(Some(60), Some(100)).check().is_ok());
        assert_eq!([&fixed, &of(None, None)].map(|s| spec(s).training.window), [64, 196]);
        let written = |section| serde_json::to_string(&spec(section)).unwrap();
        assert!(written(&fixed).contains("\"latents\":49"));
        assert!(!written(&of(None, None)).contains("latents"), "ids know no key that is not set");
        let told = |section: TokenizerSection| section.check().unwrap_err().to_string();
        let few = told(of(Some(36), None));
        assert!(few.starts_with("tokenizer.latents: a scale of 49 codes"), "{few}");
        assert!(few.contains("which has 36 latents: set it to 49 or more"), "{few}");
        let many = told(of(Some(65), None));
        assert!(many.starts_with("tokenizer.latents: a window has 64 frames"), "{many}");
        let patch = told(with(|s| (s.kind, s.latents) = (TokenizerKind::Patch, Some(49))));
        assert!(patch.starts_with("tokenizer.latents: belongs to `kind: transformer`"), "{patch}");
        let plain = TokenizerSpec { quantizer: QuantizerSpec::Vq { n_vocab: 8 }, ..spec(&fixed) };
        assert!(plain.check().unwrap_err().problem.starts_with("belongs to `quantizer"));
    }
}
