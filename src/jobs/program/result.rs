//! [`TrainerResult`]: the checked result of a program at `{out}`. Also makes the records of all finished runs, by any
//! trainer.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use serde::Deserialize;

use crate::codes::TokenStore;
use crate::data::Split;
use crate::failure::{Failure, FailureKind};
use crate::files::{LARGE, read_if_there, read_regular};
use crate::generator::{Sums, losses_by_block};
use crate::jobs::folder::ResultsFolder;
use crate::jobs::job::{JobId, JobKind};
use crate::progress::LogLine;
use crate::record::facts::{LOSS_NATS, LOSS_NORMALISED, NATS_PER_FRAME, NATS_PER_SECOND};
use crate::record::{Measured, Metrics, Planned, RunRecord, block_metric};
use crate::spec::flops::TRAINING_PER_FORWARD;
use crate::spec::{RunSpec, TokenizerJob};

/// The result of a run; missing keys other than losses take the plan's value.
///
/// Counts may be written as `1e6`.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrainerResult {
    /// Cross-entropy on the test split, per supervised token.
    pub loss_nats: f64,
    /// L_u, to which laws are fitted. One of this and `unigram_nats` is required.
    pub loss_normalised: Option<f64>,
    /// Cross-entropy of the unigram model on the same targets.
    pub unigram_nats: Option<f64>,
    /// Parameters of the model as built, by group: outside the vocabulary's matrices, N_v = V·d, and for the text.
    pub params_nonvocab: Option<f64>,
    pub params_vocab: Option<f64>,
    pub params_text: Option<f64>,
    /// D, if the program trained on a different number of tokens than planned.
    pub tokens: Option<f64>,
    pub unique_tokens: Option<f64>,
    pub steps: Option<f64>,
    pub batch_tokens: Option<f64>,
    pub lr: Option<f64>,
    /// Training FLOPs of the model as built.
    pub flops_exact: Option<f64>,
    /// By default `nats_per_second / fps`, or `loss_nats / 4`: a code stands for four frames.
    pub nats_per_frame: Option<f64>,
    /// By default `nats_per_frame · fps`.
    pub nats_per_second: Option<f64>,
    pub zero_count_targets: Option<f64>,
    /// By default the time that the program ran since it was last started.
    pub wall_s: Option<f64>,
    pub tokens_per_s: Option<f64>,
    /// Unknown if missing.
    pub peak_bytes: Option<f64>,
    /// The device, `custom` by default.
    pub device: Option<String>,
    /// L_u of the codes of each scale, if there are several.
    #[serde(default)]
    pub normalised_by_scale: Vec<f64>,
    /// exp of the entropy of the likeliest codes on the test split, of each scale; the record has their mean too. Unknown
    /// if missing.
    #[serde(default)]
    pub likeliest_exponential_entropy: Vec<f64>,
    /// The sums of each clip of the test split, in its order, to estimate the effect of other test clips.
    #[serde(default)]
    pub clips: Vec<Sums>,
    /// The validation curve.
    #[serde(default)]
    pub log: Vec<LogLine>,
    /// A safetensors file with the weights under the built-in model's names, next to the result or by absolute path: the
    /// run can then generate motions.
    pub weights: Option<PathBuf>,
}

/// The metric of the likeliest codes.
const LIKELIEST: &str = "likeliest_exponential_entropy";

/// A loss beyond this many nats is none.
const LARGEST_LOSS: f64 = 1e6;

/// The error document of a program at `{out}` in place of a result.
#[derive(Deserialize)]
struct Refusal {
    error: String,
    #[serde(default = "trainer")]
    kind: FailureKind,
}

fn trainer() -> FailureKind {
    FailureKind::Trainer
}

/// Why there is no result, in the program's own words; `None` if it left none.
pub fn refusal(path: &Path) -> Option<Failure> {
    let Refusal { error, kind } = read_if_there(path).ok().flatten()?;
    Some(Failure::new(kind, error))
}

impl TrainerResult {
    /// Reads and checks a result; the error is one sentence.
    pub fn read(path: &Path) -> Result<Self, String> {
        let shown = path.display();
        let bytes = read_regular(path, LARGE).map_err(|error| match error.kind() {
            ErrorKind::NotFound => format!("the trainer ended well but left no result at {shown}"),
            _ => format!("the result at {shown} cannot be read: {error}"),
        })?;
        Self::parse(&bytes).map_err(|problem| format!("the trainer's result {shown}: {problem}"))
    }

