//! [`EvaluatorSpec`]: the networks whose embeddings motions are scored by.

use std::f64::consts::PI;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::error::KeyProblem;
use super::representation::Representation;
use crate::units::number;

/// The `evaluator` section: two small transformers, of motions and of captions, whose vectors are near
/// each other where they belong together (MARDM's MotionCLIP, without its pretrained text).
///
/// MARDM's has `width: 512, layers: 8, heads: 8, dim: 512`. The defaults train in a minute on a core.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct EvaluatorSpec {
    /// Features of a frame that it sees.
    pub representation: Representation,
    /// Channels of a row, in both towers.
    #[serde(deserialize_with = "number::count")]
    pub width: usize,
    /// Layers of each tower.
    #[serde(deserialize_with = "number::count")]
    pub layers: usize,
    /// Heads of attention.
    #[serde(deserialize_with = "number::count")]
    pub heads: usize,
    /// Numbers of an embedding.
    #[serde(deserialize_with = "number::count")]
    pub dim: usize,
    /// Frames of a row.
    #[serde(deserialize_with = "number::count")]
    pub frames: usize,
    /// Frames that are seen of a clip: a random window in training, else the first.
    #[serde(deserialize_with = "number::count")]
    pub window: usize,
    /// Words are hashed n-grams of this width, whatever the text encoder of the runs.
    #[serde(deserialize_with = "number::count")]
    pub word_dim: usize,
    /// Words that are seen of a caption.
    #[serde(deserialize_with = "number::count")]
    pub max_words: usize,
    /// Share of the words of a caption that are left out in training.
    #[serde(deserialize_with = "number::number")]
    pub word_drop: f64,
    /// Clips of a step: each is told from all others.
    #[serde(deserialize_with = "number::count")]
    pub batch: usize,
    /// Steps of training.
    #[serde(deserialize_with = "number::count")]
    pub steps: usize,
    /// The highest learning rate.
    #[serde(deserialize_with = "number::number")]
    pub lr: f64,
    /// Steps over which the learning rate rises; it falls along a cosine after them.
    #[serde(deserialize_with = "number::count")]
    pub warmup_steps: usize,
    /// Decoupled, of AdamW.
    #[serde(deserialize_with = "number::number")]
    pub weight_decay: f64,
    /// How often it is measured on the validation split; the best of these is kept.
    #[serde(deserialize_with = "number::count")]
    pub evaluations: usize,
    /// Training clips that are held in memory, at most.
    #[serde(deserialize_with = "number::count")]
    pub pool_clips: usize,
    /// Of weights, batches and windows.
    #[serde(deserialize_with = "number::seed")]
    pub seed: u64,
}

impl Default for EvaluatorSpec {
    fn default() -> Self {
        Self {
            representation: Representation::Meng67,
            width: 128,
            layers: 2,
            heads: 4,
            dim: 64,
            frames: 4,
            window: 196,
            word_dim: 128,
            max_words: 32,
            word_drop: 0.3,
            batch: 64,
            steps: 800,
            lr: 5e-4,
            warmup_steps: 100,
            weight_decay: 0.1,
            evaluations: 16,
            pool_clips: 8192,
            seed: 0,
        }
    }
}

impl EvaluatorSpec {
    /// What no evaluator can use.
    pub fn problems(&self) -> Vec<KeyProblem> {
        let Self { width, heads, frames, window, batch, word_drop, lr, weight_decay, .. } = *self;
        let least_one = [
            ("dim", self.dim),
            ("layers", self.layers),
            ("word_dim", self.word_dim),
            ("max_words", self.max_words),
            ("steps", self.steps),
            ("evaluations", self.evaluations),
        ];
        let mut found: Vec<KeyProblem> = least_one
            .into_iter()
            .filter(|(_, value)| *value == 0)
            .map(|(field, _)| problem(field, "must be at least 1"))
            .collect();
        let divides = heads > 0 && width > 0 && width.is_multiple_of(2 * heads);
        let checks = [
            (divides, "heads", "width / heads must be an even whole number: RoPE turns pairs"),
            (frames > 0 && window >= frames, "window", "holds at least one row of `frames` frames"),
            (batch > 1, "batch", "a clip is told from the others of its batch: at least 2"),
            (self.pool_clips >= batch, "pool_clips", "holds at least one `batch`"),
            ((0.0..1.0).contains(&word_drop), "word_drop", "lies in [0, 1)"),
            (lr > 0.0, "lr", "must be above 0"),
            (weight_decay >= 0.0, "weight_decay", "must not be negative"),
        ];
        let failed = checks.into_iter().filter(|(holds, ..)| !holds);
        found.extend(failed.map(|(_, field, words)| problem(field, words)));
        found
    }

    /// The rate of a step, counted from 0: a linear rise, then half a cosine to 0.
    pub fn learning_rate(&self, step: usize) -> f64 {
        if step < self.warmup_steps {
            return self.lr * (step + 1) as f64 / (self.warmup_steps + 1) as f64;
        }
        let (done, all) = (step - self.warmup_steps, self.steps.saturating_sub(self.warmup_steps));
        self.lr * 0.5 * (1.0 + (PI * done as f64 / all.max(1) as f64).cos())
    }

    /// FLOPs that training counts for.
    pub fn training_flops(&self) -> f64 {
        let (d, rows) = (self.width as f64, self.window.div_ceil(self.frames) + self.max_words);
        let block = 12.0 * d * d + 2.0 * rows as f64 * d;
        6.0 * (self.steps * self.batch * rows * self.layers) as f64 * block
    }
}

fn problem(field: &'static str, problem: &'static str) -> KeyProblem {
    KeyProblem { field, problem, help: None }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rate_rises_and_falls_to_nothing() {
        let spec = EvaluatorSpec { steps: 300, warmup_steps: 100, ..EvaluatorSpec::default() };
        let rates: Vec<f64> = (0..=300).map(|step| spec.learning_rate(step)).collect();
        assert!(rates[..100].is_sorted() && rates[100..].iter().rev().is_sorted());
        assert!((rates[100] - spec.lr).abs() < 1e-12 && rates[300].abs() < 1e-12);
    }

    #[test]
    fn every_impossible_value_is_named() {
        assert_eq!(EvaluatorSpec::default().problems(), []);
        let fields = |spec: EvaluatorSpec| -> Vec<&str> {
            spec.problems().into_iter().map(|problem| problem.field).collect()
        };
        let default = EvaluatorSpec::default;
        assert_eq!(fields(EvaluatorSpec { heads: 3, ..default() }), ["heads"]);
        assert_eq!(fields(EvaluatorSpec { heads: 0, dim: 0, ..default() }), ["dim", "heads"]);
        assert_eq!(fields(EvaluatorSpec { window: 3, ..default() }), ["window"]);
        assert_eq!(fields(EvaluatorSpec { batch: 1, word_drop: 1.0, ..default() }).len(), 2);
        assert_eq!(fields(EvaluatorSpec { pool_clips: 8, ..default() }), ["pool_clips"]);
    }
}
