//! [`Scoring`]: a run's motions beside the truth, a repeat at a time.

use anyhow::Result;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::made::{Made, decoded, guidance, make};
use super::run_scores::{RunScores, ScoredPhysics};
use crate::evaluator::{Embedded, Evaluator, MotionScores, OneScore, Truth, halves_fid, swapped};
use crate::generator::Prompt;
use crate::jobs::trained::TrainedRun;
use crate::motion::N_FEATURES;
use crate::progress::moved;
use crate::scores::{Embeddings, Repeated, multimodality};
use crate::spec::ScoresSpec;

/// Pools and pairs take their ChaCha streams from here on, one a repeat, far above those of motions.
const POOLS_STREAM: u64 = 1 << 41;

/// The seed of the motions of MultiModality is as far behind those of repeats.
const MULTIMODAL_SEED: u64 = 1 << 32;

/// What a run is scored by.
pub struct Scoring<'a> {
    pub run: &'a TrainedRun,
    pub evaluator: &'a Evaluator,
    pub truth: &'a Truth,
    pub spec: &'a ScoresSpec,
    /// The vectors of each true clip's caption.
    texts: Vec<Vec<f32>>,
}

impl<'a> Scoring<'a> {
    /// Embeds the captions of the truth as the run reads them.
    ///
    /// # Errors
    /// The run's encoder has no vectors of one.
    pub fn new(
        run: &'a TrainedRun,
        evaluator: &'a Evaluator,
        truth: &'a Truth,
        spec: &'a ScoresSpec,
    ) -> Result<Self> {
        let texts = truth.captions.iter().map(|caption| run.embed(caption));
        Ok(Self { run, evaluator, truth, spec, texts: texts.collect::<Result<_>>()? })
    }

    /// Makes a motion of each true clip's caption and scores them; another index makes others.
    ///
    /// # Errors
    /// A motion can be neither made nor embedded.
    pub fn repeat(&self, index: usize) -> Result<OneScore> {
        self.score(&self.made(index)?.motions, index)
    }

    /// What repeats make together, and what is scored but once.
    ///
    /// # Errors
    /// As [`Scoring::repeat`].
    pub fn finish(&self, repeats: &[OneScore], evaluator_id: &str) -> Result<RunScores> {
        let first = self.made(0)?;
        let truth = &self.truth.embedded;
        let several = |motions: &Embeddings| self.several(&truth.with_motions(motions.clone()));
        let mut rng = self.pools(0);
        let others = swapped(self.truth.n_clips(), 1.0, &mut rng);
        let shuffled = truth.with_motions(first.motions).recaptioned(&others);
        Ok(RunScores {
            run_id: self.run.run_id.clone(),
            evaluator_id: evaluator_id.to_string(),
            spec: self.spec.clone(),
            guidance: guidance(self.run, self.spec),
            n_clips: self.truth.n_clips(),
            made: MotionScores::of(repeats)?,
            shuffled: self.several(&shuffled)?,
            truth: several(&truth.motions)?,
            halves_fid: halves_fid(&truth.motions)?,
            reconstructed: several(&self.reconstructed()?)?,
            multimodality: self.multimodality()?,
            made_physics: first.physics,
            truth_physics: ScoredPhysics::of(self.truth_motions(), self.run.spec.fps),
        })
    }

    fn score(&self, motions: &Embeddings, index: usize) -> Result<OneScore> {
        let made = self.truth.embedded.with_motions(motions.clone());
        Ok(OneScore::of(&self.truth.embedded.motions, &made, &mut self.pools(index))?)
    }

    /// The same motions over draws of pools and pairs.
    fn several(&self, made: &Embedded) -> Result<MotionScores> {
        let truth = &self.truth.embedded.motions;
        let one = |index: usize| OneScore::of(truth, made, &mut self.pools(index));
        let scores = (0..self.spec.repeats).map(one).collect::<Result<Vec<_>, _>>()?;
        Ok(MotionScores::of(&scores)?)
    }

    fn pools(&self, index: usize) -> ChaCha8Rng {
        let mut rng = ChaCha8Rng::seed_from_u64(self.spec.seed);
        rng.set_stream(POOLS_STREAM + index as u64);
        rng
    }

    /// A motion of each true clip's caption.
    fn made(&self, index: usize) -> Result<Made> {
        let prompts = self.prompts(self.truth.n_clips(), index);
        make(self.run, self.evaluator, self.spec, &prompts)
    }

    /// Features of the first motions of the first repeat.
    ///
    /// # Errors
    /// A motion cannot be made.
    pub fn first_motions(&self, n: usize) -> Result<Vec<Vec<f32>>> {
        decoded(self.run, self.spec, &self.prompts(n, 0))
    }

    /// A motion of each of the first captions, in a repeat.
    fn prompts(&self, n: usize, repeat: usize) -> Vec<Prompt<'_>> {
        let seed = self.spec.seed.wrapping_add(repeat as u64);
        (0..n).map(|clip| self.prompt(clip, seed, clip)).collect()
    }

    /// A motion of a true clip's caption, by a stream of random numbers.
    fn prompt(&self, clip: usize, seed: u64, index: usize) -> Prompt<'_> {
        let n_frames = self.truth.features[clip].len() / N_FEATURES;
        let n_frames = self.run.wants_length().then_some(n_frames);
        Prompt { text: &self.texts[clip], n_frames, seed, index: index as u64, edit: None }
    }

    /// Several motions of each of the first captions, which are in a random order.
    fn multimodality(&self) -> Result<Option<Repeated>> {
        let n_captions = self.spec.multimodal_captions.min(self.truth.n_clips());
        let n_motions = self.spec.multimodal_motions;
        if n_captions == 0 {
            return Ok(None);
        }
        let seed = self.spec.seed.wrapping_add(MULTIMODAL_SEED);
        let prompt = |index: usize| self.prompt(index / n_motions, seed, index);
        let prompts: Vec<Prompt> = (0..n_captions * n_motions).map(prompt).collect();
        let made = make(self.run, self.evaluator, self.spec, &prompts)?;
        let one = |index: usize| multimodality(&made.motions, n_motions, &mut self.pools(index));
        let drawn = (0..self.spec.repeats).map(one).collect::<Result<Vec<f64>, _>>()?;
        Ok(Some(Repeated::of(&drawn)?))
    }

    /// What the run's tokenizer makes of the true motions.
    fn reconstructed(&self) -> Result<Embeddings> {
        let tokenizer = &self.run.tokenizer;
        let through = |(features, text): (&Vec<f32>, &Vec<f32>)| {
            moved();
            let codes = tokenizer.encode(features, Some(text))?;
            let n_frames = features.len() / N_FEATURES;
            tokenizer.decode(&codes, n_frames, Some(text), 0.0)
        };
        let motions = self.truth.features.iter().zip(&self.texts).map(through);
        let motions = motions.collect::<Result<Vec<_>, _>>()?;
        Ok(self.evaluator.motions(motions.iter().map(Vec::as_slice))?)
    }

    fn truth_motions(&self) -> impl Iterator<Item = &[f32]> {
        self.truth.features.iter().map(Vec::as_slice)
    }
}
