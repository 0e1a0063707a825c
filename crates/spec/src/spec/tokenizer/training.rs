//! The training of a tokenizer, and the `tokenizer` section of a sweep file, with the same keys.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::architecture::Codes;
use super::transformer::{Detokenizer, LanguageSection, Positions, TokenizerNorm};
use crate::spec::{Ffn, QuantizerSection, Representation, SpecError, require, require_all};
use crate::units::number::plain;
use crate::units::section;

plain!(Plateau, TokenizerKind, TokenizerTrainer, TokenizerLoss, TokenizerSchedule);

/// The trainer of the tokenizers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum TokenizerTrainer {
    /// The trainer inside isoflop.
    #[default]
    BuiltIn,
    /// The trainer in PyTorch that comes with isoflop, on a GPU if PyTorch sees one. It trains
    /// convolutional and transformer tokenizers with FSQ, VQ or several scales.
    Torch,
}

impl TokenizerTrainer {
    /// Whether it is the default, which specs and ids leave out.
    pub fn is_built_in(&self) -> bool {
        *self == Self::BuiltIn
    }
}

/// The kind of tokenizer, as in a sweep file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum TokenizerKind {
    /// T2M-GPT's convolutional autoencoder, with the quantizer of `tokenizer.quantizer`.
    Convolutional,
    /// Short for the convolutional autoencoder with FSQ.
    #[default]
    Fsq,
    /// Short for the convolutional autoencoder with VQ.
    Vq,
    /// Patches of whole frames: their principal components, mended by residual convolutions. With VQ
    /// unless `tokenizer.quantizer` says otherwise.
    Patch,
    /// A transformer over latents and motion, and the clip's caption where `tokenizer.language` is set
    /// (LG-Tok). With VQ unless `tokenizer.quantizer` says otherwise. Trained as patches are, but with
    /// `window: 64`, `batch: 16`, `steps: 2000`, `commitment: 0.02`, and without `mirror` and mixing.
    Transformer,
}

/// The loss of a tokenizer's training.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum TokenizerLoss {
    /// Smooth L1 of the normalised features, and of the joints' positions once more (T2M-GPT).
    #[default]
    Features,
    /// Distances of the joints in metres, with the true heading and with the tokenizer's own, plus features and
    /// joint velocities. Clips shorter than a window are included.
    Joints,
}

/// How a tokenizer's learning rate falls.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum TokenizerSchedule {
    /// At once, after the share `decay_at` of the steps.
    #[default]
    Step,
    /// Along a cosine, over all steps.
    Cosine,
}

