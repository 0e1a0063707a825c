//! Transposing sixteen registers of sixteen.

use std::arch::x86_64::*;

use super::Wide;
use crate::ops::own::lanes::LANES;

/// Rows for columns: pairs of rows are merged to pairs, fours, eights and sixteens of columns.
///
/// # Safety
///
/// The processor must have AVX-512.
#[inline(always)]
pub unsafe fn transpose(rows: [Wide; LANES]) -> [Wide; LANES] {
    // SAFETY: the caller's promise.
    unsafe {
        let mut pairs = rows;
        for i in (0..LANES).step_by(2) {
            pairs[i].0 = _mm512_unpacklo_ps(rows[i].0, rows[i + 1].0);
            pairs[i + 1].0 = _mm512_unpackhi_ps(rows[i].0, rows[i + 1].0);
        }
        // Of each four rows and each quarter, its columns 0, 1, 2 and 3.
        let mut fours = pairs;
        for i in (0..LANES).step_by(4) {
            for (j, pair) in [i, i + 1].into_iter().enumerate() {
                let (a, b) = (_mm512_castps_pd(pairs[pair].0), _mm512_castps_pd(pairs[pair + 2].0));
                fours[i + 2 * j].0 = _mm512_castpd_ps(_mm512_unpacklo_pd(a, b));
                fours[i + 2 * j + 1].0 = _mm512_castpd_ps(_mm512_unpackhi_pd(a, b));
            }
        }
        let mut columns = fours;
        for j in 0..4 {
            let (a, b) = (fours[j].0, fours[j + 4].0);
            let (c, d) = (fours[j + 8].0, fours[j + 12].0);
            let even = [_mm512_shuffle_f32x4::<0x88>(a, b), _mm512_shuffle_f32x4::<0x88>(c, d)];
            let odd = [_mm512_shuffle_f32x4::<0xdd>(a, b), _mm512_shuffle_f32x4::<0xdd>(c, d)];
            columns[j].0 = _mm512_shuffle_f32x4::<0x88>(even[0], even[1]);
            columns[j + 4].0 = _mm512_shuffle_f32x4::<0x88>(odd[0], odd[1]);
            columns[j + 8].0 = _mm512_shuffle_f32x4::<0xdd>(even[0], even[1]);
            columns[j + 12].0 = _mm512_shuffle_f32x4::<0xdd>(odd[0], odd[1]);
        }
        columns
    }
}
