//! [`TokenizerSpec`]: everything that a tokenizer follows from, beside its data.

use serde::{Deserialize, Serialize};

use super::architecture::{ArchitectureSpec, BegunFrom, Codes, ConvolutionalSpec, PatchSpec};
use super::error::{SpecError, require, require_all};
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
use super::transformer::TransformerSpec;
use crate::units::or_default;

/// A tokenizer, resolved: what is hashed.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TokenizerSpec {
    pub architecture: ArchitectureSpec,
    /// By default FSQ with levels 8, 6, 5 (240 codes).
    pub quantizer: QuantizerSpec,
    #[serde(skip_serializing_if = "crate::units::is_default")]
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
        let Self { representation, plateau, trainer, .. } = *self;
        TokenizerSpec { architecture, quantizer, representation, training, plateau, trainer }
    }

    fn architecture(&self, window: usize, text: &TextSpec) -> ArchitectureSpec {
        match self.kind {
            TokenizerKind::Transformer => {
                let language = self.language.as_ref().and_then(|language| language.over(text));
                let own = TransformerSpec { span: window, language, ..TransformerSpec::default() };
                let own = or_default!(self, own, width, layers, heads, frames, latent, dropout);
                let own = or_default!(self, own, norm, positions, detokenizer);
                ArchitectureSpec::Transformer(own)
            }
            TokenizerKind::Patch => {
                let codes = self.codes.unwrap_or_default();
                let mut own = PatchSpec { codes, ..PatchSpec::default() };
                if codes == Codes::Fixed {
                    own.encoder_blocks = 0;
                }
                let own = or_default!(self, own, width, frames, latent, patches_per_code);
                ArchitectureSpec::Patch(or_default!(self, own, encoder_blocks, decoder_blocks))
            }
            _ => {
                let default = ConvolutionalSpec::default();
                ArchitectureSpec::Convolutional(or_default!(self, default, width, depth, down))
            }
        }
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
    ///
    /// Codes are fixed where k-means places them, and then nothing before them is learned.
    fn check_use(&self, training: &TokenizerTraining) -> Result<(), SpecError> {
        let joints = training.loss == TokenizerLoss::Joints;
        let step = training.schedule == TokenizerSchedule::Step;
        let quantizer = self.quantizer();
        let vq = quantizer.codebook_kind() == CodebookKind::Vq;
        let scales_or_vq = vq || quantizer.kind == QuantizerKind::Multiscale;
        let may_be_fixed = self.kind == TokenizerKind::Patch && vq;
        let (of_vq, of_learned) = ("belongs to VQ", "belongs to `codes: learned`");
        let (of_features, of_joints) = ("belongs to `loss: features`", "belongs to `loss: joints`");
        let of_patches = "`fixed` belongs to `kind: patch` with VQ";
        let learned = self.codes != Some(Codes::Fixed);
        require_all([
            (vq || self.patches_per_code.is_none(), "patches_per_code", of_vq),
            (learned || may_be_fixed, "codes", of_patches),
            (learned || self.encoder_blocks.is_none(), "encoder_blocks", of_learned),
            (learned || self.commitment.is_none(), "commitment", of_learned),
            (learned || self.reset_share.is_none(), "reset_share", of_learned),
            (step || self.decay_at.is_none(), "decay_at", "belongs to `schedule: step`"),
            (!joints || self.position_weight.is_none(), "position_weight", of_features),
            (joints || self.feature_weight.is_none(), "feature_weight", of_joints),
            (joints || self.velocity_weight.is_none(), "velocity_weight", of_joints),
            (scales_or_vq || self.commitment.is_none(), "commitment", of_vq),
            (vq || self.reset_share.is_none(), "reset_share", of_vq),
        ])
    }

    /// No key of one kind is written for the other.
    fn check_kind(&self) -> Result<(), SpecError> {
        let patch = self.kind == TokenizerKind::Patch;
        let transformer = self.kind == TokenizerKind::Transformer;
        let either = patch || transformer;
        let not = if patch { "is not of `kind: patch`" } else { "is not of `kind: transformer`" };
        let of_either = "belongs to `kind: patch` and `kind: transformer`";
        let (of_patch, of_transformer) =
            ("belongs to `kind: patch`", "belongs to `kind: transformer`");
        require_all([
            (!either || self.depth.is_none(), "depth", not),
            (!either || self.down.is_none(), "down", not),
            (either || self.frames.is_none(), "frames", of_either),
            (either || self.latent.is_none(), "latent", of_either),
            (patch || self.encoder_blocks.is_none(), "encoder_blocks", of_patch),
            (patch || self.decoder_blocks.is_none(), "decoder_blocks", of_patch),
            (patch || self.patches_per_code.is_none(), "patches_per_code", of_patch),
            (transformer || self.layers.is_none(), "layers", of_transformer),
            (transformer || self.heads.is_none(), "heads", of_transformer),
            (transformer || self.norm.is_none(), "norm", of_transformer),
            (transformer || self.positions.is_none(), "positions", of_transformer),
            (transformer || self.detokenizer.is_none(), "detokenizer", of_transformer),
            (transformer || self.dropout.is_none(), "dropout", of_transformer),
            (transformer || self.language.is_none(), "language", of_transformer),
        ])
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
