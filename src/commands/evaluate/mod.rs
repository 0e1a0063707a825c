//! `isoflop evaluate`: scores the motions of a run, or in files, by a trained evaluator.

mod motions;

use super::args::{not_negative, share};
use super::context::device;
use super::prelude::*;
use super::tokenize::warn_of;
use isoflop::draws::distinct;
use isoflop::evaluator::{Embedded, EvaluatorError, OneScore, comparable};
use isoflop::jobs::{RunScores, ScoredPhysics, Scoring, TrainedRun, TrustedEvaluator};
use isoflop::ops::DeviceName;
use isoflop::scores::{
    Embeddings, MotionScores, POOL, Repeated, cosine_score, diversity, frechet_distance, retrieval,
};
use isoflop::spec::{EvaluatorSpec, SamplingSpec, ScoresSpec};
use motions::{NamedMotion, named_motions};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

#[derive(Args)]
pub struct EvaluateArgs {
    /// Motions: .npy of features, T × 263, or of joints, T × 22 × 3; .bvh with the 22 joints; or folders
    /// of such, as `isoflop generate` makes them
    #[arg(value_name = "FILE", required_unless_present = "run", conflicts_with = "run")]
    pub motions: Vec<PathBuf>,
    /// A run's folder, or a sweep's, for its run with the lowest loss: its motions are made and
    /// scored
    #[arg(long, value_name = "RUN")]
    pub run: Option<PathBuf>,
    /// An evaluator's folder, `evaluators/<id>`, or a sweep's with one; by default the run's evaluator
    #[arg(long, value_name = "FOLDER", required_unless_present = "run")]
    pub evaluator: Option<PathBuf>,
    /// A file with one caption per line, in the order of the motions; by default captions come from
    /// `motions.json` or the .txt next to each motion
    #[arg(long, value_name = "FILE", conflicts_with = "run")]
    pub texts: Option<PathBuf>,
    /// Repeats: each makes all motions again; for files, each redraws pools and pairs
    #[arg(long, value_name = "N", default_value_t = 20, value_parser = clap::value_parser!(u16).range(1..))]
    pub repeats: u16,
    /// Strength of classifier-free guidance; not for `autoregressive`
    #[arg(long, value_name = "S", value_parser = not_negative, requires = "run")]
    pub guidance: Option<f64>,
    /// Strength of caption guidance in decoding, for a tokenizer with language
    #[arg(long, value_name = "S", value_parser = not_negative, requires = "run")]
    pub detokenizer_guidance: Option<f64>,
    /// Divisor of the logits; 0 takes the likeliest code
    #[arg(long, value_name = "T", value_parser = not_negative, requires = "run")]
    pub temperature: Option<f64>,
    /// Draw among the likeliest codes whose probabilities sum to this
    #[arg(long, value_name = "P", value_parser = share, requires = "run")]
    pub top_p: Option<f64>,
    /// Skip MultiModality (it costs as much as six repeats)
    #[arg(long, requires = "run")]
    pub no_multimodality: bool,
    /// The same seed gives the same scores
    #[arg(long, value_name = "S", default_value_t = 0)]
    pub seed: u64,
    /// The compute backend
    #[arg(long, value_parser = device(), default_value = "flex")]
    pub device: DeviceName,
}

impl EvaluateArgs {
    /// How a run's motions are made and scored, over the sampling of its sweep.
    pub fn spec(&self, sampling: &SamplingSpec) -> ScoresSpec {
        let default = ScoresSpec::default().sampled_by(sampling, |_| false);
        let captions = if self.no_multimodality { 0 } else { default.multimodal_captions };
        ScoresSpec {
            repeats: usize::from(self.repeats),
            guidance: self.guidance.unwrap_or(default.guidance),
            detokenizer_guidance: self.detokenizer_guidance.unwrap_or(default.detokenizer_guidance),
            temperature: self.temperature.unwrap_or(default.temperature),
            top_p: self.top_p.or(default.top_p),
            multimodal_captions: captions,
            seed: self.seed,
            ..default
        }
    }
}

pub fn evaluate(args: &EvaluateArgs, output: &Output) -> Result<Exit> {
    match &args.run {
        Some(run) => of_run(args, run, output),
        None => of_files(args, output),
    }
}

