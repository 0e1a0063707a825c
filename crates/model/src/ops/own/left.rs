//! [`Left`]: the left operand of a product.

/// The left operand of a product: a matrix, or the transpose of one.
#[derive(Clone, Copy)]
pub struct Left<'a, const TRANSPOSED: bool> {
    values: &'a [f32],
    stride: usize,
}

impl<'a, const TRANSPOSED: bool> Left<'a, TRANSPOSED> {
    /// A matrix of rows `stride` elements apart, or its transpose.
    #[inline(always)]
    pub fn new(values: &'a [f32], stride: usize) -> Self {
        Self { values, stride }
    }

    /// The operand from row `i` on.
    #[inline(always)]
    pub fn skip_rows(self, i: usize) -> Self {
        Self { values: &self.values[self.place(i, 0)..], ..self }
    }

    #[inline(always)]
    fn place(&self, row: usize, inner: usize) -> usize {
        if TRANSPOSED { inner * self.stride + row } else { row * self.stride + inner }
    }

    /// Sees that there are so many rows and inner elements, which [`Left::at`] relies on.
    #[inline(always)]
    pub fn check(&self, rows: usize, inner: usize) {
        let last = self.place(rows.max(1) - 1, inner.max(1) - 1);
        assert!(last < self.values.len(), "a product reads beyond its left operand");
    }

    /// # Safety
    ///
    /// There must be such a row and inner element: see [`Left::check`].
    #[inline(always)]
    pub unsafe fn at(&self, row: usize, inner: usize) -> f32 {
        // SAFETY: the caller's promise.
        unsafe { *self.values.get_unchecked(self.place(row, inner)) }
    }
}
