//! [`Sight`]: how much of the keys of a head its queries see.

use std::ops::Range;

use crate::ops::own::scratch::ROWS;

/// The queries and keys of one head, each query seeing the keys up to some place.
pub trait Sight {
    /// Features of the head.
    fn head_dim(&self) -> usize;

    /// Rows that see.
    fn n_queries(&self) -> usize;

    /// Rows that are seen.
    fn n_keys(&self) -> usize;

    /// How many keys, from the first on, query `q` sees: no fewer than the query before it.
    fn visible(&self, q: usize) -> usize;

    /// The first query that sees key `k`.
    fn first_viewer(&self, k: usize) -> usize;

    /// 1 / √head_dim.
    #[inline(always)]
    fn scale(&self) -> f32 {
        (1.0 / (self.head_dim() as f64).sqrt()) as f32
    }

    /// Queries of the tile that starts at `first`.
    #[inline(always)]
    fn rows(&self, first: usize) -> Range<usize> {
        first..(first + ROWS).min(self.n_queries())
    }

    /// How many keys each of them sees; rows after the last as many as it.
    #[inline(always)]
    fn visible_by_row(&self, first: usize) -> [usize; ROWS] {
        std::array::from_fn(|r| self.visible((first + r).min(self.n_queries() - 1)))
    }

    /// Most keys seen by a query of the tile that starts at `first`: those of its last.
    #[inline(always)]
    fn visible_in_tile(&self, first: usize) -> usize {
        self.visible(self.rows(first).end - 1)
    }
}
