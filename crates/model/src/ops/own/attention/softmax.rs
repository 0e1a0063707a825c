//! Softmax over the rows of one tile: pass by pass over all of them, so that no row waits for
//! another's sum.

use crate::ops::own::lanes::{LANES, Lanes};
use crate::ops::own::maths::{dot, exp, max};
use crate::ops::own::scratch::{ROWS, Scratch};

/// The rows of a tile within a matrix of scores, and how many positions each of them sees.
#[derive(Clone, Copy)]
pub struct Tile {
    /// Its first row.
    pub first: usize,
    /// Rising; the last is what the tile sees.
    pub visible: [usize; ROWS],
}

/// What turns the scores of a tile's rows into weights: e^(score − largest) · inverse.
#[derive(Clone, Copy)]
pub struct Statistics {
    largest: [f32; ROWS],
    inverse: [f32; ROWS],
}

impl Statistics {
    /// Numbers that are kept for each row.
    pub const PER_ROW: usize = 2;

    /// Puts those of the first `rows` rows to the front of `room`, which moves on.
    #[inline(always)]
    pub fn keep(self, rows: usize, room: &mut &mut [f32]) {
        for values in [self.largest, self.inverse] {
            let (kept, rest) = std::mem::take(room).split_at_mut(rows);
            kept.copy_from_slice(&values[..rows]);
            *room = rest;
        }
    }

    /// Takes those of the first `rows` rows from the front of `kept`; other rows get zeros.
    #[inline(always)]
    pub fn take(rows: usize, kept: &mut &[f32]) -> Self {
        let [mut largest, mut inverse] = [[0.0; ROWS]; 2];
        for values in [&mut largest, &mut inverse] {
            let (from, rest) = kept.split_at(rows);
            values[..rows].copy_from_slice(from);
            *kept = rest;
        }
        Self { largest, inverse }
    }
}

impl Tile {
    /// Zeros from the vector that a row is cut in to the one that the tile's last row is cut in: none,
    /// but where a tile holds rows of several blocks.
    #[inline(always)]
    fn clear_rest(self, matrix: &mut Scratch) {
        let end = self.visible[ROWS - 1].next_multiple_of(LANES);
        for (row, visible) in matrix.rows_mut(self.first).zip(self.visible) {
            row[visible.next_multiple_of(LANES)..end].fill(0.0);
        }
    }

    /// The tile's rows of `matrix`, cut to whole vectors, and how many positions each sees.
    #[inline(always)]
    fn rows(self, matrix: &mut Scratch) -> impl Iterator<Item = (&mut [[f32; LANES]], usize)> {
        matrix.rows_mut(self.first).zip(self.visible).map(|(row, visible)| {
            (row[..visible.next_multiple_of(LANES)].as_chunks_mut().0, visible)
        })
    }
}

/// Turns scores into weights, with zeros to the end of their last vector.
#[inline(always)]
pub fn forward<L: Lanes>(scores: &mut Scratch, tile: Tile) -> Statistics {
    let [mut largest, mut inverse] = [[0.0; ROWS]; 2];
    for ((row, visible), largest) in tile.rows(scores).zip(&mut largest) {
        *largest = max::<L>(&row.as_flattened()[..visible]);
    }
    for (((row, visible), largest), inverse) in tile.rows(scores).zip(largest).zip(&mut inverse) {
        *inverse = 1.0 / powers::<L>(row, visible, largest, 1.0);
    }
    for ((row, _), inverse) in tile.rows(scores).zip(inverse) {
        for x in row {
            L::load(x).mul(L::splat(inverse)).store(x);
        }
    }
    tile.clear_rest(scores);
    Statistics { largest, inverse }
}

/// As [`forward`], to the same bits, where the statistics are known.
#[inline(always)]
pub fn again<L: Lanes>(scores: &mut Scratch, tile: Tile, statistics: Statistics) {
    let Statistics { largest, inverse } = statistics;
    for (((row, visible), largest), inverse) in tile.rows(scores).zip(largest).zip(inverse) {
        powers::<L>(row, visible, largest, inverse);
    }
    tile.clear_rest(scores);
}

/// Turns the first `visible` scores of a row into factor · e^(score − largest), what is left of it
/// into zeros; gives the sum of the powers.
#[inline(always)]
fn powers<L: Lanes>(row: &mut [[f32; LANES]], visible: usize, largest: f32, factor: f32) -> f32 {
    let (largest, factor) = (L::splat(largest), L::splat(factor));
    let mut sum = L::splat(0.0);
    let Some((last, whole)) = row.split_last_mut() else { return 0.0 };
    let left = visible - whole.len() * LANES;
    for x in whole {
        let power = exp(L::load(x).sub(largest));
        sum = sum.add(power);
        power.mul(factor).store(x);
    }
    let power = exp(L::load(last).sub(largest)).first(left, L::splat(0.0));
    power.mul(factor).store(last);
    sum.add(power).sum()
}

/// Turns gradients by weights into gradients by scores: wᵢ (gᵢ − Σⱼ wⱼ gⱼ).
#[inline(always)]
pub fn backward<L: Lanes>(gradient: &mut Scratch, weights: &Scratch, tile: Tile) {
    let mut means = [0.0; ROWS];
    let weights = || (tile.first..).map(|row| weights.row(row));
    for (((row, visible), weights), mean) in tile.rows(gradient).zip(weights()).zip(&mut means) {
        *mean = dot::<L>(&row.as_flattened()[..visible], weights);
    }
    for (((row, visible), weights), mean) in tile.rows(gradient).zip(weights()).zip(means) {
        let Some((last, whole)) = row.split_last_mut() else { return };
        let (left, mean) = (visible - whole.len() * LANES, L::splat(mean));
        let weights = &weights.as_chunks().0[..=whole.len()];
        for (x, weight) in whole.iter_mut().zip(weights) {
            L::load(x).sub(mean).mul(L::load(weight)).store(x);
        }
        let by_score = L::load(last).sub(mean).mul(L::load(&weights[whole.len()]));
        by_score.first(left, L::splat(0.0)).store(last);
    }
    tile.clear_rest(gradient);
}
