//! [`Captions`]: the captions of a batch's clips, as vectors of their words.

use burn::tensor::{Device, Tensor, TensorData};

/// One caption a clip, word after word; a clip without words has lost its caption.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Captions {
    /// `[words of all clips, dim]`, row-major.
    vectors: Vec<f32>,
    /// Words of each clip's caption.
    words: Vec<usize>,
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
        Self { vectors: Vec::new(), words: vec![0; n_clips] }
    }

    /// Words of each clip's caption.
    pub fn words(&self) -> &[usize] {
        &self.words
    }

    /// All vectors, `[words of all clips, dim]`; `None` where no clip has a caption.
    pub fn tensor(&self, device: &Device) -> Option<Tensor<2>> {
        let n: usize = self.words.iter().sum();
        let data = |n| TensorData::new(self.vectors.clone(), [n, self.vectors.len() / n]);
        (n > 0).then(|| Tensor::from_data(data(n), device))
    }
}
