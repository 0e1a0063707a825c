//! The valid name that a wrong one was meant to be.

/// Names less alike than this are no help.
const ALIKE: f64 = 0.7;

/// The most similar of `names`, by Jaro and Winkler and without regard to case.
pub(super) fn nearest<'a>(wrong: &str, names: impl Iterator<Item = &'a str>) -> Option<&'a str> {
    let wrong = wrong.to_lowercase();
    names
        .map(|name| (strsim::jaro_winkler(&wrong, &name.to_lowercase()), name))
        .filter(|(alike, _)| *alike > ALIKE)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, name)| name)
}

/// "did you mean `loss`? ", or nothing.
pub(super) fn hint<'a>(wrong: &str, names: impl Iterator<Item = &'a str>) -> String {
    nearest(wrong, names).map(|name| format!("did you mean `{name}`? ")).unwrap_or_default()
}

/// A name that none has of those that are valid.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("`{name}` is no {kind}; {hint}valid: {valid}")]
pub struct UnknownName {
    kind: &'static str,
    name: String,
    hint: String,
    valid: String,
}

/// What a name stands for among all of a kind.
pub(super) fn named<T: Copy>(
    kind: &'static str,
    name: &str,
    all: &[(&'static str, T)],
) -> Result<T, UnknownName> {
    let names = || all.iter().map(|(name, _)| *name);
    let found = all.iter().find(|(of, _)| *of == name).map(|(_, value)| *value);
    found.ok_or_else(|| UnknownName {
        kind,
        name: name.to_string(),
        hint: hint(name, names()),
        valid: names().collect::<Vec<_>>().join(", "),
    })
}

/// The name of one among all of its kind.
pub(super) fn name_of<T: PartialEq>(value: &T, all: &[(&'static str, T)]) -> &'static str {
    all.iter().find(|(_, of)| of == value).map_or("", |(name, _)| name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slip_of_the_pen_finds_its_name_and_nonsense_finds_none() {
        let names = ["Model Size", "Training FLOP", "loss"];
        assert_eq!(nearest("modle size", names.into_iter()), Some("Model Size"));
        assert_eq!(nearest("qqq", names.into_iter()), None);
        assert_eq!(hint("los", names.into_iter()), "did you mean `loss`? ");
    }
}