    fn parse(bytes: &[u8]) -> Result<Self, String> {
        let result: Self = serde_json::from_slice(bytes).map_err(|error| {
            let text = String::from_utf8_lossy(bytes);
            match ["NaN", "Infinity"].into_iter().find(|word| text.contains(word)) {
                Some(word) => format!("{error}; {word} is no JSON number: did the run diverge?"),
                None => error.to_string(),
            }
        })?;
        result.problem().map_or(Ok(result), Err)
    }

    fn problem(&self) -> Option<String> {
        let counts = [
            ("tokens", self.tokens, 1.0),
            ("steps", self.steps, 1.0),
            ("batch_tokens", self.batch_tokens, 1.0),
            ("unique_tokens", self.unique_tokens, 0.0),
            ("zero_count_targets", self.zero_count_targets, 0.0),
            ("peak_bytes", self.peak_bytes, 0.0),
            ("params_nonvocab", self.params_nonvocab, 1.0),
            ("params_vocab", self.params_vocab, 1.0),
            ("params_text", self.params_text, 0.0),
        ];
        let whole = |x: f64, least: f64| x.fract() == 0.0 && (least..=2f64.powi(53)).contains(&x);
        for (name, value, least) in counts {
            if let Some(x) = value.filter(|x| !whole(*x, least)) {
                return Some(format!("`{name}` is {x} and no whole number from {least} up"));
            }
        }
        let losses = [
            ("loss_nats", Some(self.loss_nats)),
            ("loss_normalised", self.loss_normalised),
            ("unigram_nats", self.unigram_nats),
            ("nats_per_frame", self.nats_per_frame),
            ("nats_per_second", self.nats_per_second),
        ];
        let is_loss = |x: f64| x.abs() <= LARGEST_LOSS;
        if let Some((name, x)) = losses.into_iter().find(|(_, x)| x.is_some_and(|x| !is_loss(x))) {
            let x = x.unwrap_or(f64::NAN);
            return Some(format!("`{name}` is {x:e}, which is no loss: did the run diverge?"));
        }
        let mut used = self.likeliest_exponential_entropy.iter();
        if let Some(x) = used.find(|x| !(1.0..=2f64.powi(53)).contains(*x)) {
            return Some(format!("`{LIKELIEST}` has {x}, and codes are at least 1"));
        }
        let positive = [
            ("lr", self.lr),
            ("flops_exact", self.flops_exact),
            ("wall_s", self.wall_s),
            ("tokens_per_s", self.tokens_per_s),
        ];
        if self.loss_normalised.is_some() == self.unigram_nats.is_some() {
            return Some("it has one of `loss_normalised` and `unigram_nats`".to_string());
        }
        let wrong = positive.into_iter().find(|(_, value)| value.is_some_and(|x| x < 0.0));
        wrong.map(|(name, _)| format!("`{name}` is negative"))
    }

    /// Checks a result against the codes that it was measured on.
    pub fn fits(&self, tokens: Option<&TokenStore>) -> Result<(), String> {
        let (found, Some(tokens)) = (self.clips.len(), tokens) else { return Ok(()) };
        let wanted = tokens.n_clips(Split::Test);
        if found == 0 || found == wanted {
            return Ok(());
        }
        Err(format!("its `clips` has {found} entries, and the test split {wanted} clips"))
    }

    /// L_u as given, or as it follows.
    pub fn normalised(&self) -> f64 {
        let follows = || self.unigram_nats.map(|unigram| self.loss_nats - unigram);
        self.loss_normalised.or_else(follows).unwrap_or(f64::NAN)
    }
}

// The record.

/// Frames assumed per code if their number is not fixed.
const FRAMES_PER_CODE: f64 = 4.0;

/// A run whose trainer has ended, with its result.
pub struct FinishedRun<'a> {
    pub folder: &'a ResultsFolder,
    pub id: &'a str,
    pub spec: &'a RunSpec,
    /// The codes that it was trained on; `None` if isoflop has none.
    pub tokens: Option<&'a TokenStore>,
    /// Words of the longest caption, to count FLOPs that the trainer did not report, at full context.
    pub max_text_tokens: usize,
    /// Seconds since the trainer was started.
    pub ran_s: f64,
}

