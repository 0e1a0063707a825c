use super::*;
use crate::data::{MotionSource, Procedural, ProceduralOptions};
use crate::motion::build_features;
use crate::motion::fixtures::{dance, mirrored_poses, procedural};

/// What is found of one motion of a file.
fn found(poses: &[Pose]) -> Vec<Finding> {
    let features = build_features(poses);
    let seen = [Seen::of("a.npy", None, Held::Features(&features))];
    look(&seen, Look::ALL).into_iter().map(|found| found.finding).collect()
}

fn each(poses: &[Pose], place: impl Fn([f32; 3]) -> [f32; 3]) -> Vec<Pose> {
    poses.iter().map(|pose| pose.map(&place)).collect()
}

#[test]
fn units_axes_and_sides_are_told_of_every_motion_and_of_no_good_one() {
    for seed in 0..40 {
        let poses = procedural(seed);
        assert_eq!(found(&poses), [], "{seed}");
        for unit in [0.01, 1.0 / 2.54, 2.54, 39.37, 100.0] {
            let [Finding::Scale(legs)] = found(&each(&poses, |p| p.map(|c| c * unit)))[..] else {
                panic!("{seed}: {unit}")
            };
            assert!((legs / f64::from(unit) - 1.0).abs() < 0.01, "{legs}");
        }
        let z_up = found(&each(&poses, |[x, y, z]| [x, -z, y]));
        assert!(matches!(z_up[..], [Finding::Lies(_)]), "{seed}: {z_up:?}");
        let sides = found(&each(&poses, |[x, y, z]| [-x, y, z]));
        assert_eq!(sides, [Finding::Backwards], "{seed}");
        assert_eq!(found(&mirrored_poses(&poses)), [], "{seed}: a mirror image is a body");
    }
}

#[test]
fn a_capture_that_stands_still_is_told_with_its_frames() {
    let poses = procedural(3);
    let rest = vec![poses[20]; 250];
    assert_eq!(found(&[&poses[..20], &rest].concat()), [Finding::Still(249)]);
    assert_eq!(found(&[&poses[..], &rest[..30]].concat()), []);
}

#[test]
fn findings_name_their_motions_and_how_to_mend_them() {
    let of = |names: &[&str]| {
        let names = names.iter().map(|name| name.to_string()).collect();
        Found { finding: Finding::Scale(0.394), names, of: 13 }.to_string()
    };
    let told = of(&["walk.bvh"]);
    assert!(told.starts_with("walk.bvh: the legs are 0.394 times as long as those"), "{told}");
    assert!(told.contains("`isoflop data import` reads other units"), "{told}");
    assert!(of(&["a", "b", "c", "d"]).starts_with("a, b, c and others, 4 of 13 motions: the legs"));
}

/// Clips of the names, each of a seed and mirrored or not, of a split.
fn pairs_of(clips: &[(&str, u64, bool, Split)]) -> Vec<String> {
    let features: Vec<Vec<f32>> = (clips.iter())
        .map(|(_, seed, image, _)| {
            let features = build_features(&procedural(*seed));
            if *image { mirror_features(&features) } else { features }
        })
        .collect();
    let seen = clips.iter().zip(&features);
    let seen: Vec<Seen> =
        seen.map(|(own, rows)| Seen::of(own.0, Some(own.3), Held::Features(rows))).collect();
    look(&seen, Look::ALL).iter().map(Found::to_string).collect()
}

#[test]
fn one_motion_of_two_names_is_told_and_most_where_it_is_tested() {
    let found = pairs_of(&[
        ("a", 1, false, Split::Train),
        ("b", 2, false, Split::Train),
        ("c", 1, false, Split::Test),
        ("d", 2, false, Split::Train),
        ("e", 3, false, Split::Val),
        ("f", 3, true, Split::Train),
    ]);
    let [leak, twice, image] = &found[..] else { panic!("{found:?}") };
    assert!(leak.starts_with("a (train) and c (test): motion that is trained on is in"), "{leak}");
    assert!(twice.starts_with("b (train) and d (train): one motion has two names"), "{twice}");
    assert!(image.starts_with("e (val) and f (train): the mirror image of motion that"), "{image}");
    // As HumanML3D has them.
    let twins = pairs_of(&[("1", 1, false, Split::Train), ("M1", 1, true, Split::Train)]);
    assert_eq!(twins, [""; 0]);
}

#[test]
fn a_name_makes_no_mirror_image() {
    let poses = dance(120);
    let [arch, march] = [&poses[..60], &poses[60..]].map(build_features);
    assert!(is_image(&arch, &mirror_features(&arch)));
    assert!(!is_image(&arch, &march) && !is_image(&arch, &arch));
    // Bones differ by a centimetre from side to side in HumanML3D's own.
    let near: Vec<f32> = mirror_features(&arch).iter().map(|value| value + 0.01).collect();
    assert!(is_image(&arch, &near) && is_image(&near, &arch));
    assert!(is_image(&arch, &build_features(&mirrored_poses(&poses[..60]))));
}

#[test]
fn a_mean_and_a_deviation_of_other_data_are_told_with_their_columns() {
    let (val_clips, test_clips) = (1, 1);
    let source =
        Procedural::new(ProceduralOptions { seed: 0, train_clips: 12, val_clips, test_clips });
    let clips: Vec<Vec<f32>> = (0..12).map(|i| source.features(Split::Train, i).unwrap()).collect();
    let told = |stats: &FeatureStats| -> Vec<String> {
        let seen = clips.iter().map(|rows| Seen::of("a", Some(Split::Train), Held::Features(rows)));
        let how = Look { stats: Some(stats), of_these: true, ..Look::ALL };
        let found = look(&seen.collect::<Vec<_>>(), how);
        found.iter().filter(|own| own.names.is_empty()).map(Found::to_string).collect()
    };
    let good = source.stats();
    assert_eq!(told(good), [""; 0]);
    let mut bias = good.clone();
    bias.std[..4].iter_mut().for_each(|std| *std /= 25.0);
    bias.std[259..].iter_mut().for_each(|std| *std /= 25.0);
    let found = told(&bias);
    assert_eq!(found.len(), 4, "{found:?}");
    assert!(
        found[0].starts_with("Std.npy is 0.0") && found[0].contains("in columns 0:"),
        "{found:?}"
    );
    assert!(found[3].contains("in columns 259 to 262: it is of other data"), "{found:?}");
    let mut mean = good.clone();
    mean.mean[3] += 0.9;
    let [found] = &told(&mean)[..] else { panic!("one finding") };
    assert!(found.starts_with("Mean.npy is ") && found.contains("in columns 3:"), "{found}");
}
