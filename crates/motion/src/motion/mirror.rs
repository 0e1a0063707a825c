//! Left and right exchanged, in features and in captions.

use std::borrow::Cow;
use std::sync::LazyLock;

use super::features::{CONTACTS, POSITIONS, ROOT_VELOCITY, ROOT_YAW, ROTATIONS, VELOCITIES};
use super::skeleton::MIRROR_PARTNER;
use crate::motion::N_FEATURES;

/// For each column of the mirrored row: the column it comes from, and its sign.
static COLUMNS: LazyLock<[(usize, f32); N_FEATURES]> = LazyLock::new(|| {
    let mut columns = std::array::from_fn(|column| (column, 1.0));
    columns[ROOT_YAW].1 = -1.0;
    columns[ROOT_VELOCITY.start].1 = -1.0;
    exchange(&mut columns[POSITIONS], POSITIONS.start, 1, &POINT_SIGNS);
    exchange(&mut columns[ROTATIONS], ROTATIONS.start, 1, &ROTATION_SIGNS);
    exchange(&mut columns[VELOCITIES], VELOCITIES.start, 0, &POINT_SIGNS);
    for foot in 0..4 {
        columns[CONTACTS.start + foot].0 = CONTACTS.start + (foot + 2) % 4;
    }
    columns
});

/// Signs of a point and of the two columns of a rotation under `x → -x`; with `M = diag(-1, 1, 1)`
/// the point `p` becomes `M p`, the matrix `R` becomes `M R M`.
const POINT_SIGNS: [f32; 3] = [-1.0, 1.0, 1.0];
const ROTATION_SIGNS: [f32; 6] = [1.0, -1.0, -1.0, -1.0, 1.0, 1.0];

/// Features of the motion seen in a mirror: the x axis is reversed, left and right joints change
/// places.
///
/// It equals building features from mirrored joints, and is its own exact inverse.
///
/// # Shapes
/// Row-major `[T, 263]`, not normalised, to the same.
///
/// # Panics
/// If `features` does not consist of whole rows.
pub fn mirror_features(features: &[f32]) -> Vec<f32> {
    assert!(features.len().is_multiple_of(N_FEATURES), "features come in rows of {N_FEATURES}");
    let mut mirrored = Vec::with_capacity(features.len());
    for row in features.chunks_exact(N_FEATURES) {
        mirrored.extend(COLUMNS.iter().map(|&(source, sign)| sign * row[source]));
    }
    mirrored
}

/// Suffixes of a side in one word: `leftward`, `righthanded`.
const AFTER_A_SIDE: [&str; 24] = [
    "", "s", "y", "ie", "ward", "wards", "wardly", "most", "hand", "hands", "handed", "hander",
    "handers", "handedly", "foot", "footed", "footer", "arm", "armed", "leg", "legged", "side",
    "sided", "sides",
];
/// Prefixes that reverse `clockwise`, in one word or separated by `-` or a space.
const AGAINST: [&str; 3] = ["counter", "anti", "contra"];

/// `caption` with the words `left` and `right` exchanged.
///
/// Lower-case words only, and compounds that begin with a side: `leftover` and `upright` stay, `left-handed` and
/// `leftward` change. A `right` that means `at once` or `correct` is changed too, as in HumanML3D's own mirrored
/// captions. Senses of turning are exchanged as well.
pub fn mirror_caption(caption: &str) -> String {
    let mut mirrored = String::with_capacity(caption.len() + 8);
    let mut rest = caption;
    while !rest.is_empty() {
        let (word, after) = word(rest);
        let next = after.strip_prefix(['-', ' ']).map(self::word);
        let (other, after) = match next {
            Some(("clockwise", after)) if AGAINST.contains(&word) => ("clockwise".into(), after),
            _ => (mirrored_word(word), after),
        };
        mirrored += &other;
        rest = after;
    }
    mirrored
}

