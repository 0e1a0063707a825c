//! Training clips that are too long for items.

use super::*;
use crate::data::{Member, Union};

#[test]
fn long_training_clips_follow_the_others_where_they_are_used() {
    let data = DataSet::sound();
    data.clip("000000", 403, 0, "he walks on##0#0\na part##1.0#4.0");
    data.clip("000001", 400, 1, "only a part##1.0#4.0");
    data.clip("000004", 400, 4, "he waits##0#0");
    data.clip("000005", 60, 5, "he sits##0#0");
    data.write("test.txt", "000004\n000005\n");
    let [skip, mix, half] = [LongClips::Skip, LongClips::Mix, LongClips::Half].map(|long_clips| {
        open(&data, &HumanMl3dOptions { long_clips, ..options(true, BrokenFiles::Skip) })
    });
    assert_eq!([skip.n_long(), mix.n_long(), half.n_long()], [0, 2, 2]);
    assert!(half.metadata().half_long && !mix.metadata().half_long);
    // Items, and with them statistics, stay as they are.
    for other in [&mix, &half] {
        assert_eq!(ids(other, Split::Train), ids(&skip, Split::Train));
        assert_eq!(other.stats(), skip.stats());
        assert_eq!(other.n_clips(Split::Test), 1, "a long test clip is left out");
    }
    let n = mix.n_clips(Split::Train);
    let clip = |index| (mix.clip_id(Split::Train, index), mix.n_frames(Split::Train, index));
    assert_eq!([clip(n), clip(n + 1)], [("000000".into(), 400), ("M000000".into(), 400)]);
    assert_eq!(mix.captions(Split::Train, n), ["he walks on"]);
    let features = mix.features(Split::Train, n).expect("in memory");
    assert_eq!(features, rows(403, 0)[..400 * N_FEATURES]);
    let digests = [skip.digest(), mix.digest(), half.digest()];
    assert!(digests[0] != digests[1] && digests[1] != digests[2], "{digests:?}");
    // In a union they follow the clips of all members.
    let member = |name: &str, long_clips| {
        let options = HumanMl3dOptions { long_clips, ..options(false, BrokenFiles::Skip) };
        let source = Box::new(open(&data, &options));
        Member { name: name.to_owned(), licence: None, source }
    };
    let both = Union::new(vec![member("a", LongClips::Skip), member("b", LongClips::Half)]);
    let both = both.expect("one rate");
    assert_eq!((both.n_long(), both.metadata().half_long), (1, true));
    let last = both.n_clips(Split::Train);
    assert_eq!(both.clip_id(Split::Train, last), "b/000000");
    assert_eq!(both.n_frames(Split::Train, last), 400);
    let none = DataSet::sound();
    let none = open(
        &none,
        &HumanMl3dOptions { long_clips: LongClips::Mix, ..options(false, BrokenFiles::Skip) },
    );
    assert!(none.warnings()[0].contains("no training clip"), "{:?}", none.warnings());
}
