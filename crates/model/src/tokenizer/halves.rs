//! The two halves of a tokenizer, and their inputs other than features and latents.
//!
//! Shapes: b clips, t frames, f features, c latent channels; l latents of t frames, as many as
//! [`ArchitectureSpec::n_latents`](crate::spec::ArchitectureSpec::n_latents) says.

use burn::tensor::{Device, Tensor, TensorData};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::Rng;

/// Normalised features to latents.
pub trait Encode {
    /// `[b, t, f]` to `[b, l, c]`; t is a multiple of the stride.
    fn forward(&self, x_btf: Tensor<3>, pass: &mut Pass) -> Tensor<3>;

    /// Begins from patches, `[n, s·f]`.
    fn begin(&mut self, _patches_np: &Tensor<2>) {}
}

/// Latents to normalised features.
pub trait Decode {
    /// `[b, l, c]` to the `n_frames` frames that had these latents, `[b, t, f]`.
    fn forward(&self, latents_blc: Tensor<3>, n_frames: usize, pass: &mut Pass) -> Tensor<3>;

    /// Begins from the latents of patches, `[n, c]`.
    fn begin(&mut self, _latents_nc: &Tensor<2>, _patches_np: &Tensor<2>) {}
}

/// Has an enum stand for whichever part it holds, by the trait that all of them have.
macro_rules! stands_for {
    ($any:ident, $part:ident: $($kind:ident),*) => {
        impl std::ops::Deref for $any {
            type Target = dyn $part;

            fn deref(&self) -> &Self::Target {
                match self {
                    $(Self::$kind(part) => part,)*
                }
            }
        }

        impl std::ops::DerefMut for $any {
            fn deref_mut(&mut self) -> &mut Self::Target {
                match self {
                    $(Self::$kind(part) => part,)*
                }
            }
        }
    };
}
pub(super) use stands_for;

/// The inputs of a pass other than features and latents.
#[derive(Default)]
pub struct Pass<'a> {
    /// The clips' captions, where the tokenizer has language.
    pub captions: Option<&'a Captions>,
    /// Draws what is dropped; `None` if nothing is, as outside training.
    pub noise: Option<ChaCha8Rng>,
}

impl<'a> Pass<'a> {
    /// A pass outside training.
    pub fn reading(captions: Option<&'a Captions>) -> Self {
        Self { captions, noise: None }
    }

    /// Each value 0 with probability `rate`, else larger by 1 / (1 − rate) (Srivastava et al. 2014); as
    /// it is outside training.
    pub fn drop<const D: usize>(&mut self, x: Tensor<D>, rate: f64) -> Tensor<D> {
        let Some(noise) = self.noise.as_mut().filter(|_| rate > 0.0) else { return x };
        let mut drawn = vec![0; 2 * x.shape().num_elements()];
        noise.fill_bytes(&mut drawn);
        let (least, kept) = (rate * f64::from(1u32 << 16), (1.0 / (1.0 - rate)) as f32);
        let value = |pair: &[u8]| {
            let drawn = u16::from_le_bytes([pair[0], pair[1]]);
            if f64::from(drawn) < least { 0.0 } else { kept }
        };
        let factors: Vec<f32> = drawn.chunks_exact(2).map(value).collect();
        let factors = Tensor::from_data(TensorData::new(factors, x.dims()), &x.device());
        x * factors
    }
}

/// One caption a clip, word after word; a clip without words has lost its caption.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Captions {
    /// `[words of all clips, dim]`, row-major.
    vectors: Vec<f32>,
    /// Words of each clip's caption.
    words: Vec<usize>,
    /// For each latent of a clip, whether the frames in its span read the caption in decoding; empty if all do.
    read_by: Vec<bool>,
}

impl Captions {
    /// The captions of clips, each `[words, dim]` row-major.
    pub fn of<'a>(captions: impl IntoIterator<Item = &'a [f32]>, dim: usize) -> Self {
        let mut all = Self::default();
        for caption in captions {
            all.vectors.extend_from_slice(caption);
            all.words.push(caption.len() / dim);
        }
        all
    }

    /// As many clips, none of which has a caption.
    pub fn none(n_clips: usize) -> Self {
        Self { words: vec![0; n_clips], ..Self::default() }
    }

    /// The same, read in decoding by the frames of these latents of each clip alone (LG-Tok Eq. 7).
    #[must_use]
    pub fn read_by(self, latents: &[bool]) -> Self {
        Self { read_by: latents.to_vec(), ..self }
    }

    /// Whether the frames of a latent read the caption.
    pub fn is_read_by(&self, latent: usize) -> bool {
        self.read_by.get(latent).is_none_or(|reads| *reads)
    }

    /// Words of each clip's caption.
    pub fn words(&self) -> &[usize] {
        &self.words
    }

    /// All vectors, `[words of all clips, dim]`; `None` if no clip has a caption.
    pub fn tensor(&self, device: &Device) -> Option<Tensor<2>> {
        let n: usize = self.words.iter().sum();
        let data = |n| TensorData::new(self.vectors.clone(), [n, self.vectors.len() / n]);
        (n > 0).then(|| Tensor::from_data(data(n), device))
    }
}

/// The values of a tensor, row-major.
pub fn host<const D: usize>(tensor: Tensor<D>) -> Vec<f32> {
    tensor.into_data().try_into_vec().expect("values are f32")
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_chacha::rand_core::SeedableRng;

    fn dropped(pass: &mut Pass, rate: f64) -> Vec<f32> {
        let ones = Tensor::<2>::ones([50, 40], &Device::flex());
        pass.drop(ones, rate).into_data().try_into_vec().unwrap()
    }

    #[test]
    fn what_is_dropped_follows_from_the_stream_and_keeps_the_mean() {
        let pass = || Pass { captions: None, noise: Some(ChaCha8Rng::seed_from_u64(3)) };
        let first = dropped(&mut pass(), 0.25);
        assert_eq!(first, dropped(&mut pass(), 0.25));
        let share = first.iter().filter(|x| **x == 0.0).count() as f64 / 2000.0;
        assert!((share - 0.25).abs() < 0.04, "{share}");
        assert!(first.iter().all(|x| *x == 0.0 || (x - 4.0 / 3.0).abs() < 1e-6));
    }

    #[test]
    fn nothing_is_dropped_outside_training_or_at_rate_0() {
        let noise = Some(ChaCha8Rng::seed_from_u64(3));
        for (mut pass, rate) in [(Pass::default(), 0.5), (Pass { captions: None, noise }, 0.0)] {
            assert!(dropped(&mut pass, rate).iter().all(|x| *x == 1.0));
        }
    }

    #[test]
    fn a_batch_of_data_is_row_major() {
        let data = TensorData::new(vec![1.0f32; 6], [1, 6]);
        let caption: Vec<f32> = data.try_into_vec().unwrap();
        let captions = Captions::of([&caption[..], &[]], 6);
        assert_eq!(captions.words(), [1, 0]);
        assert_eq!(captions.tensor(&Device::flex()).unwrap().dims(), [1, 6]);
        assert!(Captions::none(3).tensor(&Device::flex()).is_none());
    }
}
