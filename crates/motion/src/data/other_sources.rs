//! Sources that are no folder: the procedural motion, several data sets as one, and none.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::source::{
    DataError, FeatureStats, Member, Metadata, MotionSource, Split, StatsAccumulator, UsedFile,
    digest,
};
use crate::motion::synth::{FPS, REVISION, Script};
use crate::motion::{Pose, build_features};

/// Clips of the training stream from which mean and deviation are estimated.
const STATS_CLIPS: usize = 256;

/// The number of clips, and the seed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ProceduralOptions {
    /// Different seeds give different clips throughout.
    pub seed: u64,
    pub train_clips: usize,
    pub val_clips: usize,
    pub test_clips: usize,
}

/// Clips made on demand: clip `i` of a split depends only on the seed, the split and `i`.
///
/// Nothing is stored, so a split may have millions of clips; more clips leave the first ones unchanged. Mean and
/// deviation are computed from the first 256 clips of the training stream, even beyond `train_clips`: they depend only
/// on the seed.
#[derive(Clone, Debug)]
pub struct Procedural {
    options: ProceduralOptions,
    metadata: Metadata,
}

impl Procedural {
    /// The poses that the features of a clip are of: one more than it has frames.
    pub fn poses(&self, split: Split, index: usize) -> Vec<Pose> {
        self.script(split, index).poses()
    }

    /// A source; takes the time of 256 clips for the statistics.
    pub fn new(options: ProceduralOptions) -> Self {
        let ProceduralOptions { seed, train_clips, val_clips, test_clips } = options;
        let rules = format!(
            "procedural, revision {REVISION}, seed {seed}, clips {train_clips} {val_clips} \
             {test_clips}"
        );
        let (stats, digest) = (estimate_stats(seed), digest(&rules, &[]));
        Self { options, metadata: Metadata { stats, fps: FPS, digest, ..Metadata::default() } }
    }

    fn script(&self, split: Split, index: usize) -> Script {
        let n = self.n_clips(split);
        assert!(index < n, "clip {index} of {n} in the {} split", split.name());
        script(self.options.seed, split, index)
    }
}

impl MotionSource for Procedural {
    fn n_clips(&self, split: Split) -> usize {
        let ProceduralOptions { train_clips, val_clips, test_clips, .. } = self.options;
        [train_clips, val_clips, test_clips][split as usize]
    }

    fn clip_id(&self, split: Split, index: usize) -> String {
        format!("{}-{index:06}", split.name())
    }

    fn n_frames(&self, split: Split, index: usize) -> usize {
        self.script(split, index).n_frames()
    }

    fn captions(&self, split: Split, index: usize) -> Vec<String> {
        self.script(split, index).captions()
    }

    fn features(&self, split: Split, index: usize) -> Result<Vec<f32>, DataError> {
        Ok(build_features(&self.poses(split, index)))
    }

    fn metadata(&self) -> &Metadata {
        &self.metadata
    }
}

/// Each clip has its own stream: the split in the upper bits, the index in the lower.
fn script(seed: u64, split: Split, index: usize) -> Script {
    let upper = split as u64 + 1;
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(upper << 56 | index as u64);
    Script::sample(&mut rng)
}

fn estimate_stats(seed: u64) -> FeatureStats {
    let mut accumulator = StatsAccumulator::default();
    for index in 0..STATS_CLIPS {
        accumulator.add(&build_features(&script(seed, Split::Train, index).poses()));
    }
    accumulator.finish().expect("256 clips of moving bodies vary in every group of features")
}

// Several data sets as one.

/// Several data sets as one: each split concatenates the members' splits, and mean and deviation are over all training
/// clips, each frame with equal weight.
pub struct Union {
    members: Vec<Member>,
    metadata: Metadata,
}

impl Union {
    /// # Errors
    /// Members differ in their frames per second; a clip cannot be read.
    ///
    /// # Panics
    /// Without a member.
    pub fn new(members: Vec<Member>) -> Result<Self, DataError> {
        let first = &members[0];
        let differs = |member: &&Member| member.source.fps() != first.source.fps();
        if let Some(other) = members.iter().find(differs) {
            let [fps, others] = [first, other].map(|member| member.source.fps());
            let problem = format!(
                "has {others} frames a second where {} has {fps}; a union needs one rate",
                first.name
            );
            return Err(DataError::invalid(&other.name, problem));
        }
        let part = |(i, member): (usize, &Member)| {
            UsedFile::new(&i.to_string(), member.source.digest().as_bytes())
        };
        let parts: Vec<UsedFile> = members.iter().enumerate().map(part).collect();
        let told = |of: fn(&Member) -> &[String]| {
            let lines = members.iter().flat_map(|own| of(own).iter().map(move |line| (own, line)));
            lines.map(|(Member { name, .. }, line)| format!("{name}: {line}")).collect()
        };
        let warnings = told(|member| member.source.warnings());
        let remarks = told(|member| member.source.remarks());
        let metadata = Metadata {
            stats: stats(&members)?,
            fps: first.source.fps(),
            digest: digest("union-1", &parts),
            half_long: members.iter().any(|member| member.source.metadata().half_long),
            warnings,
            remarks,
        };
        Ok(Self { metadata, members })
    }

