//! [`TokenizerSpec`]: everything that a tokenizer follows from, beside its data.

use serde::{Deserialize, Serialize};

use super::quantizer::QuantizerSpec;

/// Codes beyond which a codebook is taken for a slip of the pen.
const MOST_CODES: usize = 1 << 24;

/// A field of a description has a value that no training can use.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("tokenizer.{field}: {problem}")]
pub struct SpecError {
    pub field: &'static str,
    pub problem: String,
}

/// How to build and train a tokenizer.
///
/// The defaults suit small widths on a CPU: T2M-GPT's recipe (width 512, batch 256, lr 2e-4, 300
/// thousand steps, the drop at 2/3) with a higher rate, far fewer steps and a later drop. Without
/// normalisation layers the codes collapse at rates of 3e-3 and more.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TokenizerSpec {
    /// The quantizer; by default FSQ with levels 8, 6, 5 (240 codes).
    pub kind: QuantizerSpec,
    /// Channels of the convolutions; 64.
    pub width: usize,
    /// Residual blocks at each resolution; 3.
    pub depth: usize,
    /// Halvings of the frame rate; 2, so 4 frames a token.
    pub down: usize,
    /// Frames of a training window; 64. Shorter clips are not trained on.
    pub window: usize,
    /// Windows of a step; 32.
    pub batch: usize,
    /// Training steps; 600.
    pub steps: usize,
    /// Learning rate after the warm-up; 1e-3.
    pub lr: f64,
    /// Steps over which the rate rises linearly; 50.
    pub warmup_steps: usize,
    /// Share of the steps after which the rate falls; 0.8 (0.6 in ScaMo).
    pub decay_at: f64,
    /// What it is multiplied by then; 0.05.
    pub decay_factor: f64,
    /// Weight of the extra smooth-L1 term on the joints' positions; 0.5.
    pub position_weight: f64,
    /// AdamW's β₁; 0.9.
    pub beta_1: f64,
    /// AdamW's β₂; 0.99.
    pub beta_2: f64,
    /// AdamW's decoupled weight decay; 0.
    pub weight_decay: f64,
    /// Clips of the training split that are held in memory and trained on; 2048.
    pub pool_clips: usize,
    /// Seed of the weights, the pool and the windows; 0.
    pub seed: u64,
}

impl Default for TokenizerSpec {
    fn default() -> Self {
        Self {
            kind: QuantizerSpec::Fsq { levels: vec![8, 6, 5] },
            width: 64,
            depth: 3,
            down: 2,
            window: 64,
            batch: 32,
            steps: 600,
            lr: 1e-3,
            warmup_steps: 50,
            decay_at: 0.8,
            decay_factor: 0.05,
            position_weight: 0.5,
            beta_1: 0.9,
            beta_2: 0.99,
            weight_decay: 0.0,
            pool_clips: 2048,
            seed: 0,
        }
    }
}

impl TokenizerSpec {
    /// Codes (V).
    pub fn n_vocab(&self) -> usize {
        self.kind.n_vocab()
    }

    /// Frames that one token stands for: 2^down.
    pub fn frames_per_token(&self) -> usize {
        1 << self.down
    }

    /// The rate of a step, counted from 0: linear warm-up, then flat, then one drop.
    pub fn learning_rate(&self, step: usize) -> f64 {
        let warmup = ((step + 1) as f64 / (self.warmup_steps + 1) as f64).min(1.0);
        let dropped = step as f64 >= self.decay_at * self.steps as f64;
        self.lr * warmup * if dropped { self.decay_factor } else { 1.0 }
    }

    /// Names the first field that no training can use.
    pub fn check(&self) -> Result<(), SpecError> {
        let positive = [
            ("width", self.width),
            ("depth", self.depth),
            ("batch", self.batch),
            ("steps", self.steps),
            ("pool_clips", self.pool_clips),
        ];
        for (field, value) in positive {
            require(value > 0, field, "must be at least 1")?;
        }
        require((1..=6).contains(&self.down), "down", "must be 1 to 6")?;
        self.check_quantizer()?;
        self.check_window()?;
        self.check_rates()
    }