/// Generates motions from the caption of every test clip, once per repeat, and scores them.
fn of_run(args: &EvaluateArgs, run: &Path, output: &Output) -> Result<Exit> {
    let device = args.device.open()?;
    let run = TrainedRun::open(run, &device)?;
    let evaluator = args.evaluator.as_deref().unwrap_or(run.folder.root());
    let trusted = TrustedEvaluator::open(evaluator, &device)?;
    let (truth, spec) = (trusted.truth()?, args.spec(&run.folder.sweep()?.sampling));
    let scoring = Scoring::new(&run, &trusted.evaluator, &truth, &spec)?;
    let mut repeats: Vec<OneScore> = Vec::new();
    for index in 0..spec.repeats {
        repeats.push(scoring.repeat(index)?);
        let OneScore { fid, precision: [first, ..], .. } = repeats[index];
        let (done, all) = (index + 1, spec.repeats);
        output.note(&format!("[{done}/{all}] FID {fid:.4}, R@1 {first:.3}"));
    }
    let scores: RunScores = scoring.finish(&repeats, &trusted.id)?;
    output.result(
        &serde_json::to_value(&scores)?,
        &text_of_run(&run.spec.label(), &scores, trusted.evaluator.spec()),
    )
}

fn of_files(args: &EvaluateArgs, output: &Output) -> Result<Exit> {
    let place = args.evaluator.as_deref().expect("asked for beside files");
    let trusted = TrustedEvaluator::open(place, &args.device.open()?)?;
    let (paths, motions) =
        named_motions(&args.motions, args.texts.as_deref(), trusted.evaluator.fps())?;
    let features = motions.iter().map(|(features, _)| features.as_slice());
    warn_of(paths.iter().map(PathBuf::as_path).zip(features), trusted.evaluator.stats(), output);
    let scores = FileScores::of(&motions, &trusted, args)?;
    let text = text_of_files(&scores, trusted.evaluator.spec());
    output.result(&serde_json::to_value(&scores)?, &text)
}

// [`FileScores`]: the scores of motions in files, or the reason why a score is missing.

/// The scores of motions in files.
#[derive(Serialize)]
struct FileScores {
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

/// One score of motions, and of true ones.
#[derive(Serialize)]
struct FileScore {
    pub name: &'static str,
    pub found: Option<Repeated>,
    pub truth: Option<Repeated>,
    /// Why the score is missing.
    pub reason: Option<String>,
}

/// A score of several draws, or the reason why there is none.
type Found<T = Repeated> = Result<T, EvaluatorError>;

impl FileScore {
    fn new(name: &'static str, found: Found, truth: Found) -> Self {
        let reason = found.as_ref().err().map(ToString::to_string);
        Self { name, found: found.ok(), truth: truth.ok(), reason }
    }
}

impl FileScores {
    /// Number of true motions for the reference FID of `n_made` motions: as many, but at most half of all, since
    /// FID falls as sets grow.
    pub fn true_motions(n_made: usize, n_truth: usize) -> usize {
        n_made.min(n_truth / 2)
    }

    /// Scores motions against the test split of the evaluator's data.
    pub fn of(
        motions: &[NamedMotion],
        trusted: &TrustedEvaluator,
        args: &EvaluateArgs,
    ) -> Result<Self> {
        let truth = trusted.truth()?;
        let evaluator = &trusted.evaluator;
        let features = motions.iter().map(|(features, _)| features.as_slice());
        let all = evaluator.motions(features.clone())?;
        let (own, captions): (Vec<usize>, Vec<&str>) = (motions.iter().enumerate())
            .filter_map(|(index, (_, caption))| Some((index, caption.as_deref()?)))
            .unzip();
        let n_captions = captions.len();
        let pairs = Embedded { motions: all.select(&own), captions: evaluator.captions(captions)? };
        let fps = evaluator.fps();
        Ok(Self {
            evaluator_id: trusted.id.clone(),
            n_motions: motions.len(),
            n_captions,
            n_truth: truth.n_clips(),
            scores: args.scores((&all, &pairs), (&truth.embedded.motions, &truth.embedded)),
            physics: ScoredPhysics::of(features, fps),
            truth_physics: ScoredPhysics::of(truth.features.iter().map(Vec::as_slice), fps),
        })
    }
}

/// Motions of one side: all, and those that have a caption.
type Side<'a> = (&'a Embeddings, &'a Embedded);

/// Repeats, and the seed, of drawing pools and pairs.
impl EvaluateArgs {
    /// The scores of these motions, and of true ones.
    fn scores(&self, made: Side, truth: Side) -> Vec<FileScore> {
        let both = [made, truth];
        let precision = |k: usize| {
            move |(_, pairs): Side, rng: &mut ChaCha8Rng| {
                let n = pairs.motions.len();
                let Embedded { motions, captions } = pairs.select(&distinct(n, n, rng));
                Ok(retrieval(&captions, &motions, POOL)?.precision[k])
            }
        };
        vec![
            self.fid(made.0, truth.0),
            self.score("R@1", both, precision(0)),
            self.score("R@2", both, precision(1)),
            self.score("R@3", both, precision(2)),
            self.score("cosine", both, |(_, own), _| {
                Ok(cosine_score(&own.captions, &own.motions)?)
            }),
            self.score("diversity", both, |(motions, _), rng| Ok(diversity(motions, rng)?)),
        ]
    }

