//! What the name of a joint says: a side of the body, and a part of it.

/// A side of the body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    Left,
    Right,
}

/// A joint's name, taken apart.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct JointName {
    pub side: Option<Side>,
    /// The part of the body: lower-case letters and digits, without side and prefix.
    pub part: String,
}

impl JointName {
    /// Side and part of `mixamorig:LeftUpLeg`, `Bip01 L Thigh`, `upper_arm.L`, `lShldr`, `lhand`, …
    ///
    /// A word that is a side stands before or after the part. Of a name without a side the last word is
    /// the part.
    pub fn of(name: &str) -> JointName {
        let words = words(name.rsplit(':').next().unwrap_or(name));
        match words.iter().position(|word| side(word).is_some()) {
            Some(at) if at + 1 < words.len() => {
                JointName { side: side(&words[at]), part: words[at + 1..].concat() }
            }
            Some(at) => JointName { side: side(&words[at]), part: words[..at].concat() },
            None => {
                let part = words.last().cloned().unwrap_or_default();
                JointName { side: None, part }
            }
        }
    }

    /// `lhand` read as the left `hand`, for names without capitals.
    pub fn with_letter_as_side(&self) -> Option<JointName> {
        let (letter, part) = self.part.split_at_checked(1).filter(|_| self.side.is_none())?;
        Some(JointName { side: Some(side(letter)?), part: part.to_string() })
    }
}

fn side(word: &str) -> Option<Side> {
    match word {
        "left" | "l" => Some(Side::Left),
        "right" | "r" => Some(Side::Right),
        _ => None,
    }
}

/// Runs of letters and digits in lower case, parted also where a capital begins a word.
pub fn words(name: &str) -> Vec<String> {
    let letters: Vec<char> = name.chars().collect();
    let mut words: Vec<String> = vec![String::new()];
    for (i, &letter) in letters.iter().enumerate() {
        let before = i.checked_sub(1).map(|i| letters[i]);
        let after = letters.get(i + 1);
        let begins = letter.is_uppercase()
            && (before.is_some_and(char::is_lowercase) || after.is_some_and(|c| c.is_lowercase()));
        if (begins || !letter.is_alphanumeric()) && !words[words.len() - 1].is_empty() {
            words.push(String::new());
        }
        if letter.is_alphanumeric() {
            let last = words.len() - 1;
            words[last].extend(letter.to_lowercase());
        }
    }
    words.retain(|word| !word.is_empty());
    words
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_seven_conventions_are_read() {
        use Side::{Left, Right};
        let cases = [
            ("mixamorig:LeftUpLeg", Some(Left), "upleg"),
            ("Bip01 L Thigh", Some(Left), "thigh"),
            ("upper_arm.R", Some(Right), "upperarm"),
            ("lShldr", Some(Left), "shldr"),
            ("RHipJoint", Some(Right), "hipjoint"),
            ("UpperArm_L", Some(Left), "upperarm"),
            ("right_wrist", Some(Right), "wrist"),
            ("Character1_RightForeArm", Some(Right), "forearm"),
            ("LeftHandIndex1", Some(Left), "handindex1"),
            ("mixamorig_Head", None, "head"),
            ("joint_Root", None, "root"),
            ("lowerneck", None, "lowerneck"),
        ];
        for (name, side, part) in cases {
            assert_eq!(JointName::of(name), JointName { side, part: part.to_string() }, "{name}");
        }
        let hand = JointName::of("rhand").with_letter_as_side();
        assert_eq!(hand, Some(JointName { side: Some(Right), part: "hand".to_string() }));
        assert_eq!(JointName::of("LeftHand").with_letter_as_side(), None);
        assert_eq!(JointName::of("").with_letter_as_side(), None);
    }
}
