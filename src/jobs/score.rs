//! Scores the motions of a run against true motions, one repeat at a time: [`Scoring`].

use std::path::PathBuf;

use anyhow::{Context, Result};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use serde::Serialize;

use super::assignment::{Assignment, Outcome};
use super::folder::{CHECKPOINT, ResultsFolder};
use super::job::JobId;
use super::run_scores::{RunScores, ScoredPhysics};
use super::trained::{TrainedRun, TrustedEvaluator};
use crate::data::write_npy;
use crate::draws::swapped;
use crate::evaluator::{Embedded, Evaluator, OneScore, Truth, halves_fid};
use crate::files::{atomic::write_json, read_if_there};
use crate::generator::{Draw, Prompt, Sampling};
use crate::motion::{N_FEATURES, recover_joints};
use crate::plan::ScoreJob;
use crate::progress::{Step, beats, moved};
use crate::scores::MotionScores;
use crate::scores::{Embeddings, Repeated, multimodality, physics};
use crate::spec::ScoresSpec;

/// Makes motions of a run and scores them; the scores are written last.
pub fn score(assignment: &Assignment) -> Result<Outcome> {
    let job: ScoreJob = assignment.spec()?;
    let trusted = TrustedEvaluator::of(assignment.folder, &job.evaluator_id, assignment.device)?;
    let (evaluator, truth) = (&trusted.evaluator, trusted.truth()?);
    let run = TrainedRun::open(&assignment.folder.run(&job.run_id), assignment.device)
        .context("opening the run")?;
    let scoring = Scoring::new(&run, evaluator, &truth, &job.spec)?;
    let path = repeats_file(assignment.folder, assignment.job);
    let mut done: Vec<OneScore> = read_if_there(&path).ok().flatten().unwrap_or_default();
    let place = assignment.place();
    let mut beats = beats(&place, assignment.stop);
    while done.len() < job.spec.repeats {
        let began = std::time::Instant::now();
        done.push(scoring.repeat(done.len())?);
        write_json(&path, &done)?;
        let (step, steps) = (done.len(), job.spec.repeats);
        let (loss, seconds) = (done[step - 1].fid, began.elapsed().as_secs_f64());
        if beats(Step { step, steps, loss, seconds }).is_break() && step < steps {
            return Ok(Outcome::Stopped);
        }
    }
    write_samples(&scoring)?;
    write_json(&assignment.product(), &scoring.finish(&done, &job.evaluator_id)?)?;
    assignment.done()
}

/// The repeats that are done of a job that is not.
pub fn repeats_file(folder: &ResultsFolder, job: &JobId) -> PathBuf {
    folder.job(job).join(CHECKPOINT).join("repeats.json")
}

/// Motions that are made side by side.
const BATCH: usize = 64;

/// Motions that were made, and their bodies.
type Made = (Embeddings, ScoredPhysics);

/// First ChaCha stream of pools and pairs, one per repeat, far above those of motions.
const POOLS_STREAM: u64 = 1 << 41;

/// Offset of the seed of MultiModality's motions from those of repeats.
const MULTIMODAL_SEED: u64 = 1 << 32;

