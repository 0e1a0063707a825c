//! [`Shown`]: clips as training shows them to either stage.

use std::f64::consts::FRAC_PI_2;

use rand_chacha::ChaCha8Rng;

use super::batch::Hidden;
use super::residual::batch::Asked;
use crate::data::Split;
use crate::generator::Inputs;
use crate::generator::autoregressive::Part;
use crate::learn::params::unit;
use crate::plan::RunSpec;
use crate::spec::{GeneratorSpec, MaskedSpec};

/// The training clips of a run.
pub struct Shown<'a> {
    spec: &'a RunSpec,
    inputs: &'a Inputs<'a>,
    /// The text of a caption that is left out.
    no_text: Vec<f32>,
}

impl<'a> Shown<'a> {
    /// Those that a run learns from.
    pub fn new(spec: &'a RunSpec, inputs: &'a Inputs<'a>) -> Self {
        Self { spec, inputs, no_text: vec![0.0; spec.shape().d_text] }
    }

    /// A clip for the first stage: codes of the whole clip are hidden, and those of the part at hand
    /// supervised, at least one.
    pub fn hidden(&self, part: &Part, rng: &mut ChaCha8Rng) -> Hidden<'_> {
        let (own, n_vocab) = (own(self.spec), self.spec.codes.scales[0].n_vocab);
        let codes = self.inputs.tokens.scale(Split::Train, part.clip, 0);
        let text = self.text(part, rng);
        let share = (FRAC_PI_2 * unit(rng)).cos();
        let n_hidden = ((share * codes.len() as f64).round() as usize).clamp(1, codes.len());
        let mut clip = Hidden::some(text, codes, n_hidden, n_vocab, rng);
        clip.targets.retain(|(place, _)| part.targets.contains(place));
        if clip.targets.is_empty() {
            let place = part.targets.start;
            clip.shown[place] = n_vocab as u32;
            clip.targets.push((place, codes[place]));
        }
        for (place, _) in clip.targets.clone() {
            if unit(rng) < own.corruption {
                clip.corrupt(place, n_vocab, rng);
            }
        }
        clip
    }

    /// A clip for the second stage, which is asked for a layer drawn as MoMask draws it.
    pub fn asked(&self, part: &Part, rng: &mut ChaCha8Rng) -> Asked<'_> {
        let codes = self.inputs.tokens.clip(Split::Train, part.clip);
        let text = self.text(part, rng);
        let layer = drawn_layer(self.spec.codes.scales.len(), unit(rng));
        Asked::of_clip(text, codes, self.spec.codes.scales.len(), layer, part.targets.clone())
    }

    /// A clip's caption, or none.
    fn text(&self, part: &Part, rng: &mut ChaCha8Rng) -> &[f32] {
        let text = self.inputs.text.embedding(part.caption);
        if unit(rng) < own(self.spec).text_drop { &self.no_text } else { text }
    }
}

/// The description of a run's generator, which is of this kind.
pub fn own(spec: &RunSpec) -> &MaskedSpec {
    match &spec.generator {
        GeneratorSpec::Masked(own) => own,
        other => unreachable!("a {} generator", other.name()),
    }
}

/// The layer that `u`, drawn evenly from 0 to 1, asks for, of `n_layers` counted from 0: 1 + (K − 2)
/// (1 − cos(π u / 2)), rounded. The first layers come more often, as in MoMask.
pub fn drawn_layer(n_layers: usize, u: f64) -> usize {
    let height = 1.0 - (FRAC_PI_2 * u).cos();
    1 + (height * (n_layers - 2) as f64).round() as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of six layers: acos(1 − (i + ½) / 4) of a quarter turn each.
    #[test]
    fn the_first_layers_are_asked_for_more_often() {
        let mut shares = [0.0f64; 6];
        (0..100_000).for_each(|i| shares[drawn_layer(6, (f64::from(i) + 0.5) / 1e5)] += 1e-5);
        let expected = [0.0, 0.3217, 0.2485, 0.1851, 0.1649, 0.0798];
        assert!(shares.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-4), "{shares:?}");
        assert!([0.0, 0.5, 0.999_999].map(|u| drawn_layer(2, u)) == [1; 3]);
    }
}
