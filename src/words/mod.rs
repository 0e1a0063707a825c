//! Laws and predictions as text for a terminal: wrapped sentences, and numbers that may be missing.

pub mod fit;
pub mod prediction;

use std::sync::atomic::{AtomicUsize, Ordering};

/// Columns of a line if no terminal is known, and of every table.
const COLUMNS: usize = 80;

/// Columns at which sentences are wrapped.
static WIDTH: AtomicUsize = AtomicUsize::new(COLUMNS);

/// Wraps all sentences from now on at the columns of a terminal, clamped to 60 to 120. The program calls this
/// once, if its results go to a terminal.
pub fn fit_to_terminal(columns: usize) {
    WIDTH.store(columns.clamp(60, 120), Ordering::Relaxed);
}

/// Wraps `sentence` at spaces: the first line follows `bullet`, the others are indented as far. A word that is
/// longer than a line stays whole. Ends with a newline.
pub fn wrap(bullet: &str, sentence: &str) -> String {
    broken(bullet, sentence, WIDTH.load(Ordering::Relaxed))
}

fn broken(bullet: &str, sentence: &str, columns: usize) -> String {
    let indent = " ".repeat(bullet.chars().count());
    let mut text = bullet.to_string();
    let mut width = indent.len();
    for word in sentence.split_whitespace() {
        let (first, length) = (width == indent.len(), word.chars().count());
        if !first && width + 1 + length > columns {
            text += &format!("\n{indent}{word}");
            width = indent.len() + length;
        } else {
            text += if first { "" } else { " " };
            text += word;
            width += usize::from(!first) + length;
        }
    }
    text + "\n"
}

/// A list of sentences under a heading; empty without sentences.
fn listed(heading: &str, sentences: impl Iterator<Item = String>) -> String {
    let list: String = sentences.map(|sentence| wrap("  - ", &sentence)).collect();
    if list.is_empty() { list } else { format!("\n{heading}\n{list}") }
}

// Numbers that may be missing, and intervals.

/// A number; a dash if there is none.
fn known(x: Option<f64>, number: impl Fn(f64) -> String) -> String {
    x.map_or_else(|| "-".into(), number)
}

/// An interval in a column of a table; a dash if there is none.
fn span(ends: Option<[f64; 2]>, number: impl Fn(f64) -> String) -> String {
    ends.map_or_else(|| "-".into(), |[low, high]| format!("{}..{}", number(low), number(high)))
}

/// An interval in a sentence.
pub(crate) fn from_to(ends: [f64; 2], number: impl Fn(f64) -> String) -> String {
    let [low, high] = ends.map(number);
    format!("{low} to {high}")
}

/// Three decimals.
pub(crate) fn thousandths(x: f64) -> String {
    format!("{x:.3}")
}

