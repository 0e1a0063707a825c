//! Lines of a caption file: `caption#tokens#from#to`.

/// What one line says about a clip.
#[derive(Clone, Debug, PartialEq)]
pub struct Annotation {
    /// The caption, lower-case, with single spaces.
    pub caption: String,
    /// The part of the clip that it describes, `[from, to)` in seconds; the whole clip if absent.
    pub span_s: Option<(f64, f64)>,
}

/// Why a line cannot be used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CaptionProblem {
    /// Neither a caption alone nor all four fields.
    #[error("has {0} fields between `#`; write `caption#tokens#from#to`, or the caption alone")]
    Fields(usize),
    /// Nothing stands before the first `#`.
    #[error("has no caption")]
    NoCaption,
    /// A time is not a number.
    #[error("has `{0}` where a time in seconds is needed")]
    Time(String),
    /// The times are not a span.
    #[error(
        "describes the time from {from} to {to} s, which is no span; `0.0#0.0` is the whole clip"
    )]
    Span { from: f64, to: f64 },
}

/// The annotation in `line`.
///
/// The tokens (words with their part of speech) are not kept. `nan` counts as 0, and from 0 to 0
/// is the whole clip. A line without `#` is a caption of the whole clip, as Motion-X writes them.
///
/// # Errors
/// [`CaptionProblem`] if the line is neither.
pub fn parse_annotation(line: &str) -> Result<Annotation, CaptionProblem> {
    let fields: Vec<&str> = line.split('#').collect();
    let (text, span_s) = match fields[..] {
        [text] => (text, None),
        [text, _tokens, from, to] => (text, span(from, to)?),
        _ => return Err(CaptionProblem::Fields(fields.len())),
    };
    let words: Vec<String> = text.split_whitespace().map(str::to_lowercase).collect();
    if words.is_empty() {
        return Err(CaptionProblem::NoCaption);
    }
    Ok(Annotation { caption: words.join(" "), span_s })
}

/// The annotations of a whole file, and a sentence for each line that holds none.
///
/// Empty lines are passed over, also the mark of byte order with which some editors begin a file.
pub(super) fn parse_annotations(content: &str) -> (Vec<Annotation>, Vec<String>) {
    let (mut annotations, mut problems) = (Vec::new(), Vec::new());
    let lines = content.trim_start_matches('\u{feff}').lines().enumerate();
    for (index, line) in lines.filter(|(_, line)| !line.trim().is_empty()) {
        match parse_annotation(line) {
            Ok(annotation) => annotations.push(annotation),
            Err(problem) => problems.push(format!("line {} {problem}", index + 1)),
        }
    }
    (annotations, problems)
}

fn span(from: &str, to: &str) -> Result<Option<(f64, f64)>, CaptionProblem> {
    let (from, to) = (time_s(from)?, time_s(to)?);
    match (from, to) {
        (0.0, 0.0) => Ok(None),
        _ if 0.0 <= from && from < to => Ok(Some((from, to))),
        _ => Err(CaptionProblem::Span { from, to }),
    }
}

fn time_s(field: &str) -> Result<f64, CaptionProblem> {
    match field.trim().parse::<f64>() {
        Ok(time) if time.is_nan() => Ok(0.0),
        Ok(time) if time.is_finite() => Ok(time),
        _ => Err(CaptionProblem::Time(field.trim().to_owned())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn annotation(caption: &str, span_s: Option<(f64, f64)>) -> Annotation {
        Annotation { caption: caption.to_owned(), span_s }
    }

    #[test]
    fn a_line_gives_its_caption_and_its_span() {
        let line = "A man  waves, slowly.#a/DET man/NOUN wave/VERB slowly/ADV#1.5#4.0\r";
        let expected = annotation("a man waves, slowly.", Some((1.5, 4.0)));
        assert_eq!(parse_annotation(line), Ok(expected));
    }

    #[test]
    fn zeros_nan_and_a_bare_caption_mean_the_whole_clip() {
        for line in
            ["he sits#he/PRON sit/VERB#0.0#0.0", "he sits##nan#nan", "he sits##0.0#NaN", "he sits"]
        {
            assert_eq!(parse_annotation(line), Ok(annotation("he sits", None)), "{line}");
        }
    }

    #[test]
    fn bad_lines_say_what_is_wrong() {
        let cases = [
            ("he sits#he/PRON#0.0", CaptionProblem::Fields(3)),
            ("a #1 hit#a/DET hit/NOUN#0.0#0.0", CaptionProblem::Fields(5)),
            (" #he/PRON#0.0#0.0", CaptionProblem::NoCaption),
            ("he sits##zero#0.0", CaptionProblem::Time("zero".to_owned())),
            ("he sits##0.0#inf", CaptionProblem::Time("inf".to_owned())),
            ("he sits##3.0#1.0", CaptionProblem::Span { from: 3.0, to: 1.0 }),
            ("he sits##-1.0#1.0", CaptionProblem::Span { from: -1.0, to: 1.0 }),
            ("he sits##2.0#nan", CaptionProblem::Span { from: 2.0, to: 0.0 }),
        ];
        for (line, problem) in cases {
            assert_eq!(parse_annotation(line), Err(problem), "{line}");
        }
    }

    #[test]
    fn a_file_gives_its_good_lines_and_the_numbers_of_its_bad_ones() {
        let (annotations, problems) =
            parse_annotations("\u{feff}he sits\n\n##0#0\nshe runs##0#0\n");
        assert_eq!(annotations, [annotation("he sits", None), annotation("she runs", None)]);
        assert_eq!(problems, ["line 3 has no caption"]);
    }
}