    /// The member that has clip `index` of `split`, and the clip's index there.
    ///
    /// # Panics
    /// The split has fewer clips.
    fn place(&self, split: Split, mut index: usize) -> (&dyn MotionSource, &str, usize) {
        let mut has = |n: usize| index.checked_sub(n).map(|left| index = left).is_none();
        let mut all = self.members.iter();
        if let Some(member) = all.find(|member| has(member.source.n_clips(split))) {
            return (&*member.source, &member.name, index);
        }
        let mut all = self.members.iter();
        let member = all.find(|member| has(member.source.n_long()));
        let member = member.expect("the split has so many clips");
        (&*member.source, &member.name, member.source.n_clips(split) + index)
    }
}

impl MotionSource for Union {
    fn n_clips(&self, split: Split) -> usize {
        self.members.iter().map(|member| member.source.n_clips(split)).sum()
    }

    fn n_long(&self) -> usize {
        self.members.iter().map(|member| member.source.n_long()).sum()
    }

    fn clip_id(&self, split: Split, index: usize) -> String {
        let (source, name, index) = self.place(split, index);
        format!("{name}/{}", source.clip_id(split, index))
    }

    fn group(&self, split: Split, index: usize) -> String {
        let (source, name, index) = self.place(split, index);
        format!("{name}/{}", source.group(split, index))
    }

    fn n_frames(&self, split: Split, index: usize) -> usize {
        let (source, _, index) = self.place(split, index);
        source.n_frames(split, index)
    }

    fn captions(&self, split: Split, index: usize) -> Vec<String> {
        let (source, _, index) = self.place(split, index);
        source.captions(split, index)
    }

    fn tokens(&self, split: Split, index: usize) -> Vec<String> {
        let (source, _, index) = self.place(split, index);
        source.tokens(split, index)
    }

    fn features(&self, split: Split, index: usize) -> Result<Vec<f32>, DataError> {
        let (source, _, index) = self.place(split, index);
        source.features(split, index)
    }

    fn metadata(&self) -> &Metadata {
        &self.metadata
    }

    fn members(&self) -> &[Member] {
        &self.members
    }
}

/// Over the training clips of all members.
fn stats(members: &[Member]) -> Result<FeatureStats, DataError> {
    let mut accumulator = StatsAccumulator::default();
    for Member { source, .. } in members {
        for clip in 0..source.n_clips(Split::Train) {
            accumulator.add(&source.features(Split::Train, clip)?);
        }
    }
    let problem = "a group of features is constant over the training clips";
    accumulator.finish().ok_or_else(|| DataError::invalid("the union", problem))
}

// Where a sweep names no data, since its trainer brings its own.

/// A source without a clip.
pub struct NoMotion(Metadata);

impl Default for NoMotion {
    /// At HumanML3D's frames per second, for losses a second.
    fn default() -> Self {
        Self(Metadata { fps: 20.0, digest: "none".to_string(), ..Metadata::default() })
    }
}

impl MotionSource for NoMotion {
    fn n_clips(&self, _: Split) -> usize {
        0
    }

    fn n_frames(&self, _: Split, _: usize) -> usize {
        0
    }

    fn captions(&self, _: Split, _: usize) -> Vec<String> {
        Vec::new()
    }

    fn features(&self, split: Split, index: usize) -> Result<Vec<f32>, DataError> {
        let problem = "the sweep has no motion (`source: none`)";
        Err(DataError::invalid(self.clip_id(split, index), problem))
    }