    fn check_quantizer(&self) -> Result<(), SpecError> {
        let levels = self.kind.levels().unwrap_or(&[2]);
        require(!levels.is_empty(), "kind", "fsq needs levels, such as [8, 6, 5]")?;
        require(levels.iter().all(|&level| level >= 2), "kind", "each level must be at least 2")?;
        let codes = levels.iter().try_fold(1usize, |codes, &level| codes.checked_mul(level));
        let few = codes.is_some_and(|codes| codes <= MOST_CODES);
        require(few && self.n_vocab() <= MOST_CODES, "kind", "is for at most 16777216 codes")?;
        require(self.n_vocab() >= 2, "kind", "needs at least 2 codes")
    }

    fn check_window(&self) -> Result<(), SpecError> {
        let stride = self.frames_per_token();
        let whole = self.window > 0 && self.window.is_multiple_of(stride);
        let problem = format!("must be a multiple of the {stride} frames of a token");
        require(whole, "window", &problem)
    }

    fn check_rates(&self) -> Result<(), SpecError> {
        let rate = |value: f64| value.is_finite() && value >= 0.0;
        let moment = |value: f64| (0.0..1.0).contains(&value);
        require(rate(self.lr) && self.lr > 0.0, "lr", "must be a positive number")?;
        require(rate(self.decay_at), "decay_at", "must be a share of the steps")?;
        require(rate(self.decay_factor), "decay_factor", "must not be negative")?;
        require(rate(self.position_weight), "position_weight", "must not be negative")?;
        require(rate(self.weight_decay), "weight_decay", "must not be negative")?;
        require(moment(self.beta_1), "beta_1", "must be in 0 to 1, 1 left out")?;
        require(moment(self.beta_2), "beta_2", "must be in 0 to 1, 1 left out")
    }
}

fn require(holds: bool, field: &'static str, problem: &str) -> Result<(), SpecError> {
    if holds { Ok(()) } else { Err(SpecError { field, problem: problem.to_string() }) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rate_rises_stays_and_falls_once() {
        let spec = TokenizerSpec { steps: 10, lr: 1.0, warmup_steps: 3, ..Default::default() };
        let rates: Vec<f64> = (0..10).map(|step| spec.learning_rate(step)).collect();
        assert_eq!(rates, [0.25, 0.5, 0.75, 1.0, 1.0, 1.0, 1.0, 1.0, 0.05, 0.05]);
    }

    #[test]
    fn a_written_spec_reads_back_and_unknown_fields_are_refused() {
        let spec = TokenizerSpec { kind: QuantizerSpec::Vq { n_vocab: 32 }, ..Default::default() };
        let text = serde_json::to_string(&spec).unwrap();
        assert_eq!(serde_json::from_str::<TokenizerSpec>(&text).unwrap(), spec);
        let error = serde_json::from_str::<TokenizerSpec>(r#"{"widht": 8}"#).unwrap_err();
        assert!(error.to_string().contains("widht"), "{error}");
    }

    #[test]
    fn a_bad_field_is_named() {
        let default = TokenizerSpec::default;
        assert!(default().check().is_ok());
        let levels = |levels: &[usize]| QuantizerSpec::Fsq { levels: levels.to_vec() };
        let bad = [
            (TokenizerSpec { window: 30, ..default() }, "window"),
            (TokenizerSpec { lr: f64::NAN, ..default() }, "lr"),
            (TokenizerSpec { kind: levels(&[8, 1]), ..default() }, "kind"),
            (TokenizerSpec { kind: levels(&[usize::MAX, 9]), ..default() }, "kind"),
            (TokenizerSpec { down: 0, ..default() }, "down"),
        ];
        for (spec, field) in bad {
            let error = spec.check().unwrap_err().to_string();
            assert!(error.starts_with(&format!("tokenizer.{field}: ")), "{error}");
        }
    }
}
