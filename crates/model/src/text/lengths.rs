//! [`LengthEstimator`]: how long a motion is, from its caption (MoMask's length estimator).
//!
//! A classifier of one hidden layer over the mean of a caption's vectors. Its classes are the lengths from the shortest
//! training clip to the longest, in steps of four frames, or of more beyond 64 classes. It is trained with the captions
//! of the training split and kept in their file: columns `lengths.classes`, `lengths.hidden` and `lengths.output`.

use std::path::Path;

use rand_chacha::ChaCha8Rng;

use crate::draws::{below, stream, unit, weighted};
use crate::files::FileError;
use crate::files::columns::{ColumnFile, NewColumn};
use crate::progress::moved;

/// Units of the hidden layer.
const N_HIDDEN: usize = 64;

/// Classes at most: 49 for HumanML3D's clips of at most 196 frames, four frames each.
const MOST_CLASSES: usize = 64;

/// Neighbours on either side that share a class's target, by falling weights: 1, 2, 3, 2, 1 over 9.
const SHARED: usize = 2;

/// AdamW's steps, captions a step, its rate, which falls to 0 along a line, and its decay, without which an estimator of
/// few clips is surer than its held-out likelihood allows.
const STEPS: usize = 1000;
const BATCH: usize = 64;
const RATE: f32 = 3e-3;
const DECAY: f32 = 1.0;

const HIDDEN: &str = "lengths.hidden";
const OUTPUT: &str = "lengths.output";
const CLASSES: &str = "lengths.classes";

/// A trained estimator.
#[derive(Clone, Debug, PartialEq)]
pub struct LengthEstimator {
    /// Frames of a step, a multiple of 4, and steps of the first class: class i stands for (first + i) · unit frames.
    classes: [u32; 2],
    /// `[N_HIDDEN, dim + 1]` row-major; the last number of a row is its bias.
    hidden: Vec<f32>,
    /// `[n_classes, N_HIDDEN + 1]`, likewise.
    output: Vec<f32>,
}

/// A clip of the training split: its frames, and its captions by id, at least one.
pub type ClipCaptions<'a> = (usize, &'a [u32]);

