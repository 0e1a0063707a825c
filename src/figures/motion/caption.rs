//! A caption as the lines of a title.

use crate::figures::font::{Weight, measure, wrap};
use crate::figures::scene::plain_text;
use crate::figures::scene::{Anchor, Point, Scene, Text};

/// `caption` on one line of plain text: characters that no SVG may hold are blanks.
pub fn cleaned(caption: &str) -> String {
    let plain =
        caption.replace(|c: char| c.is_control() || matches!(c, '\u{fffe}' | '\u{ffff}'), " ");
    plain.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// A cleaned caption in bold lines no wider than `width`; words that are wider are cut.
fn lines(caption: &str, em: f64, width: f64) -> Vec<String> {
    let words: Vec<String> =
        cleaned(caption).split(' ').flat_map(|word| pieces(word, em, width)).collect();
    wrap(&words.join(" "), Weight::Bold, em, width)
}

/// A word in pieces no wider than `width`.
fn pieces(word: &str, em: f64, width: f64) -> Vec<String> {
    let mut pieces = vec![String::new()];
    for letter in word.chars() {
        let last = pieces.len() - 1;
        let longer = format!("{}{letter}", pieces[last]);
        if pieces[last].is_empty() || measure(&longer, Weight::Bold, em) <= width {
            pieces[last] = longer;
        } else {
            pieces.push(letter.to_string());
        }
    }
    pieces
}

/// Writes a caption from `at` downwards; returns where it ends.
pub fn write(scene: &mut Scene, caption: &str, em: f64, (left, top): Point, width: f64) -> f64 {
    let mut y = top;
    for line in lines(caption, em, width) {
        y += 1.35 * em;
        let text = plain_text(&line, (left, y - 0.4 * em), Anchor::Start, em);
        scene.text(Text { weight: Weight::Bold, ..text });
    }
    y
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figures::svg::escaped;

    #[test]
    fn every_line_fits_even_of_a_word_that_does_not() {
        let caption = format!("a\tperson\nwalks {}", "o".repeat(200));
        let lines = lines(&caption, 14.0, 300.0);
        assert!(lines.len() > 3);
        assert!(lines.iter().all(|line| measure(line, Weight::Bold, 14.0) <= 300.0));
        assert_eq!(lines.concat().matches('o').count(), 201);
        assert!(lines[0].starts_with("a person walks"));
    }

    #[test]
    fn what_xml_reads_as_its_own_is_escaped() {
        assert_eq!(escaped(&cleaned("a <b> & \u{0}c")), "a &lt;b&gt; &amp; c");
    }
}
