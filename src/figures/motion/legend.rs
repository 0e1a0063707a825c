//! Which colour is which side of the body.

use crate::figures::colour::{LEFT_SIDE, RIGHT_SIDE};
use crate::figures::font::{Weight, measure};
use crate::figures::scene::plain_text;
use crate::figures::scene::{Anchor, Point, Scene, Text};

/// Page pixels between the words.
const GAP: f64 = 16.0;

/// Writes "left side" and "right side" in their colours, from `at` to the right.
pub fn sides(scene: &mut Scene, (mut x, y): Point, em: f64) {
    for (content, colour) in [("left side", LEFT_SIDE), ("right side", RIGHT_SIDE)] {
        let text = plain_text(content, (x, y), Anchor::Start, em);
        scene.text(Text { colour, weight: Weight::Bold, ..text });
        x += measure(content, Weight::Bold, em) + GAP;
    }
}