    /// FID from true motions, and the FID of as many true motions from the rest.
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
        sides: [Side; 2],
        of: impl Fn(Side, &mut ChaCha8Rng) -> Found<f64>,
    ) -> FileScore {
        let [found, truth] = sides.map(|side| self.repeated(|rng| of(side, rng)));
        FileScore::new(name, found, truth)
    }

    fn repeated(&self, of: impl Fn(&mut ChaCha8Rng) -> Found<f64>) -> Found {
        let draw = |index: usize| {
            let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
            rng.set_stream(index as u64);
            of(&mut rng)
        };
        let drawn = (0..self.repeats.into()).map(draw).collect::<Result<Vec<f64>, _>>()?;
        Ok(Repeated::of(&drawn)?)
    }
}

// Scores as text.

/// The scores of a run's motions, next to motions known to be better or worse.
fn text_of_run(label: &str, scores: &RunScores, judge: &EvaluatorSpec) -> String {
    let RunScores { made, shuffled, truth, reconstructed, .. } = scores;
    let row = |(name, scores, body): (&str, &MotionScores, Option<ScoredPhysics>)| {
        let MotionScores { fid, precision: [first, _, third], .. } = scores;
        let [skate, jerk] = body.map_or([const { String::new() }; 2], |body| moving(&body));
        [name.to_string(), fid.shown(4), first.shown(3), third.shown(3), skate, jerk]
    };
    let own = Some(scores.made_physics);
    let rows = [
        ("made", made, own),
        ("captions mixed", shuffled, own),
        ("true", truth, Some(scores.truth_physics)),
        ("reconstructed", reconstructed, scores.reconstructed_physics),
    ];
    let mut text = format!(
        "motions of {label} ({})\n{} captions of the test split, {} times\n\n{}",
        scores.run_id,
        scores.n_clips,
        made.fid.repeats,
        table(["<", "<FID", "<R@1", "<R@3", "skate", "jerk"], rows.map(row))
    );
    let _ = writeln!(
        text,
        "\nskate: % of the steps in which a foot slides; jerk in m/s³\n\
         FID between two halves of the true motions: {}\n\
         diversity {}, of true motions {}\ncosine {}, of true motions {}",
        scores.halves_fid.shown(4),
        made.diversity.shown(3),
        truth.diversity.shown(3),
        made.cosine.shown(2),
        truth.cosine.shown(2),
    );
    if let Some(multimodality) = scores.multimodality {
        let spread = multimodality.shown(3);
        let _ = writeln!(text, "MultiModality {spread}: distance between motions of one caption");
    }
    text += &bodies(&scores.made_physics, &scores.truth_physics);
    text + &last(&scores.evaluator_id, judge)
}

/// The scores of motions of files.
fn text_of_files(scores: &FileScores, judge: &EvaluatorSpec) -> String {
    let FileScores { n_motions, n_captions, n_truth, .. } = scores;
    let shown = |score: Option<Repeated>| dash(score, |score| score.shown(3));
    let row = |score: &FileScore| [score.name.to_string(), shown(score.found), shown(score.truth)];
    let [these, truth] = [&scores.physics, &scores.truth_physics].map(moving);
    let movement = ["foot skate, %", "jerk, m/s³"].into_iter().zip(these).zip(truth);
    let movement = movement.map(|((name, these), truth)| [name.to_string(), these, truth]);
    let mut text = format!(
        "{}, {n_captions} with a caption, beside {n_truth} true ones\n\n{}",
        many(*n_motions, "motion"),
        table(["<", "<these", "<true"], scores.scores.iter().map(row).chain(movement))
    );
    text.push('\n');
    let mut reasons: Vec<&String> =
        scores.scores.iter().filter_map(|score| score.reason.as_ref()).collect();
    reasons.dedup();
    reasons.iter().for_each(|reason| text += &format!("{reason}\n"));
    let n = FileScores::true_motions(*n_motions, *n_truth);
    text += &format!("FID of true motions: {n} from the {} others\n", n_truth - n);
    text += &bodies(&scores.physics, &scores.truth_physics);
    text + &last(&scores.evaluator_id, judge)
}

/// Foot skate in percent, and jerk.
fn moving(ScoredPhysics { mean, .. }: &ScoredPhysics) -> [String; 2] {
    [format!("{:.1}", 100.0 * mean.foot_skate), format!("{:.0}", mean.jerk)]
}

fn bodies(made: &ScoredPhysics, truth: &ScoredPhysics) -> String {
    let [made, truth] = [made.mean, truth.mean];
    format!(
        "bones vary by {:.1} mm (true: {:.1}), the lowest joint is {:.1} mm under the floor\n",
        made.bone_spread_mm, truth.bone_spread_mm, made.penetration_mm,
    )
}

fn last(evaluator_id: &str, judge: &EvaluatorSpec) -> String {
    format!("means and 95 % intervals of repeats; evaluator {evaluator_id}:\n{}", comparable(judge))
}