impl LengthEstimator {
    /// Trains on clips, at least one; `vectors` gives a caption's, `[n_words, dim]` row-major. A step draws clips, and a
    /// caption of each.
    pub fn train<'a>(
        dim: usize,
        clips: &[ClipCaptions],
        vectors: impl Fn(u32) -> &'a [f32],
    ) -> Self {
        let n_captions = 1 + clips.iter().flat_map(|(_, captions)| *captions).max().unwrap_or(&0);
        let mean = |caption| mean_of(vectors(caption), dim);
        let means: Vec<f32> = (0..n_captions).flat_map(mean).collect();
        let longest = clips.iter().map(|(frames, _)| *frames).max().unwrap_or(0);
        let unit = 4 * longest.div_ceil(4 * MOST_CLASSES).max(1);
        let steps = |frames: usize| (frames / unit).max(1);
        let first = clips.iter().map(|(frames, _)| steps(*frames)).min().unwrap_or(1);
        let n_classes = steps(longest) - first + 1;
        let (centre, scale) = moments(&means, dim);
        let mut rng = stream(0, 0);
        let mut hidden = Trained::new(N_HIDDEN, dim, &mut rng);
        let mut output = Trained::zeros(n_classes, N_HIDDEN);
        for step in 0..STEPS {
            moved();
            for _ in 0..BATCH {
                let (frames, captions) = clips[below(&mut rng, clips.len())];
                let row = captions[below(&mut rng, captions.len())] as usize * dim;
                let mean = means[row..row + dim].iter().zip(centre.iter().zip(&scale));
                let x: Vec<f32> = mean.map(|(x, (centre, scale))| (x - centre) * scale).collect();
                let h = relu(rows(&hidden.weights, &x));
                let mut error = softmax(rows(&output.weights, &h));
                subtract_target(&mut error, steps(frames) - first);
                let mut error_h = output.add_gradient(&h, &error);
                error_h.iter_mut().zip(&h).filter(|(_, h)| **h == 0.0).for_each(|(e, _)| *e = 0.0);
                hidden.add_gradient(&x, &error_h);
            }
            let rate = RATE * (1.0 - step as f32 / STEPS as f32);
            hidden.step(rate, step);
            output.step(rate, step);
        }
        let hidden = of_raw_inputs(hidden.weights, &centre, &scale);
        Self { classes: [unit as u32, first as u32], hidden, output: output.weights }
    }

    /// The columns of its file.
    pub fn columns(&self) -> [NewColumn<'_>; 3] {
        let classes = NewColumn::new(CLASSES, &self.classes);
        [classes, NewColumn::new(HIDDEN, &self.hidden), NewColumn::new(OUTPUT, &self.output)]
    }

    /// Reads it from the file of a data set's captions.
    ///
    /// # Errors
    /// [`FileError::Read`] and [`FileError::Damaged`]: a file of an older version has no estimator.
    pub fn open(path: &Path) -> Result<Self, FileError> {
        let file = ColumnFile::open(path)?;
        let column = |name| Ok::<_, FileError>(file.column::<f32>(name)?.values().to_vec());
        let classes = file.column::<u32>(CLASSES)?.values().try_into();
        let classes = classes.map_err(|_| file.damaged("its length estimator has no classes"))?;
        let own = Self { classes, hidden: column(HIDDEN)?, output: column(OUTPUT)? };
        let dim = file.number("dim")?;
        let is_sound = classes.iter().all(|n| (1..1 << 20).contains(n))
            && (1..1 << 20).contains(&dim)
            && own.hidden.len() == N_HIDDEN * (dim + 1)
            && !own.output.is_empty()
            && own.output.len().is_multiple_of(N_HIDDEN + 1);
        if is_sound { Ok(own) } else { Err(file.damaged("its length estimator is cut")) }
    }

    /// The probability of each class for a caption's vectors, `[n_words, dim]` row-major.
    pub fn probabilities(&self, vectors: &[f32]) -> Vec<f32> {
        let mean = mean_of(vectors, self.hidden.len() / N_HIDDEN - 1);
        softmax(rows(&self.output, &relu(rows(&self.hidden, &mean))))
    }

    /// A length in frames, drawn from these probabilities as in MoMask.
    pub fn draw(&self, vectors: &[f32], rng: &mut ChaCha8Rng) -> usize {
        let [unit, first] = self.classes.map(|n| n as usize);
        let probabilities = self.probabilities(vectors);
        (first + weighted(probabilities.iter().map(|&p| f64::from(p)), rng)) * unit
    }
}

/// The mean of a caption's vectors.
fn mean_of(vectors: &[f32], dim: usize) -> Vec<f32> {
    let n = (vectors.len() / dim).max(1) as f32;
    let mut mean = vec![0.0; dim];
    for vector in vectors.chunks_exact(dim) {
        mean.iter_mut().zip(vector).for_each(|(mean, x)| *mean += x / n);
    }
    mean
}

/// The mean of each column, and one over its standard deviation; 0 for a constant column.
fn moments(values: &[f32], dim: usize) -> (Vec<f32>, Vec<f32>) {
    let n = (values.len() / dim) as f64;
    let (mut sums, mut squares) = (vec![0f64; dim], vec![0f64; dim]);
    for (i, &x) in values.iter().enumerate() {
        sums[i % dim] += f64::from(x);
        squares[i % dim] += f64::from(x) * f64::from(x);
    }
    let scale = |(sum, square): (&f64, &f64)| {
        let deviation = (square / n - (sum / n) * (sum / n)).max(0.0).sqrt();
        if deviation > 1e-6 { (1.0 / deviation) as f32 } else { 0.0 }
    };
    let scales = sums.iter().zip(&squares).map(scale).collect();
    (sums.iter().map(|sum| (sum / n) as f32).collect(), scales)
}

