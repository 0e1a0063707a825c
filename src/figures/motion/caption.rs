//! Text on the pages of motions: a caption as a title, facts, and the colours of the sides.

use super::room::{length, path};
use crate::figures::colour::{LEFT_SIDE, RIGHT_SIDE};
use crate::figures::font::{Weight, measure, wrap};
use crate::figures::scene::{Anchor, Point, Scene, plain_text};
use crate::motion::Pose;

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
    let mut pieces: Vec<String> = Vec::new();
    for letter in word.chars() {
        let fits = |piece: &String| measure(&format!("{piece}{letter}"), Weight::Bold, em) <= width;
        match pieces.last_mut() {
            Some(piece) if fits(piece) => piece.push(letter),
            _ => pieces.push(letter.to_string()),
        }
    }
    pieces
}

/// Writes a caption from `at` downwards; returns its lower end.
pub fn write(scene: &mut Scene, caption: &str, em: f64, at: Point, width: f64) -> f64 {
    let text = plain_text("", at, Anchor::Start, em).bold();
    scene.lines(lines(caption, em, width), 1.35 * em, &text)
}

/// The facts of a motion: "6.4 s, 20 frames per second, path 4.2 m".
pub fn facts(poses: &[Pose], fps: f32) -> String {
    let seconds = poses.len() as f64 / f64::from(fps);
    let metres = length(&path(poses));
    format!("{seconds:.1} s, {fps} frames a second, path {metres:.1} m")
}

/// Writes "left side" and "right side" in their colours, from `at` to the right.
pub fn sides(scene: &mut Scene, (mut x, y): Point, em: f64) {
    for (content, colour) in [("left side", LEFT_SIDE), ("right side", RIGHT_SIDE)] {
        scene.text(plain_text(content, (x, y), Anchor::Start, em).bold().coloured(colour));
        x += measure(content, Weight::Bold, em) + 16.0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figures::formats::escaped;

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
