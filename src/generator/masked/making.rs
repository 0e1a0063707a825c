//! [`Making`]: a motion that is being made, and guidance away from what has no text.

use rand_chacha::ChaCha8Rng;

use crate::generator::Edit;

/// A motion that is being made.
pub struct Making<'a> {
    pub text: &'a [f32],
    pub rng: ChaCha8Rng,
    /// Its codes, layer after layer; in the first the end token's id stands for a hidden one.
    pub codes: Vec<u32>,
    /// Places: codes of a layer.
    pub n_places: usize,
    pub n_frames: usize,
    /// What stays of it, where a part is made anew.
    pub edit: Option<Edit<'a>>,
}

impl Making<'_> {
    /// Of each place of a layer its code, where it stays.
    pub fn kept(&self, layer: usize) -> Vec<Option<u32>> {
        let Some(edit) = self.edit else { return vec![None; self.n_places] };
        let codes = &edit.codes[layer * self.n_places..][..self.n_places];
        let places = edit.places(self.n_places).into_iter().zip(codes);
        places.map(|(anew, &code)| (!anew).then_some(code)).collect()
    }
}

/// A row of logits a place, from those with text; where motions are guided, moved away from those
/// without, by (1 + s) with − s without.
pub fn guided<'a>(
    pass: impl Fn(Option<&'a [f32]>) -> Vec<Vec<f32>>,
    no_text: &'a [f32],
    strength: f64,
) -> Vec<Vec<f32>> {
    let mut rows = pass(None);
    if strength == 0.0 {
        return rows;
    }
    for (row, without) in rows.iter_mut().zip(pass(Some(no_text))) {
        row.iter_mut().zip(without).for_each(|(x, free)| *x += strength as f32 * (*x - free));
    }
    rows
}
