//! [`DataFacts`]: what a plan needs to know of a data set.

use super::source::{FRAMES_PER_TOKEN, MotionSource, Split};

/// What a plan needs to know of a data set.
#[derive(Clone, Debug, PartialEq)]
pub struct DataFacts {
    /// Content of the data; `absent` where there is none yet, so that ids are provisional.
    pub digest: String,
    /// Supervised tokens of the training split, an end token a clip; of a very large split an
    /// estimate.
    pub unique_tokens: usize,
    /// Clips to train on, to validate on and to test on.
    pub clips: [usize; 3],
    pub fps: f64,
    /// Content of the file that the captions' vectors come from, where they come from one; `absent`
    /// where it is not here.
    pub embeddings: Option<String>,
    pub warnings: Vec<String>,
}

impl DataFacts {
    /// Looks at a source.
    pub fn of(source: &dyn MotionSource) -> Self {
        Self {
            digest: source.digest().to_string(),
            unique_tokens: unique_tokens(source),
            clips: Split::ALL.map(|split| source.n_clips(split)),
            fps: f64::from(source.fps()),
            embeddings: None,
            warnings: source.warnings().to_vec(),
        }
    }

    /// Stands in for data that is not here, so that a sweep can still be priced.
    pub fn absent(reason: String) -> Self {
        Self {
            digest: "absent".to_string(),
            unique_tokens: 0,
            clips: [0; 3],
            fps: 20.0,
            embeddings: None,
            warnings: vec![format!("{reason}; ids and epochs are provisional")],
        }
    }

    /// The same without the file that the captions' vectors should come from.
    pub fn without_embeddings(mut self, reason: String) -> Self {
        self.embeddings = Some("absent".to_string());
        self.warnings.push(format!("{reason}; ids are provisional"));
        self
    }
}

/// Clips that are counted one by one; larger splits are estimated from as many.
const COUNTED: usize = 1 << 18;

/// A generated clip must be sketched to know its length: a hundred million would take minutes.
fn unique_tokens(source: &dyn MotionSource) -> usize {
    let n_train = source.n_clips(Split::Train);
    let n_counted = n_train.min(COUNTED);
    let tokens = |i| source.n_frames(Split::Train, i) / FRAMES_PER_TOKEN + 1;
    let counted: usize = (0..n_counted).map(tokens).sum();
    if n_counted == n_train {
        counted
    } else {
        (counted as f64 / n_counted as f64 * n_train as f64) as usize
    }
}
