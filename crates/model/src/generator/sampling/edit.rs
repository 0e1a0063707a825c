//! [`Edit`]: a clip of which a part is made anew.

/// A clip of which a part is made anew and the rest stays (MoSa and LG-Tok; MoMask).
///
/// The codes of each scale that lie in the part are drawn, given all those that stay.
#[derive(Clone, Copy, Debug)]
pub struct Edit<'a> {
    /// The clip's codes, scale after scale.
    pub codes: &'a [u32],
    /// Of each of its latents, whether it is made anew.
    pub anew: &'a [bool],
}

impl Edit<'_> {
    /// Of each of `n` codes of a scale that stands behind `before` codes, the code where it stays.
    pub fn kept(&self, before: usize, n: usize) -> Vec<Option<u32>> {
        let codes = &self.codes[before..before + n];
        self.places(n).into_iter().zip(codes).map(|(anew, &code)| (!anew).then_some(code)).collect()
    }

    /// Of each of `n` codes that span the clip, whether it is made anew: the mask is resized linearly,
    /// corners not aligned, and what is above one half is made anew (MoSa).
    fn places(&self, n: usize) -> Vec<bool> {
        let (len, last) = (self.anew.len(), self.anew.len() - 1);
        let at = |place: usize| {
            let x = (place as f64 + 0.5) * len as f64 / n as f64 - 0.5;
            let below = x.max(0.0).floor() as usize;
            let share = (x - below as f64).max(0.0);
            let value = |i: usize| f64::from(u8::from(self.anew[i.min(last)]));
            (1.0 - share) * value(below) + share * value(below + 1) > 0.5
        };
        (0..n).map(at).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn places(anew: &[u8], n: usize) -> Vec<u8> {
        let anew: Vec<bool> = anew.iter().map(|&x| x == 1).collect();
        Edit { codes: &[], anew: &anew }.places(n).into_iter().map(u8::from).collect()
    }

    /// As `torch.nn.functional.interpolate(mode="linear") > 0.5`: three of 0 0 1 1 1 1 lie at 0.5,
    /// 2.5 and 4.5, that is at 0, 1 and 1.
    #[test]
    fn masks_are_resized_linearly() {
        assert_eq!(places(&[0, 0, 1, 1, 1, 1], 3), [0, 1, 1]);
        assert_eq!(places(&[0, 1, 1, 0], 4), [0, 1, 1, 0]);
        // Two lie at 0.5 and 2.5, between a latent that stays and one that is made anew: at one half.
        assert_eq!(places(&[0, 1, 1, 0], 2), [0, 0]);
        assert_eq!(places(&[0, 1, 1, 1, 0], 1), [1]);
        // Six lie at 0, 0.25, 0.75, 1.25, 1.75 and 2 of three.
        assert_eq!(places(&[0, 1, 0], 6), [0, 0, 1, 1, 0, 0]);
        assert_eq!(places(&[1, 1], 5), [1; 5]);
        assert_eq!(places(&[0, 0], 5), [0; 5]);
    }
}
