//! [`TokenizerSpec`]: everything that a tokenizer follows from, beside its data.

use serde::{Deserialize, Serialize};

use super::architecture::{ArchitectureSpec, BegunFrom, Codes, ConvolutionalSpec, PatchSpec};
use super::error::{SpecError, require};
use super::grid::Grid;
use super::plateau::Plateau;
use super::quantizer::{
    CodebookKind, CodebookSpec, QuantizerKind, QuantizerSection, QuantizerSpec,
};
use super::representation::Representation;
use super::text::TextSpec;
use super::tokenizer_trainer::TokenizerTrainer;
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
    #[serde(skip_serializing_if = "Representation::is_full")]
    pub representation: Representation,
    pub training: TokenizerTraining,
    /// None where all steps are taken and the last weights kept.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub plateau: Option<Plateau>,
    /// Left out of ids and files for the built-in trainer.
    #[serde(skip_serializing_if = "TokenizerTrainer::is_built_in")]
    pub trainer: TokenizerTrainer,
}

/// VAR's mix, which leaves the signs that latents of patches begin with.
const PATCH_MIX: f64 = 0.5;

/// A quantizer with the defaults of patches.
fn of_patches(section: QuantizerSection) -> QuantizerSection {
    let mixes = section.kind == QuantizerKind::Multiscale;
    let mix = section.mix.or(mixes.then_some(PATCH_MIX));
    QuantizerSection { mix, ..section }
}

/// A size that every kind of codebook has: what a section is checked with.
const ANY_SIZE: usize = 64;

impl Default for QuantizerSpec {
    fn default() -> Self {
        Self::Fsq { levels: vec![8, 6, 5] }
    }
}

impl TokenizerSection {
    /// Its quantizer, as it is written or by default.
    pub fn quantizer(&self) -> QuantizerSection {
        let written = self.quantizer.clone();
        match self.kind {
            TokenizerKind::Fsq => QuantizerKind::Fsq.section(),
            TokenizerKind::Vq => QuantizerKind::Vq.section(),
            TokenizerKind::Convolutional => written.unwrap_or_default(),
            TokenizerKind::Patch => of_patches(written.unwrap_or(QuantizerKind::Vq.section())),
            TokenizerKind::Transformer => written.unwrap_or(QuantizerKind::Vq.section()),
        }
    }

    /// The tokenizers with a quantizer, one a seed; `text` says how wide captions are.
    pub fn specs(&self, quantizer: &QuantizerSpec, text: &TextSpec) -> Vec<TokenizerSpec> {
        let own = self.spec(quantizer.clone(), text);
        let seeded = |seed: &u64| {
            let mut spec = own.clone();
            spec.training.seed = *seed;
            spec
        };
        if self.seeds.is_empty() { vec![own] } else { self.seeds.iter().map(seeded).collect() }
    }

    /// The tokenizer with a quantizer and the first seed.
    pub fn spec(&self, quantizer: QuantizerSpec, text: &TextSpec) -> TokenizerSpec {
        let defaults = match self.kind {
            TokenizerKind::Patch => TokenizerTraining::of_patches(),
            TokenizerKind::Transformer => TokenizerTraining::of_transformers(),
            _ => TokenizerTraining::default(),
        };
        let frames = self.architecture(defaults.window, text).frames_per_latent();
        let longest_scale = quantizer.longest_scale() * frames;
        let window = defaults.window.max(longest_scale);
        let mut training = self.training_over(TokenizerTraining { window, ..defaults });
        if training.loss == TokenizerLoss::Features {
            // Bodies are mixed for the loss of joints alone, unless somebody writes otherwise.
            training.mix_body = self.mix_body.unwrap_or(0.0);
            training.mix_arm = self.mix_arm.unwrap_or(0.0);
        }
        let architecture = self.architecture(training.window, text);
        let representation = self.representation;
        let plateau = self.plateau;
        let trainer = self.trainer;
        TokenizerSpec { architecture, quantizer, representation, training, plateau, trainer }
    }

