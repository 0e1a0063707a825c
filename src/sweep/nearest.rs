//! Advice for a name that is not known.

/// `did you mean …?`, or the list of what may stand there.
pub fn nearest(wrong: &str, valid: &[&str]) -> String {
    let best = valid
        .iter()
        .map(|name| (strsim::jaro_winkler(wrong, name), name))
        .max_by(|a, b| a.0.total_cmp(&b.0));
    match best {
        Some((score, name)) if score > 0.75 => format!("did you mean `{name}`?"),
        _ => format!("valid here: {}", valid.join(", ")),
    }
}