impl FinishedRun<'_> {
    /// The record; missing values take the plan's.
    pub fn record(&self, result: &TrainerResult) -> RunRecord {
        RunRecord::new(self.planned(result), self.measured(result), self.metrics(result))
    }

    fn planned(&self, result: &TrainerResult) -> Planned {
        let (spec, shape, params) = (self.spec, self.spec.shape(), self.spec.params());
        let tokenizer = self.tokenizer();
        let or = |told: Option<f64>, planned: usize| told.map_or(planned, |x| x as usize);
        Planned {
            run_id: self.id.to_string(),
            seed: Some(spec.seed),
            n_layer: Some(shape.n_layer),
            n_head: Some(shape.n_head),
            d_model: Some(shape.d_model),
            d_ff: Some(shape.d_ff),
            n_ctx: Some(shape.n_ctx),
            n_vocab: spec.n_vocab(),
            budget_flops: spec.budget_flops,
            params_nonvocab: or(result.params_nonvocab, params.nonvocab),
            params_vocab: or(result.params_vocab, params.vocab),
            params_text: Some(or(result.params_text, params.text)),
            params_embedding: Some(params.embedding),
            params_head: Some(params.head),
            steps: Some(or(result.steps, spec.steps)),
            batch_tokens: Some(or(result.batch_tokens, spec.batch_tokens)),
            lr: Some(result.lr.unwrap_or(spec.lr)),
            tokenizer_id: Some(spec.tokenizer_id.clone()),
            generator: Some(spec.generator.name().to_string()),
            tokenizer_kind: tokenizer.as_ref().map(|job| job.spec.architecture.name().to_string()),
            quantizer: tokenizer.map(|job| job.spec.quantizer.name().to_string()),
            varied: spec.varied.clone(),
            share: Some(spec.share.value()),
        }
    }

    /// The tokenizer; `None` if the sweep has no data. A name is not worth a trained run, so the name of
    /// one whose description is damaged is unknown.
    fn tokenizer(&self) -> Option<TokenizerJob> {
        self.folder.known_spec(&JobId::new(JobKind::Tokenizer, &self.spec.tokenizer_id))
    }

    fn measured(&self, result: &TrainerResult) -> Measured {
        let (spec, codes) = (self.spec, self.tokens);
        let or = |told: Option<f64>, known: usize| told.map_or(known, |x| x as usize);
        let tokens = or(result.tokens, spec.tokens());
        let known = codes.map_or(0, |codes| codes.training_targets(spec.share));
        let unique = or(result.unique_tokens, known);
        let zero_count = codes.map_or(0, TokenStore::zero_count_targets);
        // Only the exact count, if unknown, asks for the words.
        let words = if result.flops_exact.is_some() { 0 } else { self.max_text_tokens };
        let per_token = spec.generator.flops_per_token(&spec.codes, words);
        let training = |forward: f64| TRAINING_PER_FORWARD * forward * tokens as f64;
        let wall_s = result.wall_s.unwrap_or(self.ran_s);
        Measured {
            flops_openai: Some(training(per_token.openai as f64)),
            flops_6nd: Some(training(per_token.six_nd)),
            flops_exact: Some(result.flops_exact.unwrap_or_else(|| training(per_token.exact))),
            tokens,
            unique_tokens: Some(unique),
            epochs: Some(if unique > 0 { tokens as f64 / unique as f64 } else { 0.0 }),
            zero_count_targets: Some(or(result.zero_count_targets, zero_count)),
            wall_s: Some(wall_s),
            tokens_per_s: Some(result.tokens_per_s.unwrap_or(tokens as f64 / wall_s.max(1e-9))),
            peak_bytes: result.peak_bytes.map(|x| x as u64),
            device: Some(result.device.clone().unwrap_or_else(|| "custom".to_string())),
            git_revision: Some(env!("ISOFLOP_GIT_REVISION").to_string()),
        }
    }

    fn metrics(&self, result: &TrainerResult) -> Metrics {
        let fps = self.spec.fps;
        let per_second = result.nats_per_second.map(|x| x / fps);
        let frames = self.spec.codes.frames_per_code().unwrap_or(FRAMES_PER_CODE);
        let per_frame = result.nats_per_frame.or(per_second).unwrap_or(result.loss_nats / frames);
        let metrics = [
            (LOSS_NATS, result.loss_nats),
            (LOSS_NORMALISED, result.normalised()),
            (NATS_PER_FRAME, per_frame),
            (NATS_PER_SECOND, result.nats_per_second.unwrap_or(per_frame * fps)),
        ];
        let mut metrics: Metrics = metrics.into_iter().collect();
        for (scale, loss) in result.normalised_by_scale.iter().enumerate() {
            metrics.set(format!("{LOSS_NORMALISED}_scale_{}", scale + 1), *loss);
        }
        let used = &result.likeliest_exponential_entropy;
        if !used.is_empty() {
            metrics.set(LIKELIEST, used.iter().sum::<f64>() / used.len() as f64);
        }
        for (scale, used) in used.iter().enumerate().filter(|_| used.len() > 1) {
            metrics.set(format!("{LIKELIEST}_scale_{}", scale + 1), *used);
        }
        let codes = self.tokens.filter(|_| !result.clips.is_empty());
        let by_block = codes.map_or_else(Vec::new, |codes| by_block(codes, &result.clips));
        for (block, loss) in by_block.into_iter().enumerate() {
            metrics.set(block_metric(block), loss);
        }
        metrics
    }
}