/// The settings of scoring a run.
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
        let truth = &self.truth.embedded;
        let made = truth.with_motions(self.made(index)?.0);
        Ok(OneScore::of(&truth.motions, &made, &mut self.pools(index))?)
    }

    /// Combines the repeats, with scores that are computed only once.
    ///
    /// # Errors
    /// As [`Scoring::repeat`].
    pub fn finish(&self, repeats: &[OneScore], evaluator_id: &str) -> Result<RunScores> {
        let (motions, made_physics) = self.made(0)?;
        let truth = &self.truth.embedded;
        let several = |motions: &Embeddings| self.several(&truth.with_motions(motions.clone()));
        let mut rng = self.pools(0);
        let others = swapped(self.truth.n_clips(), 1.0, &mut rng);
        let shuffled = truth.with_motions(motions).recaptioned(&others);
        let (reconstructed, reconstructed_physics) = self.reconstructed()?;
        Ok(RunScores {
            run_id: self.run.run_id.clone(),
            evaluator_id: evaluator_id.to_string(),
            spec: self.spec.clone(),
            guidance: self.guidance(),
            n_clips: self.truth.n_clips(),
            made: MotionScores::of(repeats)?,
            shuffled: self.several(&shuffled)?,
            truth: several(&truth.motions)?,
            halves_fid: halves_fid(&truth.motions)?,
            reconstructed: several(&reconstructed)?,
            multimodality: self.multimodality()?,
            made_physics,
            truth_physics: ScoredPhysics::of(
                self.truth.features.iter().map(Vec::as_slice),
                self.run.spec.fps,
            ),
            reconstructed_physics: Some(reconstructed_physics),
        })
    }

    /// The same motions over repeated draws of pools and pairs.
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
        self.make(&self.prompts(self.truth.n_clips(), index))
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
        let (made, _) = self.make(&prompts)?;
        let one = |index: usize| multimodality(&made, n_motions, &mut self.pools(index));
        let drawn = (0..self.spec.repeats).map(one).collect::<Result<Vec<f64>, _>>()?;
        Ok(Some(Repeated::of(&drawn)?))
    }

    /// The true motions, reconstructed by the run's tokenizer.
    fn reconstructed(&self) -> Result<Made> {
        let tokenizer = &self.run.tokenizer;
        let through = |(features, text): (&Vec<f32>, &Vec<f32>)| {
            moved();
            let codes = tokenizer.encode(features, Some(text))?;
            let n_frames = features.len() / N_FEATURES;
            tokenizer.decode(&codes, n_frames, Some(text), 0.0)
        };
        let motions = self.truth.features.iter().zip(&self.texts).map(through);
        let motions = motions.collect::<Result<Vec<_>, _>>()?;
        let motions = motions.iter().map(Vec::as_slice);
        let embedded = self.evaluator.motions(motions.clone())?;
        Ok((embedded, ScoredPhysics::of(motions, self.run.spec.fps)))
    }

    /// Makes motions and embeds them.
    fn make(&self, prompts: &[Prompt]) -> Result<Made> {
        let (mut values, mut bodies) = (Vec::new(), Vec::new());
        for batch in prompts.chunks(BATCH) {
            let motions = self.decoded(batch)?;
            let embedded = self.evaluator.motions(motions.iter().map(Vec::as_slice))?;
            values.extend(embedded.rows().flatten());
            let body = |motion: &Vec<f32>| physics(&recover_joints(motion), self.run.spec.fps).ok();
            bodies.extend(motions.iter().filter_map(body));
            moved();
        }
        let motions = Embeddings::new(values, self.evaluator.spec().dim)?;
        Ok((motions, ScoredPhysics::mean(&bodies)))
    }

    /// Features of motions that are made side by side.
    fn decoded(&self, prompts: &[Prompt]) -> Result<Vec<Vec<f32>>> {
        let ScoresSpec { temperature, top_k, top_p, rounds, .. } = *self.spec;
        let draw = Draw { temperature, top_k, top_p };
        let sampling = Sampling { draw, guidance: self.guidance(), rounds };
        let made = self.run.motions(prompts, &sampling, self.spec.detokenizer_guidance)?;
        Ok(made.into_iter().map(|motion| motion.features).collect())
    }

    /// The guidance of the run's generator; 0 for kinds without guidance.
    fn guidance(&self) -> f64 {
        if self.run.takes_guidance() { self.spec.guidance } else { 0.0 }
    }
}

// Statistics in addition to scores.

/// An element of `motions.json`.
#[derive(Serialize)]
struct Sample<'a> {
    caption: &'a str,
    /// Frames.
    length: usize,
    /// Frames per second.
    fps: f64,
    run: &'a str,
}

/// Writes the first motions of the first repeat as `samples/<run>/scored/<n>.features.npy`, and last
/// `motions.json`, which lists them.
///
/// # Errors
/// A motion cannot be made, or a file cannot be written.
fn write_samples(scoring: &Scoring) -> Result<()> {
    let (run, truth) = (scoring.run, scoring.truth);
    let prompts = scoring.prompts(scoring.spec.samples.min(truth.n_clips()), 0);
    let motions = scoring.decoded(&prompts)?;
    if motions.is_empty() {
        return Ok(());
    }
    let folder = run.folder.file("samples").join(&run.run_id).join("scored");
    std::fs::create_dir_all(&folder)?;
    let mut listed = Vec::with_capacity(motions.len());
    for (index, (motion, caption)) in motions.iter().zip(&truth.captions).enumerate() {
        let length = motion.len() / N_FEATURES;
        let path = folder.join(format!("{index}.features.npy"));
        write_npy(&path, &[length, N_FEATURES], motion)?;
        listed.push(Sample { caption, length, fps: run.spec.fps, run: &run.run_id });
    }
    Ok(write_json(&folder.join("motions.json"), &listed)?)
}
