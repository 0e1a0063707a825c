//! The nearest code of each latent, a block of codes by a chunk of latents at a time.
//!
//! No matrix of distances exists: a block of products is looked through while it is in the cache.

use super::buffers::Buffer;
use super::lanes::{LANES, vectorised};
use super::matmul::{Panels, Target, View, multiply};

/// Latents of a chunk.
const CHUNK: usize = 512;

/// Codes of a block.
const BLOCK: usize = 128;

/// The best code so far of each latent of a chunk.
struct Best {
    /// latent · code − |code|² / 2.
    value: Vec<f32>,
    id: Vec<u32>,
}

/// argmax over codes `[v, c]` of latent · code − |code|² / 2 for each latent `[n, c]`, the first of equals.
pub fn nearest(latents: &[f32], codes: &[f32], c: usize) -> Vec<u32> {
    let square = |code: &[f32]| code.iter().fold(0.0, |sum, x| sum + x * x);
    let halves: Vec<f32> = codes.chunks_exact(c).map(|code| square(code) / 2.0).collect();
    let mut panels = Panels::default();
    let mut products = Buffer::new(BLOCK * CHUNK);
    let mut ids = Vec::with_capacity(latents.len() / c);
    for latents in latents.chunks(CHUNK * c) {
        let n = latents.len() / c;
        let stride = n.next_multiple_of(LANES);
        // Of one channel the latents are the row that the transposed matrix has.
        let columns =
            if c == 1 { View::new(latents, n) } else { View::new(latents, c).transposed() };
        panels.pack(columns, c, n);
        let mut best = Best { value: vec![f32::MIN; stride], id: vec![0; stride] };
        for (block, halves) in halves.chunks(BLOCK).enumerate() {
            let codes = View::new(codes, c).skip_rows(block * BLOCK);
            let products = &mut products[..halves.len() * stride];
            multiply(Target::new(products, stride), halves.len(), codes, &panels, false);
            take_block(products, (block * BLOCK) as u32, halves, &mut best);
        }
        ids.extend(&best.id[..n]);
    }
    ids
}

vectorised! {
    /// Looks through the products of a block of codes, rows of one latent a column.
    fn take_block(products: &[f32], first: u32, halves: &[f32], best: &mut Best) {
        let stride = best.value.len();
        for (at, so_far) in best.value.as_chunks_mut::<LANES>().0.iter_mut().enumerate() {
            let at = at * LANES;
            let (before, mut largest) = (*so_far, L::load(so_far));
            for (row, &half) in products.chunks_exact(stride).zip(halves) {
                let value = L::read(&row[at..at + LANES]).sub(L::splat(half));
                largest = value.max(largest);
            }
            largest.store(so_far);
            for (lane, (before, now)) in before.iter().zip(so_far.iter()).enumerate() {
                if now > before {
                    best.id[at + lane] = first + place(&products[at + lane..], stride, halves, *now);
                }
            }
        }
    }
}

/// The first code of a block whose value is this one.
fn place(products: &[f32], stride: usize, halves: &[f32], value: f32) -> u32 {
    let mut values = products.iter().step_by(stride).zip(halves).map(|(x, half)| x - half);
    values.position(|x| x == value).expect("it was met") as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_of_equals_is_taken_in_every_block_and_lane() {
        // Codes 1, 2, …, then the same again; latents between them.
        let n_codes = 3 * BLOCK + 5;
        let codes: Vec<f32> = (0..2 * n_codes).map(|i| (i % n_codes) as f32).collect();
        let latents: Vec<f32> = (0..CHUNK + 37).map(|i| (i % n_codes) as f32 + 0.25).collect();
        let ids = nearest(&latents, &codes, 1);
        let expected: Vec<u32> = (0..CHUNK + 37).map(|i| (i % n_codes) as u32).collect();
        assert_eq!(ids, expected);
    }

    #[test]
    fn a_latent_that_is_no_number_takes_the_first_code() {
        assert_eq!(nearest(&[f32::NAN, 2.0], &[1.0, 2.0, 3.0], 1), [0, 1]);
    }
}