/// Four decimals.
fn four(x: f64) -> String {
    format!("{x:.4}")
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::fit::{brief, summary};
    use super::prediction::{said, sized_text, standing};
    use super::{COLUMNS, broken, wrap};
    use crate::laws::{FitOptions, IsoFlopPoint, Laws, Parameters, fit, scamo};
    use crate::predict::{ModelSize, PredictOptions, Prediction, predict, predict_sized};
    use crate::table::{TableRequest, load, read};

    /// 140 runs of a user's trainer.
    fn points() -> Vec<IsoFlopPoint> {
        let path = "crates/laws/tests/fixtures/own_trainer.csv";
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(path);
        let columns = Some("budget_flops=budget,n_vocab=vocab".to_string());
        let request = TableRequest { columns, ..TableRequest::default() };
        load(&read(&path).unwrap(), &request).unwrap().points
    }

    fn fitted(points: &[IsoFlopPoint], options: FitOptions) -> Laws {
        fit(points, &FitOptions { bootstrap: 100, ..options }).unwrap()
    }

    /// A study's own laws.
    fn committed(study: &str) -> Laws {
        let path =
            Path::new(env!("CARGO_MANIFEST_DIR")).join("results").join(study).join("laws.json");
        serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
    }

    fn at(laws: &Laws, budget: f64) -> Prediction {
        predict(laws, budget, &PredictOptions::default()).unwrap()
    }

    fn fits(text: &str) {
        assert!(text.lines().all(|line| line.chars().count() <= 80), "{text}");
        assert!(!text.contains("NaN") && !text.contains("inf "), "{text}");
    }

    #[test]
    fn the_first_screen_is_the_head_of_the_full_text_and_has_every_exponent() {
        let laws = fitted(&points(), FitOptions::default());
        let (first, full) = (brief(&laws), summary(&laws));
        assert!(full.starts_with(&first));
        fits(&full);
        for (_, exponent) in laws.answer().exponents.named() {
            let value = format!("{:.3}", exponent.value.unwrap());
            assert!(first.contains(&value), "{value}: {first}");
        }
        fits(&summary(&scamo()));
        let full = summary(&committed("procedural-law"));
        fits(&full);
        for part in ["unseen budgets", "what to run next", "minima: akima", "size: N = N_nv + N_v"]
        {
            assert!(full.contains(part), "{part}: {full}");
        }
    }

    #[test]
    fn a_flagged_minimum_is_named_with_its_flag() {
        let mut points = points();
        let largest = points.iter().map(|p| p.budget_flops).fold(0.0, f64::max);
        let of_largest = points.iter().filter(|p| p.budget_flops == largest);
        let best = of_largest.min_by(|a, b| a.loss.total_cmp(&b.loss)).unwrap().params_nonvocab;
        points.retain(|p| p.budget_flops != largest || p.params_nonvocab >= best);
        let laws = fitted(&points, FitOptions::default());
        let full = summary(&laws);
        assert!(full.contains("not-bracketed"), "{full}");
        let parabolas = full.lines().filter(|line| line.starts_with("parabola")).count();
        let budgets = laws.minima.iter().filter(|m| m.method.to_string() == "parabola").count();
        assert_eq!(parabolas, budgets);
    }

    #[test]
    fn a_table_of_n_alone_is_told_without_a_vocabulary() {
        let total = |p: IsoFlopPoint| IsoFlopPoint {
            params_nonvocab: p.params_nonvocab + p.params_vocab,
            params_vocab: 0.0,
            n_vocab: 0.0,
            ..p
        };
        let vocab = points()[0].n_vocab;
        let points: Vec<_> =
            points().into_iter().filter(|p| p.n_vocab == vocab).map(total).collect();
        let options = FitOptions { parameters: Parameters::Total, ..FitOptions::default() };
        let laws = fitted(&points, options);
        let text = summary(&laws) + &said(&[at(&laws, 1e17)], true);
        assert!(text.contains("N    in C") && !text.contains("N_nv"), "{text}");
        assert!(
            text.lines().any(|line| line.starts_with("N  ")) && !text.contains("shape"),
            "{text}"
        );
    }

    #[test]
    fn a_prediction_keeps_every_warning_and_says_how_far_it_lies() {
        for (laws, budget) in [(scamo(), 1e20), (fitted(&points(), FitOptions::default()), 1e18)] {
            let prediction = at(&laws, budget);
            let text = said(std::slice::from_ref(&prediction), true);
            fits(&text);
            fits(&said(std::slice::from_ref(&prediction), false));
            let bullets = text.lines().filter(|line| line.starts_with("  - ")).count();
            assert!(bullets > 0 && bullets == prediction.warnings.len(), "{text}");
            assert!(standing(&prediction).contains("times beyond the fit"));
        }
    }

    #[test]
    fn the_laws_together_are_told_beyond_the_fit() {
        let laws = committed("many-patches");
        let text = said(&[at(&laws, 1e14)], true).replace('\n', " ");
        assert!(text.contains("- The weighted mean of all laws (weights"), "{text}");
        fits(&said(&[at(&laws, 1e13), at(&laws, 1e14)], false));
    }

    #[test]
    fn a_model_of_any_size_is_told_in_eighty_columns() {
        let laws = fitted(&points(), FitOptions::default());
        let model =
            ModelSize { params: 1e7, n_vocab: Some(4096.0), params_vocab: None, tokens: 1e9 };
        let text = sized_text(&predict_sized(&laws, &model).unwrap());
        fits(&text);
        assert!(text.contains("N_nv = 1e7") && text.contains("V = 4096"), "{text}");
    }

    #[test]
    fn lines_are_as_wide_as_asked() {
        let sentence = "law ".repeat(60);
        for columns in [60, 120] {
            let widest = broken("- ", &sentence, columns).lines().map(str::len).max();
            assert!(widest.is_some_and(|widest| (columns - 4..=columns).contains(&widest)));
        }
    }

    #[test]
    fn sentences_break_before_the_last_column_and_keep_every_word() {
        let sentence = "word ".repeat(60);
        let text = wrap("  - ", &sentence);
        assert!(text.lines().all(|line| line.len() <= COLUMNS));
        assert!(text.lines().skip(1).all(|line| line.starts_with("    word")));
        assert_eq!(text.split_whitespace().filter(|word| *word == "word").count(), 60);
    }
}
