//! A digest that stands within its file: the last field of JSON, a field of the first line of JSON lines, a comment of
//! YAML, a note of Parquet.
//!
//! In all of them it is the text `"digest": "blake3:…"`, with 64 digits for all other bytes of the file. A file without
//! one is somebody's own, or of an earlier version, and is read as it is.

/// The text before the digits.
const MARK: &[u8] = b"\"digest\": \"blake3:";
/// The digits, before they are known.
const BLANK: &[u8; 64] = &[b'0'; 64];

/// Why a file with another digest is refused.
pub const CHANGED: &str =
    "its bytes are not those that were written; if you changed it yourself, take its `digest` out";

/// The field, to be put into a file whose digits [`fill`] then writes.
pub fn field() -> String {
    [MARK, BLANK, b"\""].map(String::from_utf8_lossy).concat()
}

/// Writes the digits of a file's last [`field`]; a file without one is left as it is.
pub fn fill(mut bytes: Vec<u8>) -> Vec<u8> {
    if let Some(at) = place(&bytes) {
        let digits = digits(&bytes, at);
        bytes[at..at + BLANK.len()].copy_from_slice(digits.as_bytes());
    }
    bytes
}

/// Whether a file has the digest of other bytes.
pub fn is_wrong(bytes: &[u8]) -> bool {
    place(bytes).is_some_and(|at| &bytes[at..at + BLANK.len()] != digits(bytes, at).as_bytes())
}

/// A JSON text with the field as the last one of its object, or of the last object of its list; other values have none.
pub fn within_json(text: &str) -> String {
    let whole = text.trim_end();
    let last = whole.strip_suffix(']').map_or(whole, str::trim_end);
    let Some(inner) = last.strip_suffix('}').filter(|inner| !inner.ends_with('{')) else {
        return text.to_string();
    };
    let fields = inner.trim_end();
    let gap = match &inner[fields.len()..] {
        "" => " ".to_string(),
        indent => format!("{indent}  "),
    };
    [fields, ",", &gap, &field(), &text[fields.len()..]].concat()
}

/// A YAML text with the field as a comment at its end.
pub fn below_yaml(text: &str) -> String {
    format!("{}\n# {}\n", text.trim_end(), field())
}

/// A JSON or YAML file without the field, and without the comma or the sign before it.
pub fn without(mut bytes: Vec<u8>) -> Vec<u8> {
    if let Some(at) = place(&bytes) {
        let before = bytes[..at - MARK.len()].trim_ascii_end();
        let from = before.len() - usize::from(matches!(before, [.., b',' | b'#']));
        bytes.drain(from..at + BLANK.len() + 1);
    }
    bytes
}

/// Where the digits of the last field begin.
fn place(bytes: &[u8]) -> Option<usize> {
    let at = bytes.windows(MARK.len()).rposition(|window| window == MARK)? + MARK.len();
    (bytes.get(at + BLANK.len()) == Some(&b'"')).then_some(at)
}

/// The digits for all bytes but the digits at `at`.
fn digits(bytes: &[u8], at: usize) -> String {
    let mut hasher = blake3::Hasher::new();
    hasher.update(&bytes[..at]).update(&bytes[at + BLANK.len()..]);
    hasher.finalize().to_hex().to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn whole(text: &str) -> Vec<u8> {
        fill(text.as_bytes().to_vec())
    }

    #[test]
    fn every_bit_that_turns_over_in_a_number_is_found() {
        for text in [
            within_json("{\n  \"loss\": 1.25\n}\n"),
            within_json("[\n  {\n    \"a\": 1\n  },\n  {\n    \"loss\": 1.25\n  }\n]\n"),
            within_json("{\"loss\":1.25}") + "\n{\"loss\":1.5}\n",
            below_yaml("loss: 1.25\n"),
            format!("PAR1 1.25 {} PAR1", field()),
        ] {
            let file = whole(&text);
            assert!(!is_wrong(&file), "{text}");
            let number = text.find("1.25").unwrap();
            for bit in 0..32 {
                let mut changed = file.clone();
                changed[number + bit / 8] ^= 1 << (bit % 8);
                assert!(is_wrong(&changed), "bit {bit} of {text}");
            }
        }
    }

    #[test]
    fn a_file_without_its_digest_is_what_was_written() {
        for text in
            ["{\n  \"a\": [\n    1\n  ]\n}\n", "[\n  {\n    \"a\": 1\n  }\n]\n", "{\"a\":1}"]
        {
            let file = whole(&within_json(text));
            assert_eq!(String::from_utf8(without(file.clone())).unwrap(), text);
            serde_json::from_slice::<serde_json::Value>(&file).unwrap();
        }
        assert_eq!(without(whole(&below_yaml("a: 1\n"))), b"a: 1\n\n");
    }

    #[test]
    fn values_without_fields_and_files_of_others_have_no_digest() {
        for text in
            ["[\n  1,\n  2\n]\n", "{}\n", "[]\n", "3\n", "\"}\"\n", "{\"digest\": \"blake3:ab\"}"]
        {
            let file = whole(text);
            assert!(place(&file).is_none() && !is_wrong(&file) && without(file) == text.as_bytes());
        }
        assert_eq!(within_json("{}\n"), "{}\n");
        assert_eq!(within_json("[1]"), "[1]");
    }
}
