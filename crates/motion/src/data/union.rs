//! [`Union`]: several data sets as one.

use super::digest::{UsedFile, digest};
use super::source::{DataError, FeatureStats, Member, Metadata, MotionSource, Split};
use super::stats::StatsAccumulator;

/// Several data sets as one: each split is the members' own, one after another, and mean and deviation
/// are those of all training clips, each frame counting alike.
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
        check_fps(&members)?;
        let part = |(i, member): (usize, &Member)| {
            UsedFile::new(&i.to_string(), member.source.digest().as_bytes())
        };
        let parts: Vec<UsedFile> = members.iter().enumerate().map(part).collect();
        let told = |member: &Member| {
            let lines = member.source.warnings().iter();
            lines.map(|line| format!("{}: {line}", member.name)).collect::<Vec<_>>()
        };
        let warnings = members.iter().flat_map(told).collect();
        let metadata = Metadata {
            stats: stats(&members)?,
            fps: members[0].source.fps(),
            digest: digest("union-1", &parts),
            warnings,
        };
        Ok(Self { metadata, members })
    }

    /// The member that has clip `index` of `split`, and the clip's index there.
    ///
    /// # Panics
    /// The split has fewer clips.
    fn place(&self, split: Split, index: usize) -> (&dyn MotionSource, &str, usize) {
        let mut first = 0;
        let mut places = self.members.iter().map(|member| {
            let at = first;
            first += member.source.n_clips(split);
            (member, at, first)
        });
        let (member, first, _) =
            places.find(|(_, _, end)| index < *end).expect("the split has so many clips");
        (&*member.source, &member.name, index - first)
    }
}

impl MotionSource for Union {
    fn n_clips(&self, split: Split) -> usize {
        self.members.iter().map(|member| member.source.n_clips(split)).sum()
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

fn check_fps(members: &[Member]) -> Result<(), DataError> {
    let first = &members[0];
    let Some(other) = members.iter().find(|member| member.source.fps() != first.source.fps())
    else {
        return Ok(());
    };
    let problem = format!(
        "has {} frames a second where {} has {}; a union needs one rate",
        other.source.fps(),
        first.name,
        first.source.fps()
    );
    Err(DataError::invalid(&other.name, problem))
}

/// Of the training clips of all members.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::{Procedural, ProceduralOptions};

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
