//! The tokenizers of a [`TokenizerSection`].

use super::{
    ArchitectureSpec, Codes, ConvolutionalSpec, OF_SCALES, PatchSpec, TokenizerKind, TokenizerLoss,
    TokenizerSchedule, TokenizerSection, TokenizerSpec, TokenizerTraining, TransformerSpec,
};
use crate::spec::{
    CodebookKind, QuantizerKind, QuantizerSection, QuantizerSpec, SpecError, TextSpec, require,
    require_all,
};
use crate::units::or_default;

/// VAR's mix, which leaves the signs that latents of patches begin with.
const PATCH_MIX: f64 = 0.5;

/// A quantizer with the defaults of patches.
fn of_patches(section: QuantizerSection) -> QuantizerSection {
    let mixes = section.kind == QuantizerKind::Multiscale;
    let mix = section.mix.or(mixes.then_some(PATCH_MIX));
    QuantizerSection { mix, ..section }
}

/// A size valid for every kind of codebook, to check a section.
const ANY_SIZE: usize = 64;

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
        let seeded = |&seed: &u64| {
            let training = TokenizerTraining { seed, ..own.training.clone() };
            TokenizerSpec { training, ..own.clone() }
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
        let frames = self.architecture(defaults.window, text).stride();
        let scale = if self.latents.is_some() { 0 } else { quantizer.longest_scale() };
        let window = defaults.window.max(scale * frames);
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
                let (span, latents) = (window, self.latents);
                let own = TransformerSpec { span, latents, language, ..TransformerSpec::default() };
                let own = or_default!(self, own, width, layers, heads, frames, latent, dropout);
                let own = or_default!(self, own, norm, ffn, skips, positions, detokenizer);
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
        let scales = quantizer.kind == QuantizerKind::Multiscale;
        let scales_or_vq = vq || scales;
        let may_be_fixed = self.kind == TokenizerKind::Patch && vq;
        let learned = self.codes != Some(Codes::Fixed);
        require_all(belonging! {
            self, "";
            vq, "belongs to VQ" => patches_per_code;
            learned || may_be_fixed, "`fixed` belongs to `kind: patch` with VQ" => codes;
            learned, "belongs to `codes: learned`" => encoder_blocks, commitment, reset_share;
            step, "belongs to `schedule: step`" => decay_at;
            !joints, "belongs to `loss: features`" => position_weight;
            joints, "belongs to `loss: joints`" => feature_weight, velocity_weight,
                acceleration_weight, root_weight;
            scales_or_vq, "belongs to VQ" => commitment;
            scales, OF_SCALES => latents;
            vq, "belongs to VQ" => reset_share;
        })
    }

    /// No key of one kind is written for the other.
    fn check_kind(&self) -> Result<(), SpecError> {
        let patch = self.kind == TokenizerKind::Patch;
        let transformer = self.kind == TokenizerKind::Transformer;
        let either = patch || transformer;
        let not = if patch { "is not of `kind: patch`" } else { "is not of `kind: transformer`" };
        require_all(belonging! {
            self, "";
            !either, not => depth, down;
            either, "belongs to `kind: patch` and `kind: transformer`" => frames, latent;
            patch, "belongs to `kind: patch`" => encoder_blocks, decoder_blocks, patches_per_code;
            transformer, "belongs to `kind: transformer`" => latents, layers, heads, norm,
                ffn, skips, positions, detokenizer, dropout, language;
        })
    }
}
