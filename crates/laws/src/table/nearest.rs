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
