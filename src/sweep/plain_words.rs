//! What serde says of a value of the wrong type, in the words of people who write YAML.

/// What serde calls values of YAML, and what people do: as it was found, or as it is wanted.
const WORDS: [(&str, &str); 17] = [
    ("floating point ", ""),
    ("integer ", ""),
    ("boolean ", ""),
    ("string \"", "\""),
    ("unit value", "nothing"),
    ("sequence", "a list"),
    ("map", "a section"),
    ("a sequence", "a list"),
    ("a map", "a section"),
    ("a boolean", "true or false"),
    ("a string", "text"),
    ("string or map", "a word or a section"),
    ("usize", "a whole number"),
    ("u64", "a whole number"),
    ("u32", "a whole number"),
    ("f64", "a number"),
    ("path string", "a path"),
];

/// `invalid type: sequence, expected a string` as `expected text, found a list`; all else as it is.
pub fn plain(message: &str) -> String {
    let types =
        message.strip_prefix("invalid type: ").and_then(|rest| rest.split_once(", expected "));
    let Some((found, expected)) = types else { return message.to_string() };
    let expected = match expected.split_once(' ') {
        Some(("struct" | "internally", _)) => "a section, `key: value`".to_string(),
        _ => in_words(expected),
    };
    format!("expected {expected}, found {}", in_words(found))
}

fn in_words(what: &str) -> String {
    let whole = WORDS.iter().find(|(theirs, _)| *theirs == what);
    let start =
        WORDS.iter().find(|(theirs, _)| theirs.ends_with([' ', '"']) && what.starts_with(theirs));
    match (whole, start) {
        (Some((_, ours)), _) => (*ours).to_string(),
        (None, Some((theirs, ours))) => format!("{ours}{}", &what[theirs.len()..]),
        (None, None) => what.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::plain;

    #[test]
    fn types_are_told_as_people_write_them() {
        let cases = [
            (
                "invalid type: floating point `0.0003`, expected struct X",
                "expected a section, `key: value`, found `0.0003`",
            ),
            ("invalid type: sequence, expected a string", "expected text, found a list"),
            (
                "invalid type: string \"many\", expected a boolean",
                "expected true or false, found \"many\"",
            ),
            ("invalid type: unit value, expected a sequence", "expected a list, found nothing"),
            (
                "invalid type: map, expected a list of models",
                "expected a list of models, found a section",
            ),
            ("expected a number, found `abc`", "expected a number, found `abc`"),
        ];
        for (theirs, ours) in cases {
            assert_eq!(plain(theirs), ours);
        }
    }
}