/// L_u of each block of the test split; empty if the codes do not say which clips go together.
fn by_block(tokens: &TokenStore, clips: &[Sums]) -> Vec<f64> {
    let Some(groups) = tokens.groups(Split::Test) else { return Vec::new() };
    let frames = (0..groups.len()).map(|clip| tokens.clip_frames(Split::Test, clip));
    losses_by_block(clips, groups, &frames.collect::<Vec<_>>())
}

#[cfg(test)]
mod tests {
    use super::TrainerResult;

    #[test]
    fn a_loss_that_overflows_is_no_result() {
        let parse = |text: &str| TrainerResult::parse(text.as_bytes()).err().unwrap();
        let huge = parse(r#"{"loss_nats": 1e308, "unigram_nats": -1e308}"#);
        assert_eq!(huge, "`loss_nats` is 1e308, which is no loss: did the run diverge?");
        let other = parse(r#"{"loss_nats": 3, "loss_normalised": -1e9}"#);
        assert!(other.contains("`loss_normalised` is -1e9"), "{other}");
    }

    #[test]
    fn a_result_needs_its_losses_and_nothing_unknown() {
        let parse = |text: &str| TrainerResult::parse(text.as_bytes());
        let good = parse(r#"{"loss_nats": 3, "loss_normalised": -1.5, "tokens": 1e6}"#).unwrap();
        assert_eq!((good.loss_normalised, good.tokens), (Some(-1.5), Some(1e6)));
        let by_unigram =
            parse(r#"{"loss_nats": 3, "unigram_nats": 4.5, "params_vocab": 64}"#).unwrap();
        assert_eq!((by_unigram.normalised(), by_unigram.params_vocab), (-1.5, Some(64.0)));
        let refused = |text: &str, words: &str| {
            let problem = parse(text).unwrap_err();
            assert!(problem.contains(words), "{problem}");
        };
        refused("", "EOF");
        refused(r#"{"loss_nats": 3}"#, "one of `loss_normalised` and `unigram_nats`");
        refused(r#"{"loss_nats": 3, "loss_normalised": 1, "unigram_nats": 2}"#, "one of");
        refused(
            r#"{"loss_nats": 3, "loss_normalised": 1, "params_vocab": 0.5}"#,
            "`params_vocab` is 0.5",
        );
        refused(r#"{"loss_nats": 3, "loss_normalised": NaN}"#, "did the run diverge?");
        refused(r#"{"loss_nats": 1e999, "loss_normalised": 1}"#, "out of range");
        refused(r#"{"loss_nats": 3, "loss_normalised": 1, "loss": 1}"#, "unknown field `loss`");
        refused(r#"{"loss_nats": 3, "loss_normalised": 1, "tokens": 0}"#, "`tokens` is 0");
        let few =
            r#"{"loss_nats": 3, "loss_normalised": 1, "likeliest_exponential_entropy": [2, 0.5]}"#;
        refused(few, "`likeliest_exponential_entropy` has 0.5");
        refused(r#"{"loss_nats": 3, "loss_normalised": 1, "wall_s": -1}"#, "negative");
    }
}
