//! Mirror images of clips: those of the data set, and those that are made.

use super::*;
use crate::motion::mirror_features;

#[test]
fn each_training_clip_is_joined_by_its_mirror_image() {
    let set = open(&DataSet::sound(), &options(true, BrokenFiles::Skip));
    assert_eq!(
        ids(&set, Split::Train),
        ["000000", "M000000", "000001", "M000001", "000002", "M000002"]
    );
    assert_eq!((set.n_clips(Split::Val), set.n_clips(Split::Test)), (1, 1));
    assert_eq!(set.features(Split::Train, 3).expect("in memory"), mirror_features(&rows(60, 1)));
    assert_eq!(set.captions(Split::Train, 3), ["he turns right"]);
}

#[test]
fn mirrored_files_of_the_set_are_taken_as_they_are() {
    let data = DataSet::sound();
    // HumanML3D's own differ a little: the bones of a body's sides do.
    let image = |seed| -> Vec<f32> {
        mirror_features(&rows(60, seed)).into_iter().map(|value| value + 0.01).collect()
    };
    data.clip_of("M000000", &image(0), "as it is##0#0");
    data.clip_of("M000001", &image(1), "as it is, listed##0#0");
    data.write("train.txt", "000000\nM000001\n000001\n000002\n");
    let set = open(&data, &options(true, BrokenFiles::Skip));
    assert_eq!(
        ids(&set, Split::Train),
        ["000000", "M000000", "M000001", "000001", "000002", "M000002"]
    );
    assert_eq!(set.features(Split::Train, 1).expect("in memory"), image(0));
    assert_eq!(set.captions(Split::Train, 2), ["as it is, listed"]);
    assert_eq!(ids(&open(&data, &skip()), Split::Train), ["000000", "M000001", "000001", "000002"]);
}

#[test]
fn march_is_no_mirror_image_of_arch() {
    let data = DataSet::sound();
    for (id, seed) in [("arch", 11), ("March", 12), ("aster", 13), ("Master", 14), ("M000002", 15)]
    {
        data.clip(id, 60, seed, "he turns left##0#0");
    }
    data.write("train.txt", "arch\nMarch\naster\n000002\n");
    let set = open(&data, &options(true, BrokenFiles::Skip));
    // Each gets its own mirror image, and `Master` and `M000002`, which no split lists, are left alone.
    let expected = ["arch", "March", "March", "MMarch", "aster", "Master", "000002", "M000002"];
    assert_eq!(ids(&set, Split::Train), expected);
    let features = |index| set.features(Split::Train, index).expect("in memory");
    assert_eq!((features(1), features(2)), (mirror_features(&rows(60, 11)), rows(60, 12)));
    assert_eq!(features(5), mirror_features(&rows(60, 13)));
    let told = set.remarks().iter().find(|line| line.starts_with("M000002 is not the mirror"));
    assert!(told.is_some(), "{:?}", set.remarks());
    let checked = crate::data::check_folder(data.path());
    let unlisted = checked.remarks.iter().find(|line| line.contains("in no split"));
    assert_eq!(unlisted.map(String::as_str), Some("4 motions are in no split, as 000000"));
}