/// The training of a tokenizer and the section of a sweep file, from one list of keys, each with its
/// default for the convolutional autoencoder and for patches.
macro_rules! keys {
    ($(
        $(#[$about:meta])* $key:ident: $type:ty = $default:expr, $patch:expr
            $(, $low:literal to $high:literal)? $(, unless $hidden:literal)?;
    )*) => {
        /// How a tokenizer is trained.
        ///
        /// The defaults of the convolutional autoencoder suit small widths on a CPU: T2M-GPT's recipe
        /// (width 512, batch 256, lr 2e-4, 300 thousand steps, the drop at 2/3) with a higher rate, far
        /// fewer steps and a later drop. Without normalisation layers the codes collapse at rates of
        /// 3e-3 and more.
        #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
        #[serde(deny_unknown_fields, default)]
        pub struct TokenizerTraining {
            $($(#[$about])* $(#[serde(skip_serializing_if = $hidden)])? pub $key: $type,)*
        }

        impl Default for TokenizerTraining {
            fn default() -> Self {
                Self { $($key: $default,)* }
            }
        }

        impl TokenizerTraining {
            /// The defaults of patches.
            pub fn of_patches() -> Self {
                Self { $($key: $patch,)* }
            }
        }

        section! {
            /// The `tokenizer` section: a tokenizer of this kind is trained for each vocabulary and seed.
            pub struct TokenizerSection {
                kind: TokenizerKind = TokenizerKind::default();
                /// The trainer of the tokenizers.
                trainer: TokenizerTrainer = TokenizerTrainer::default(), unless "TokenizerTrainer::is_built_in";
                /// The quantizer: FSQ by default, VQ for patches.
                quantizer: Option<QuantizerSection> = None, unless "Option::is_none";
                /// The features of a frame that are read and made.
                representation: Representation = Representation::default(), unless "crate::units::is_default";
                /// Channels of the layers: 64, for patches 128; ScaMo has 512, LG-Tok 256.
                width: Option<usize> = None, 2 to 8192, unless "Option::is_none";
                /// Convolutional: residual blocks at each resolution, 3.
                depth: Option<usize> = None, 1 to 64, unless "Option::is_none";
                /// Convolutional: halvings of the frame rate, 2; they make 4 frames a code.
                down: Option<usize> = None, 1 to 6, unless "Option::is_none";
                /// Patches and transformers: frames a code, 4. Clips are cut to multiples of it.
                frames: Option<usize> = None, 1 to 64, unless "Option::is_none";
                /// Transformers with several scales: latents of a clip of any length up to the window, spread
                /// evenly over it; left out, one for `frames` frames. 49 in LG-Tok, 36 and 25 in its smaller
                /// sizes.
                latents: Option<usize> = None, 1 to 16_384, unless "Option::is_none";
                /// Patches and transformers: channels of a latent, 32; 512 in LG-Tok.
                latent: Option<usize> = None, 1 to 8192, unless "Option::is_none";
                /// Patches: residual blocks of the encoder, 3; with 0, a code depends only on its own
                /// frames.
                encoder_blocks: Option<usize> = None, 0 to 64, unless "Option::is_none";
                /// Patches: residual blocks of the decoder, 4.
                decoder_blocks: Option<usize> = None, 0 to 64, unless "Option::is_none";
                /// VQ of patches: patches that k-means begins a code from, on average: 48, and where codes
                /// are learned 32,768 in all at least.
                patches_per_code: Option<usize> = None, 1 to 1_000_000, unless "Option::is_none";
                /// VQ of patches: whether codes move after k-means, `learned`.
                codes: Option<Codes> = None, unless "Option::is_none";
                /// Transformers: layers of each half, an odd number: 3; 9 in LG-Tok.
                layers: Option<usize> = None, 1 to 127, unless "Option::is_none";
                /// Transformers: heads of attention, 4.
                heads: Option<usize> = None, 1 to 128, unless "Option::is_none";
                /// Transformers: the norm and its place, `post`.
                norm: Option<TokenizerNorm> = None, unless "Option::is_none";
                /// Transformers: the feed-forward layer, `swiglu`.
                ffn: Option<Ffn> = None, unless "Option::is_none";
                /// Transformers: whether outputs of the layers before the middle one reach those after it: true.
                skips: Option<bool> = None, unless "Option::is_none";
                /// Transformers: the encoding of positions, `learned`.
                positions: Option<Positions> = None, unless "Option::is_none";
                /// Transformers: how the detokenizer's frames see latents and text, `cross`.
                detokenizer: Option<Detokenizer> = None, unless "Option::is_none";
                /// Transformers: dropout on the output of each part of a layer: 0; 0.1 in LG-Tok.
                dropout: Option<f64> = None, 0 to 0.999, unless "Option::is_none";
                /// Transformers: which halves see the clip's caption; none if it is left out.
                language: Option<LanguageSection> = None, unless "Option::is_none";
                /// Ends training at the plateau of the validation split; left out, all steps are taken and the
                /// last weights kept.
                plateau: Option<Plateau> = None, unless "Option::is_none";
                /// Seeds of several tokenizers a vocabulary: every cell is trained with each of them.
                #[schemars(inner(range(min = 0, max = 18_446_744_073_709_551_615u64)))]
                seeds: Vec<u64> = Vec::new(), unless "Vec::is_empty";
                $(
                    $(#[$about])* $key: Option<$type> = None
                        $(, $low to $high)?, unless "Option::is_none";
                )*
            }
        }

        impl TokenizerSection {
            /// The training of its tokenizers, with `defaults` for missing keys.
            pub(super) fn training_over(&self, defaults: TokenizerTraining) -> TokenizerTraining {
                TokenizerTraining { $($key: self.$key.unwrap_or(defaults.$key),)* }
            }
        }
    };
}

keys! {
    /// Frames of a training window, a multiple of those of a code: 64, for patches 96; more if a scale has
    /// more codes than the window has latents.
    window: usize = 64, 96, 1 to 16_384;
    /// Windows a step: 32, for patches 24.
    batch: usize = 32, 24, 1 to 65_536;
    /// Training steps: 600, for patches 4000.
    steps: usize = 600, 4000, 1 to 100_000_000;
    /// Learning rate after the warm-up: 1e-3.
    lr: f64 = 1e-3, 1e-3, 1e-12 to 1e30;
    /// Steps over which the rate rises linearly: 50, for patches 100.
    warmup_steps: usize = 50, 100, 0 to 100_000_000;
    /// How the rate falls: `step`, for patches `cosine`.
    schedule: TokenizerSchedule = TokenizerSchedule::Step, TokenizerSchedule::Cosine;
    /// Share of the steps after which a rate falls at once: 0.8; 0.6 in ScaMo.
    decay_at: f64 = 0.8, 0.8, 0 to 1;
    /// Final factor of the rate: 0.05, for patches 0.02.
    decay_factor: f64 = 0.05, 0.02, 0 to 1;
    /// The loss: `features`, for patches `joints`.
    loss: TokenizerLoss = TokenizerLoss::Features, TokenizerLoss::Joints;
    /// Weight of the joints' positions in the loss of features: 0.5.
    position_weight: f64 = 0.5, 0.5, 0 to 1e6;
    /// Weight of the features in the loss of joints: 0.25.
    feature_weight: f64 = 0.25, 0.25, 0 to 1e6;
    /// Weight of the joints' velocities in the loss of joints: 0.05.
    velocity_weight: f64 = 0.05, 0.05, 0 to 1e6;
    /// Weight of the joints' accelerations in the loss of joints, across the boundaries of codes too: 0.
    acceleration_weight: f64 = 0.0, 0.0, 0 to 1e6, unless "crate::units::is_default";
    /// Weight of the root's place on the ground in the loss of joints, summed over a window: 0.
    root_weight: f64 = 0.0, 0.0, 0 to 1e6, unless "crate::units::is_default";
    /// Factor on the root's sideways step among the normalised features: 1. HumanML3D divides it by the deviation
    /// that forward steps have, so that sidesteps are small; 2 makes codes and losses see them.
    sideways_scale: f64 = 1.0, 1.0, 0.01 to 100, unless "is_one";
    /// VQ and scales: weight of the squared distance from latents to their codes: 0.02, for patches 1.
    commitment: f64 = 0.02, 1.0, 0 to 1e6;
    /// VQ: a code used less often than this fraction of the mean is reset: 0.025 for patches.
    /// 0 is T2M-GPT's rule, less than one latent per step.
    reset_share: f64 = 0.0, 0.025, 0 to 0.999;
    /// Decay of the moving average of the weights that is kept in the end: none, for patches 0.998.
    average: f64 = 0.0, 0.998, 0 to 0.9999999;
    /// Mirrored clips are trained on too: `false`, for patches `true`.
    mirror: bool = false, true;
    /// With the loss of joints: how often a window gets the upper body of another clip: 0.7.
    mix_body: f64 = 0.0, 0.7, 0 to 1;
    /// With the loss of joints: how often a window gets an arm of another clip, for each arm: 0.3.
    mix_arm: f64 = 0.0, 0.3, 0 to 1;
    /// AdamW's β₁: 0.9.
    beta_1: f64 = 0.9, 0.9, 0 to 0.9999999;
    /// AdamW's β₂: 0.99.
    beta_2: f64 = 0.99, 0.99, 0 to 0.9999999;
    /// AdamW's decoupled weight decay: 0, for patches 0.01.
    weight_decay: f64 = 0.0, 0.01, 0 to 1e3;
    /// Norm that gradients are scaled down to: none, for patches 1; 0 for none.
    clip_norm: f64 = 0.0, 1.0, 0 to 1e6;
    /// Training clips kept in memory and trained on: 2048.
    pool_clips: usize = 2048, 2048, 1 to 10_000_000;
    /// Seed of the weights, the pool and the windows: 0.
    seed: u64 = 0, 0, 0 to 18_446_744_073_709_551_615u64;
}

/// Whether a factor is left out of ids and files.
fn is_one(factor: &f64) -> bool {
    *factor == 1.0
}

impl TokenizerTraining {
    /// The defaults of transformers: those of patches with smaller batches, without a limit on latents, which start
    /// small, and without augmentation that would no longer match captions.
    pub fn of_transformers() -> Self {
        let (window, batch, steps, commitment) = (64, 16, 2000, 0.02);
        let (mirror, mix_body, mix_arm) = (false, 0.0, 0.0);
        Self { window, batch, steps, commitment, mirror, mix_body, mix_arm, ..Self::of_patches() }
    }

    /// The rate of a step, counted from 0: linear warm-up, then as the schedule has it.
    pub fn learning_rate(&self, step: usize) -> f64 {
        let warmup = ((step + 1) as f64 / (self.warmup_steps + 1) as f64).min(1.0);
        let done = step as f64 / self.steps as f64;
        let fall = match self.schedule {
            TokenizerSchedule::Step if done >= self.decay_at => self.decay_factor,
            TokenizerSchedule::Step => 1.0,
            TokenizerSchedule::Cosine => {
                let left = 0.5 * (1.0 + (std::f64::consts::PI * done).cos());
                self.decay_factor + (1.0 - self.decay_factor) * left
            }
        };
        self.lr * warmup * fall
    }

    /// The first field that no training can use.
    pub(super) fn check(&self) -> Result<(), SpecError> {
        let joints = |x: f64| x == 0.0 || self.loss == TokenizerLoss::Joints;
        require_all(each! {
            self;
            joints, "belongs to `loss: joints`" => mix_body, mix_arm;
        })
    }
}

section! {
    /// The `tokenizer.plateau` section: the validation split is measured while a tokenizer is trained, the
    /// weights that were best on it are kept, and training ends where measurements bring nothing new.
    #[derive(Copy, Eq)]
    pub struct Plateau {
        /// Times that the validation split is measured, spread evenly over the steps.
        evaluations: usize = 20, 1 to 100_000;
        /// Measurements in a row without a new best after which training ends.
        patience: usize = 5, 1 to 100_000;
    }
}

impl Plateau {
    /// The first setting that no training of so many steps can use.
    pub(super) fn check(&self, steps: usize) -> Result<(), SpecError> {
        let evaluated = (1..=steps).contains(&self.evaluations);
        require(evaluated, "plateau.evaluations", "lies between 1 and the steps")
    }
}

/// A section that is like the default but for a change.
#[cfg(test)]
pub(super) fn with(change: impl FnOnce(&mut TokenizerSection)) -> TokenizerSection {
    let mut section = TokenizerSection::default();
    change(&mut section);
    section
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spec::{QuantizerSpec, TextSpec};

    #[test]
    fn a_factor_of_one_is_not_in_ids() {
        let written = |sideways_scale| {
            let training = TokenizerTraining { sideways_scale, ..TokenizerTraining::default() };
            serde_json::to_string(&training).unwrap()
        };
        assert!(!written(1.0).contains("sideways") && written(3.0).contains("sideways_scale"));
        let read: TokenizerTraining = serde_json::from_str(&written(1.0)).unwrap();
        assert_eq!(read.sideways_scale, 1.0);
    }

    #[test]
    fn the_rate_rises_stays_and_falls_once() {
        let section = with(|s| (s.steps, s.lr, s.warmup_steps) = (Some(10), Some(1.0), Some(3)));
        let spec = section.spec(QuantizerSpec::default(), &TextSpec::default());
        let rates: Vec<f64> = (0..10).map(|step| spec.learning_rate(step)).collect();
        assert_eq!(rates, [0.25, 0.5, 0.75, 1.0, 1.0, 1.0, 1.0, 1.0, 0.05, 0.05]);
    }
}
