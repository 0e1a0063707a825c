//! [`FileScores`]: what motions of files score, each score or the reason why there is none.

use anyhow::Result;
use isoflop::evaluator::{Embedded, EvaluatorError};
use isoflop::jobs::{ScoredPhysics, TrustedEvaluator};
use isoflop::learn::params::distinct;
use isoflop::scores::{
    Embeddings, POOL, Repeated, cosine_score, diversity, frechet_distance, retrieval,
};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use serde::Serialize;

use super::args::EvaluateArgs;
use super::motions::NamedMotion;

/// What motions of files score.
#[derive(Serialize)]
pub struct FileScores {
    pub evaluator_id: String,
    pub n_motions: usize,
    /// Motions that have a caption.
    pub n_captions: usize,
    /// True clips of the evaluator's data.
    pub n_truth: usize,
    pub scores: Vec<FileScore>,
    pub physics: ScoredPhysics,
    pub truth_physics: ScoredPhysics,
}

/// One score of motions, and of true ones beside it.
#[derive(Serialize)]
pub struct FileScore {
    pub name: &'static str,
    pub found: Option<Repeated>,
    pub truth: Option<Repeated>,
    /// Why there is none.
    pub reason: Option<String>,
}

impl FileScore {
    fn new(
        name: &'static str,
        found: Result<Repeated, EvaluatorError>,
        truth: Result<Repeated, EvaluatorError>,
    ) -> Self {
        let reason = found.as_ref().err().map(ToString::to_string);
        Self { name, found: found.ok(), truth: truth.ok(), reason }
    }
}

impl FileScores {
    /// True motions whose FID from the others stands beside that of `n_made` motions: as many, and half
    /// of all at most, since FID falls as sets grow.
    pub fn true_motions(n_made: usize, n_truth: usize) -> usize {
        n_made.min(n_truth / 2)
    }

    /// Scores motions beside the test split of the evaluator's data.
    pub fn of(
        motions: &[NamedMotion],
        trusted: &TrustedEvaluator,
        args: &EvaluateArgs,
    ) -> Result<Self> {
        let truth = trusted.truth()?;
        let evaluator = &trusted.evaluator;
        let all = evaluator.motions(motions.iter().map(|motion| motion.features.as_slice()))?;
        let captioned: Vec<(&str, usize)> = motions
            .iter()
            .enumerate()
            .filter_map(|(index, motion)| Some((motion.caption.as_deref()?, index)))
            .collect();
        let own: Vec<usize> = captioned.iter().map(|(_, index)| *index).collect();
        let pairs = Embedded {
            motions: all.select(&own),
            captions: evaluator.captions(captioned.iter().map(|(caption, _)| *caption))?,
        };
        let fps = evaluator.fps();
        let features = motions.iter().map(|motion| motion.features.as_slice());
        Ok(Self {
            evaluator_id: trusted.id.clone(),
            n_motions: motions.len(),
            n_captions: captioned.len(),
            n_truth: truth.n_clips(),
            scores: args.scores(
                &Side { motions: &all, pairs: &pairs },
                &Side { motions: &truth.embedded.motions, pairs: &truth.embedded },
            ),
            physics: ScoredPhysics::of(features, fps),
            truth_physics: ScoredPhysics::of(truth.features.iter().map(Vec::as_slice), fps),
        })
    }
}

/// Motions of one side: all, and those that have a caption.
struct Side<'a> {
    motions: &'a Embeddings,
    pairs: &'a Embedded,
}

/// How often, and by which seed, pools and pairs are drawn.
impl EvaluateArgs {
    /// Of these motions, and of true ones.
    fn scores(&self, made: &Side, truth: &Side) -> Vec<FileScore> {
        let both = [made, truth];
        let precision = |k: usize| {
            move |side: &Side, rng: &mut ChaCha8Rng| {
                let n = side.pairs.motions.len();
                let Embedded { motions, captions } = side.pairs.select(&distinct(n, n, rng));
                Ok(retrieval(&captions, &motions, POOL)?.precision[k])
            }
        };
        vec![
            self.fid(made.motions, truth.motions),
            self.score("R@1", both, precision(0)),
            self.score("R@2", both, precision(1)),
            self.score("R@3", both, precision(2)),
            self.score("cosine", both, |Side { pairs, .. }, _| {
                Ok(cosine_score(&pairs.captions, &pairs.motions)?)
            }),
            self.score("diversity", both, |side, rng| Ok(diversity(side.motions, rng)?)),
        ]
    }

    /// FID from true motions; beside it that of as many true motions from the others.
    fn fid(&self, made: &Embeddings, truth: &Embeddings) -> FileScore {
        let n = FileScores::true_motions(made.len(), truth.len());
        let of_truth = |rng: &mut ChaCha8Rng| {
            let order = distinct(truth.len(), truth.len(), rng);
            let [some, others] = [&order[..n], &order[n..]].map(|part| truth.select(part));
            Ok(frechet_distance(&others, &some)?)
        };
        let found = self.repeated(|_| Ok(frechet_distance(truth, made)?));
        FileScore::new("FID", found, self.repeated(of_truth))
    }

    fn score(
        &self,
        name: &'static str,
        sides: [&Side; 2],
        of: impl Fn(&Side, &mut ChaCha8Rng) -> Result<f64, EvaluatorError>,
    ) -> FileScore {
        let [found, truth] = sides.map(|side| self.repeated(|rng| of(side, rng)));
        FileScore::new(name, found, truth)
    }

    fn repeated(
        &self,
        of: impl Fn(&mut ChaCha8Rng) -> Result<f64, EvaluatorError>,
    ) -> Result<Repeated, EvaluatorError> {
        let draw = |index: usize| {
            let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
            rng.set_stream(index as u64);
            of(&mut rng)
        };
        let drawn = (0..self.repeats.into()).map(draw).collect::<Result<Vec<f64>, _>>()?;
        Ok(Repeated::of(&drawn)?)
    }
}