/// The weights that give for x what the given ones give for (x − centre) · scale.
fn of_raw_inputs(mut weights: Vec<f32>, centre: &[f32], scale: &[f32]) -> Vec<f32> {
    let dim = centre.len();
    for row in weights.chunks_exact_mut(dim + 1) {
        for i in 0..dim {
            row[i] *= scale[i];
            row[dim] -= row[i] * centre[i];
        }
    }
    weights
}

/// The product of a layer's rows with x, plus their biases.
fn rows(weights: &[f32], x: &[f32]) -> Vec<f32> {
    let row = |row: &[f32]| row[x.len()] + row.iter().zip(x).map(|(w, x)| w * x).sum::<f32>();
    weights.chunks_exact(x.len() + 1).map(row).collect()
}

fn relu(mut x: Vec<f32>) -> Vec<f32> {
    x.iter_mut().for_each(|x| *x = x.max(0.0));
    x
}

fn softmax(mut x: Vec<f32>) -> Vec<f32> {
    let most = x.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    x.iter_mut().for_each(|x| *x = (*x - most).exp());
    let sum: f32 = x.iter().sum();
    x.iter_mut().for_each(|x| *x /= sum);
    x
}

/// Subtracts the target of a class, which its neighbours share.
fn subtract_target(probabilities: &mut [f32], class: usize) {
    let last = (class + SHARED).min(probabilities.len() - 1);
    let near = class.saturating_sub(SHARED)..=last;
    let weight = |i: usize| (SHARED + 1 - i.abs_diff(class)) as f32;
    let sum: f32 = near.clone().map(weight).sum();
    near.for_each(|i| probabilities[i] -= weight(i) / sum);
}

/// A layer with the state of AdamW (Loshchilov and Hutter 2019).
struct Trained {
    /// `[n_outputs, n_inputs + 1]`.
    weights: Vec<f32>,
    gradient: Vec<f32>,
    moments: [Vec<f32>; 2],
}

impl Trained {
    fn zeros(n_outputs: usize, n_inputs: usize) -> Self {
        let zeros = || vec![0.0; n_outputs * (n_inputs + 1)];
        Self { weights: zeros(), gradient: zeros(), moments: [zeros(), zeros()] }
    }

    /// Weights uniform within 1/√`n_inputs`.
    fn new(n_outputs: usize, n_inputs: usize, rng: &mut ChaCha8Rng) -> Self {
        let mut layer = Self::zeros(n_outputs, n_inputs);
        let bound = 1.0 / (n_inputs as f64).sqrt();
        layer.weights.iter_mut().for_each(|w| *w = (bound * (2.0 * unit(rng) - 1.0)) as f32);
        layer
    }

    /// Adds the gradient of the weights, of inputs x and the error of the outputs; returns the error of x.
    fn add_gradient(&mut self, x: &[f32], error: &[f32]) -> Vec<f32> {
        let (mut of_x, width) = (vec![0.0; x.len()], x.len() + 1);
        let layers = self.weights.chunks_exact(width).zip(self.gradient.chunks_exact_mut(width));
        for ((row, gradient), error) in layers.zip(error) {
            gradient.iter_mut().zip(x).for_each(|(g, x)| *g += error * x);
            gradient[x.len()] += error;
            of_x.iter_mut().zip(row).for_each(|(of_x, w)| *of_x += error * w);
        }
        of_x
    }