/// Splits off the first word (letters and digits) or separator of a text, and the rest.
fn word(text: &str) -> (&str, &str) {
    let in_word = text.starts_with(char::is_alphanumeric);
    text.split_at(text.find(|c: char| c.is_alphanumeric() != in_word).unwrap_or(text.len()))
}

fn mirrored_word(word: &str) -> Cow<'_, str> {
    for (side, other) in [("left", "right"), ("right", "left")] {
        if let Some(after) = word.strip_prefix(side).filter(|end| AFTER_A_SIDE.contains(end)) {
            return Cow::Owned(format!("{other}{after}"));
        }
    }
    match word.strip_suffix("clockwise") {
        Some("") => Cow::Borrowed("counterclockwise"),
        Some(against) if AGAINST.contains(&against) => Cow::Borrowed("clockwise"),
        _ => Cow::Borrowed(word),
    }
}

/// Gives the `columns` of each joint from `first_joint` on, `signs.len()` a joint, the other side's columns
/// with `signs`; `start` is the place of the first of them in a row.
fn exchange(columns: &mut [(usize, f32)], start: usize, first_joint: usize, signs: &[f32]) {
    for (i, own) in columns.iter_mut().enumerate() {
        let (joint, part) = (i / signs.len(), i % signs.len());
        let partner = MIRROR_PARTNER[joint + first_joint] - first_joint;
        *own = (start + partner * signs.len() + part, signs[part]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::build_features;
    use crate::motion::fixtures::{dance, largest_difference, mirrored_poses};

    #[test]
    fn mirroring_twice_changes_no_bit() {
        let features = build_features(&dance(30));
        let mirrored = mirror_features(&features);
        assert_ne!(mirrored, features);
        assert_eq!(mirror_features(&mirrored), features);
    }

    #[test]
    fn mirroring_commutes_with_building() {
        let poses = dance(120);
        let built = build_features(&mirrored_poses(&poses));
        let difference = largest_difference(&built, &mirror_features(&build_features(&poses)));
        assert!(difference < 1e-5, "{difference}");
    }

    #[test]
    fn only_whole_words_change_sides() {
        let cases = [
            ("a person steps left, then right.", "a person steps right, then left."),
            (
                "left-handed throw with the right/left arm",
                "right-handed throw with the left/right arm",
            ),
            ("an upright man picks leftovers brightly", "an upright man picks leftovers brightly"),
            ("", ""),
            ("é left", "é right"),
            ("turns clockwise twice", "turns counterclockwise twice"),
            ("a leftward step, rightmost foot", "a rightward step, leftmost foot"),
            ("lefthanded, with the righthand", "righthanded, with the lefthand"),
            ("two quick lefts on the leftside", "two quick rights on the rightside"),
            ("rightly, rightfully, leftovers", "rightly, rightfully, leftovers"),
        ];
        for (caption, expected) in cases {
            assert_eq!(mirror_caption(caption), expected);
            assert_eq!(mirror_caption(expected), caption);
        }
    }

    #[test]
    fn every_way_to_write_against_the_clock_becomes_with_it() {
        for against in ["counter", "anti", "contra"] {
            for joint in ["", "-", " "] {
                let caption = format!("he walks {against}{joint}clockwise in a circle");
                assert_eq!(mirror_caption(&caption), "he walks clockwise in a circle");
            }
        }
        assert_eq!(mirror_caption("an anti hero, clockwise"), "an anti hero, counterclockwise");
        assert_eq!(mirror_caption("at the counter"), "at the counter");
    }

    #[test]
    fn each_compound_changes_its_side_and_back() {
        for side in ["left", "right"] {
            let other = if side == "left" { "right" } else { "left" };
            for after in AFTER_A_SIDE {
                for sentence in ["{} first", "with the {} arm", "turns {}-first, twice"] {
                    let [own, mirrored] =
                        [side, other].map(|side| sentence.replace("{}", &format!("{side}{after}")));
                    assert_eq!(mirror_caption(&own), mirrored);
                }
            }
        }
    }
}