    fn metadata(&self) -> &Metadata {
        &self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::N_FEATURES;

    fn source(seed: u64, train_clips: usize) -> Procedural {
        Procedural::new(ProceduralOptions { seed, train_clips, val_clips: 5, test_clips: 5 })
    }

    fn clip(source: &Procedural, split: Split, index: usize) -> Vec<u32> {
        let features = source.features(split, index).expect("the generator cannot fail");
        features.iter().map(|value| value.to_bits()).collect()
    }

    #[test]
    fn a_clip_depends_neither_on_the_order_of_calls_nor_on_the_number_of_clips() {
        let (few, many) = (source(3, 6), source(3, 1_000_000));
        let forward: Vec<_> = (0..6).map(|i| clip(&few, Split::Train, i)).collect();
        let backward: Vec<_> = (0..6).rev().map(|i| clip(&many, Split::Train, i)).collect();
        assert!(forward.iter().eq(backward.iter().rev()));
        assert_eq!(few.stats(), many.stats());
        assert_eq!(few.captions(Split::Train, 5), many.captions(Split::Train, 5));
        assert!(!clip(&many, Split::Train, 999_999).is_empty());
    }

    #[test]
    fn seeds_splits_and_indices_all_give_other_clips() {
        let (a, b) = (source(3, 5), source(4, 5));
        let mut clips: Vec<_> = [&a, &b]
            .iter()
            .flat_map(|source| Split::ALL.map(|split| (*source, split)))
            .flat_map(|(source, split)| (0..5).map(move |i| clip(source, split, i)))
            .collect();
        clips.sort();
        clips.dedup();
        assert_eq!(clips.len(), 2 * 3 * 5);
    }

    #[test]
    fn features_match_the_promised_length_and_are_finite() {
        let source = source(11, 40);
        for index in 0..40 {
            let features = source.features(Split::Train, index).expect("no clip fails");
            let n_frames = source.n_frames(Split::Train, index);
            assert_eq!(features.len(), n_frames * N_FEATURES);
            assert!(features.iter().all(|value| value.is_finite()), "clip {index}");
            let captions = source.captions(Split::Train, index);
            assert!((2..=3).contains(&captions.len()));
            for caption in captions {
                assert!(!caption.contains('#') && caption == caption.to_lowercase(), "{caption}");
            }
        }
    }

    #[test]
    fn normalised_features_of_unseen_clips_have_mean_0_and_deviation_1() {
        let source = source(11, 600);
        let stats = source.stats();
        let mut seen = StatsAccumulator::default();
        for index in 300..600 {
            let features = source.features(Split::Train, index).expect("no clip fails");
            let normalised: Vec<f32> = (features.iter().zip(stats.mean.iter().cycle()))
                .zip(stats.std.iter().cycle())
                .map(|((value, mean), std)| (value - mean) / std)
                .collect();
            seen.add(&normalised);
        }
        let seen = seen.finish().expect("features vary");
        for column in 0..N_FEATURES {
            assert!(seen.mean[column].abs() < 0.4, "column {column}: {}", seen.mean[column]);
            assert!((seen.std[column] - 1.0).abs() < 0.2, "column {column}: {}", seen.std[column]);
        }
    }

    #[test]
    fn the_digest_names_seed_and_counts() {
        let base = source(3, 5);
        assert_eq!(base.digest(), source(3, 5).digest());
        assert_ne!(base.digest(), source(4, 5).digest());
        assert_ne!(base.digest(), source(3, 6).digest());
    }

    fn member(name: &str, seed: u64, train_clips: usize) -> Member {
        let options = ProceduralOptions { seed, train_clips, val_clips: 1, test_clips: 2 };
        Member { name: name.to_owned(), licence: None, source: Box::new(Procedural::new(options)) }
    }

    fn union() -> Union {
        Union::new(vec![member("a", 1, 3), member("b", 2, 5)]).unwrap()
    }

    #[test]
    fn splits_are_those_of_the_members_one_after_another() {
        let (both, a, b) = (union(), member("a", 1, 3).source, member("b", 2, 5).source);
        assert_eq!(Split::ALL.map(|split| both.n_clips(split)), [8, 2, 4]);
        let clip = |source: &dyn MotionSource, split, i| {
            let features = source.features(split, i).unwrap();
            (features, source.n_frames(split, i), source.captions(split, i))
        };
        assert!(clip(&both, Split::Train, 2) == clip(&*a, Split::Train, 2));
        assert!(clip(&both, Split::Train, 3) == clip(&*b, Split::Train, 0));
        assert!(clip(&both, Split::Test, 3) == clip(&*b, Split::Test, 1));
        assert_eq!(both.clip_id(Split::Val, 1), format!("b/{}", b.clip_id(Split::Val, 0)));
    }

    #[test]
    fn statistics_are_those_of_all_training_clips() {
        let both = union();
        let mut accumulator = StatsAccumulator::default();
        (0..8).for_each(|i| accumulator.add(&both.features(Split::Train, i).unwrap()));
        assert_eq!(Some(both.stats()), accumulator.finish().as_ref());
    }

    #[test]
    fn the_digest_knows_members_and_their_order_and_no_name() {
        let of = |members| Union::new(members).unwrap().digest().to_owned();
        let here = of(vec![member("a", 1, 3), member("b", 2, 5)]);
        assert_eq!(here, of(vec![member("c", 1, 3), member("d", 2, 5)]));
        assert_ne!(here, of(vec![member("b", 2, 5), member("a", 1, 3)]));
        assert_ne!(here, of(vec![member("a", 1, 3), member("b", 2, 6)]));
    }
}