    fn architecture(&self, window: usize, text: &TextSpec) -> ArchitectureSpec {
        if self.kind == TokenizerKind::Transformer {
            return ArchitectureSpec::Transformer(self.transformer(window, text));
        }
        if self.kind == TokenizerKind::Patch {
            let mut default = PatchSpec::default();
            let codes = self.codes.unwrap_or_default();
            if codes == Codes::Fixed {
                default.encoder_blocks = 0;
            }
            return ArchitectureSpec::Patch(PatchSpec {
                width: self.width.unwrap_or(default.width),
                frames: self.frames.unwrap_or(default.frames),
                latent: self.latent.unwrap_or(default.latent),
                encoder_blocks: self.encoder_blocks.unwrap_or(default.encoder_blocks),
                decoder_blocks: self.decoder_blocks.unwrap_or(default.decoder_blocks),
                patches_per_code: self.patches_per_code.unwrap_or(default.patches_per_code),
                codes,
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
        let section = self.quantizer();
        section.check()?;
        let quantizer = section.of_size(ANY_SIZE).unwrap_or_default();
        let spec = self.spec(quantizer, &TextSpec::default());
        self.check_use(&spec.training)?;
        spec.check()
    }

    /// No key is written that nothing reads.
    fn check_use(&self, training: &TokenizerTraining) -> Result<(), SpecError> {
        let joints = training.loss == TokenizerLoss::Joints;
        let step = training.schedule == TokenizerSchedule::Step;
        let quantizer = self.quantizer();
        let vq = quantizer.codebook_kind() == CodebookKind::Vq;
        let learned = vq || quantizer.kind == QuantizerKind::Multiscale;
        let written = [
            ("decay_at", self.decay_at, step, "belongs to `schedule: step`"),
            ("position_weight", self.position_weight, !joints, "belongs to `loss: features`"),
            ("feature_weight", self.feature_weight, joints, "belongs to `loss: joints`"),
            ("velocity_weight", self.velocity_weight, joints, "belongs to `loss: joints`"),
            ("commitment", self.commitment, learned, "belongs to VQ"),
            ("reset_share", self.reset_share, vq, "belongs to VQ"),
        ];
        require(vq || self.patches_per_code.is_none(), "patches_per_code", "belongs to VQ")?;
        self.check_codes(vq)?;
        for (field, value, is_read, problem) in written {
            require(is_read || value.is_none(), field, problem)?;
        }
        Ok(())
    }

    /// Codes are fixed where k-means places them, and then nothing before them is learned.
    fn check_codes(&self, vq: bool) -> Result<(), SpecError> {
        if self.codes != Some(Codes::Fixed) {
            return Ok(());
        }
        let patch = self.kind == TokenizerKind::Patch;
        require(patch && vq, "codes", "`fixed` belongs to `kind: patch` with VQ")?;
        let learning = [
            ("encoder_blocks", self.encoder_blocks.is_some()),
            ("commitment", self.commitment.is_some()),
            ("reset_share", self.reset_share.is_some()),
        ];
        for (field, written) in learning {
            require(!written, field, "belongs to `codes: learned`")?;
        }
        Ok(())
    }

    /// No key of one kind is written for the other.
    fn check_kind(&self) -> Result<(), SpecError> {
        let patch = self.kind == TokenizerKind::Patch;
        let transformer = self.kind == TokenizerKind::Transformer;
        let kind = if patch { "is not of `kind: patch`" } else { "is not of `kind: transformer`" };
        for (field, written) in [("depth", self.depth), ("down", self.down)] {
            require(!(patch || transformer) || written.is_none(), field, kind)?;
        }
        for (field, written) in [("frames", self.frames), ("latent", self.latent)] {
            let belongs = "belongs to `kind: patch` and `kind: transformer`";
            require(patch || transformer || written.is_none(), field, belongs)?;
        }
        let of_patches = [
            ("encoder_blocks", self.encoder_blocks),
            ("decoder_blocks", self.decoder_blocks),
            ("patches_per_code", self.patches_per_code),
        ];
        for (field, written) in of_patches {
            require(patch || written.is_none(), field, "belongs to `kind: patch`")?;
        }
        for (field, is_written) in self.of_transformers() {
            require(transformer || !is_written, field, "belongs to `kind: transformer`")?;
        }
        Ok(())
    }
}

impl TokenizerSpec {
    /// Codes (V).
    pub fn n_vocab(&self) -> usize {
        self.quantizer.n_vocab()
    }

    /// Patches of training clips that it begins from, where the pool has as many; none where it begins
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
        self.quantizer.grid(self.frames_per_latent())
    }

    /// Frames that one latent stands for; a clip is encoded in whole latents.
    pub fn frames_per_latent(&self) -> usize {
        self.architecture.frames_per_latent()
    }

    /// FLOPs that training on a frame counts for, beside the budgets of runs.
    pub fn flops_per_frame(&self) -> f64 {
        let products = self.quantizer.products_per_latent(self.architecture.code_dim());
        self.architecture.flops_per_frame() + 6.0 * products / self.frames_per_latent() as f64
    }

    /// Bytes that the backward pass keeps of a frame of a step: those of the architecture, and of each
    /// convolution of a quantizer's scales its taps, what it gives, and what is added up.
    pub fn training_bytes_per_frame(&self) -> f64 {
        let c = self.architecture.code_dim();
        let floats = 2.0 * self.quantizer.products_per_latent(c) / c as f64;
        self.architecture.training_bytes_per_frame()
            + 4.0 * floats / self.frames_per_latent() as f64
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
        self.check_captions()?;
        if let Some(plateau) = &self.plateau {
            plateau.check(self.training.steps)?;
        }
        self.check_trainer()?;
        self.training.check()
    }

    /// No window is parted from its caption.
    fn check_captions(&self) -> Result<(), SpecError> {
        let TokenizerTraining { mirror, mix_body, mix_arm, .. } = self.training;
        let read = self.architecture.language().is_some();
        let mirrored = "shows mirrored clips the captions of their originals where `language` is set: \
                        leave it out, or set data.mirror";
        require(!read || !mirror, "mirror", mirrored)?;
        for (field, share) in [("mix_body", mix_body), ("mix_arm", mix_arm)] {
            let mixed =
                "shows parts of other clips under a caption where `language` is set: leave it out";
            require(!read || share == 0.0, field, mixed)?;
        }
        Ok(())
    }

    fn check_window(&self) -> Result<(), SpecError> {
        let (stride, window) = (self.frames_per_latent(), self.training.window);
        let whole = window > 0 && window.is_multiple_of(stride);
        require(whole, "window", &format!("must be a multiple of the {stride} frames of a code"))?;
        let (scale, latents) = (self.quantizer.longest_scale(), window / stride);
        let problem = format!(
            "a scale of {scale} codes is longer than a window, which has {latents} latents: set it to \
             {} or more, or shorten tokenizer.quantizer.scales",
            scale * stride
        );
        require(scale <= latents, "window", &problem)
    }
}

mod k_means;
#[cfg(test)]
mod tests;
mod trainer;
