//! [`EvaluatorSpec`]: the networks whose embeddings motions are scored by.

mod networks;
mod section;

pub use networks::{MatchingSpec, Mismatches, MotionClipSpec, NetworksSpec};
pub use section::{EvaluatorKind, EvaluatorSection, EvaluatorSpec};

use std::f64::consts::PI;

use super::error::{KeyProblem, failed};

impl EvaluatorSpec {
    /// What no training can use.
    fn problems(&self) -> Vec<KeyProblem> {
        let positive = "must be at least 1";
        let mut found = self.networks.problems();
        found.extend(failed([
            (self.dim > 0, "dim", positive),
            (self.word_dim > 0, "word_dim", positive),
            (self.max_words > 0, "max_words", positive),
            (self.steps > 0, "steps", positive),
            (self.evaluations > 0, "evaluations", positive),
            (self.window >= self.frames(), "window", "holds at least the frames of one row"),
            (self.batch > 1, "batch", "a clip is told from the others of its batch: at least 2"),
            (self.pool_clips >= self.batch, "pool_clips", "holds at least one `batch`"),
            ((0.0..1.0).contains(&self.word_drop), "word_drop", "lies in [0, 1)"),
            (self.lr > 0.0, "lr", "must be above 0"),
            (self.weight_decay >= 0.0, "weight_decay", "must not be negative"),
        ]));
        found
    }

    /// Frames of a row.
    pub fn frames(&self) -> usize {
        self.networks.frames()
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
        let rows = self.window.div_ceil(self.frames().max(1)) + self.max_words;
        3.0 * (self.steps * self.batch * rows) as f64 * self.networks.flops_per_row(rows)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rate_rises_and_falls_to_nothing() {
        let section =
            EvaluatorSection { steps: 300, warmup_steps: 100, ..EvaluatorSection::default() };
        let spec = section.spec();
        let rates: Vec<f64> = (0..=300).map(|step| spec.learning_rate(step)).collect();
        assert!(rates[..100].is_sorted() && rates[100..].iter().rev().is_sorted());
        assert!((rates[100] - spec.lr).abs() < 1e-12 && rates[300].abs() < 1e-12);
    }

    fn fields(yaml: &str) -> Vec<&'static str> {
        let section: EvaluatorSection = serde_yaml::from_str(yaml).unwrap();
        section.problems().into_iter().map(|problem| problem.field).collect()
    }

    #[test]
    fn every_impossible_value_is_named() {
        for kind in ["{}", "{kind: matching}", "{kind: motionclip}"] {
            assert_eq!(fields(kind), Vec::<&str>::new());
        }
        assert_eq!(fields("{heads: 3}"), ["heads"]);
        assert_eq!(fields("{heads: 0, dim: 0}"), ["heads", "dim"]);
        assert_eq!(fields("{window: 3}"), ["window"]);
        assert_eq!(fields("{batch: 1, word_drop: 1}"), ["batch", "word_drop"]);
        assert_eq!(fields("{pool_clips: 8}"), ["pool_clips"]);
        assert_eq!(fields("{kind: matching, margin: 0, dropout: 1}"), ["margin", "dropout"]);
    }

    #[test]
    fn no_key_of_one_kind_is_written_for_the_other() {
        let clip = "{kind: matching, layers: 2, heads: 4, frames: 4}";
        assert_eq!(fields(clip), ["layers", "heads", "frames"]);
        let matching = "{margin: 10, mismatches: all, dropout: 0.2}";
        assert_eq!(fields(matching), ["margin", "mismatches", "dropout"]);
    }
}