    /// A step of AdamW, after which the gradient is 0.
    fn step(&mut self, rate: f32, step: usize) {
        let [first, second] = [0.9f32, 0.999].map(|decay| 1.0 - decay.powi(step as i32 + 1));
        let [means, squares] = &mut self.moments;
        let states = means.iter_mut().zip(squares).zip(&mut self.gradient);
        for (weight, ((mean, square), sum)) in self.weights.iter_mut().zip(states) {
            let gradient = std::mem::take(sum) / BATCH as f32;
            *mean += 0.1 * (gradient - *mean);
            *square += 0.001 * (gradient * gradient - *square);
            let moved = (*mean / first) / ((*square / second).sqrt() + 1e-8);
            *weight -= rate * (moved + DECAY * *weight);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::columns;

    /// Captions of two kinds, whose clips have 40 to 60 frames and 160 to 180.
    fn trained() -> LengthEstimator {
        let means = &[1.0, 0.2, -3.0, 1.1, 0.1, -3.0, -1.0, 0.1, -3.0, -1.1, 0.2, -3.0];
        let clip = |i: usize| {
            let frames = if i.is_multiple_of(2) { 40 } else { 160 } + 4 * (i / 2 % 6);
            (frames, if i.is_multiple_of(2) { &[0, 1][..] } else { &[2, 3][..] })
        };
        let clips: Vec<ClipCaptions> = (0..24).map(clip).collect();
        LengthEstimator::train(3, &clips, |caption| &means[caption as usize * 3..][..3])
    }

    #[test]
    fn a_caption_of_short_motions_gives_a_short_length_and_one_of_long_motions_a_long_one() {
        let estimator = trained();
        assert_eq!(estimator.classes[0], 4);
        assert_eq!(estimator.probabilities(&[0.0; 3]).len(), 36, "from 40 frames to 180");
        let mut rng = stream(1, 0);
        // Two words, whose mean is the vector of the caption.
        for (vectors, from, to) in [
            ([0.5, 0.2, -3.0, 1.5, 0.2, -3.0], 40, 68),
            ([-0.5, 0.2, -3.0, -1.5, 0.2, -3.0], 152, 180),
        ] {
            let sum: f32 = estimator.probabilities(&vectors).iter().sum();
            assert!((sum - 1.0).abs() < 1e-5);
            let drawn: Vec<usize> = (0..200).map(|_| estimator.draw(&vectors, &mut rng)).collect();
            let within = drawn.iter().filter(|frames| (from..=to).contains(*frames)).count();
            assert!(within >= 190, "{drawn:?}");
            let distinct = drawn.iter().collect::<std::collections::BTreeSet<_>>().len();
            assert!(distinct >= 5, "a caption has more than one length: {drawn:?}");
        }
    }

    #[test]
    fn lengths_beyond_those_of_the_papers_share_the_classes() {
        let vectors = &[1.0, 2.0];
        let clips: [ClipCaptions; 2] = [(40, &[0]), (1000, &[1])];
        let estimator =
            LengthEstimator::train(1, &clips, |caption| &vectors[caption as usize..][..1]);
        assert_eq!(estimator.classes[0], 16);
        assert_eq!(estimator.probabilities(&[1.0]).len(), 61);
        assert!(estimator.draw(&[2.0], &mut stream(0, 1)) >= 900);
    }

    #[test]
    fn an_estimator_is_read_as_it_was_written_and_a_cut_one_is_refused() {
        let (estimator, folder) = (trained(), tempfile::tempdir().unwrap());
        let path = folder.path().join("captions.safetensors");
        let write = |columns: &[NewColumn], dim: &str| {
            columns::write(&path, columns, Some(("dim", dim.to_string()))).unwrap();
            LengthEstimator::open(&path)
        };
        assert_eq!(write(&estimator.columns(), "3").unwrap(), estimator);
        let error = write(&[NewColumn::new("words", &[0u64])], "3").unwrap_err().to_string();
        assert!(error.contains("its column `lengths.classes` is missing"), "{error}");
        let error = write(&estimator.columns(), "4").unwrap_err().to_string();
        assert!(error.contains("its length estimator is cut"), "{error}");
    }
}
