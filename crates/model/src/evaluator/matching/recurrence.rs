//! [`Reader`]: rows of a sequence into one vector, read from both ends by a [`Gru`] each, in an [`Order`].
//!
//! Shapes: n sequences, m rows of all sequences, t steps, c channels, h numbers of a state, e numbers of an embedding.

use std::sync::Arc;

use burn::module::{Module, Param};
use burn::tensor::activation::{leaky_relu, sigmoid};
use burn::tensor::{Device, Tensor, TensorData};
use rand_chacha::ChaCha8Rng;

use crate::learn::layers::Affine;
use crate::learn::params::{constant, normal};
use crate::ops::Kernels;

/// Slope of the rectifiers below 0.
pub const SLOPE: f64 = 0.2;

/// Added to a variance before division.
const EPSILON: f64 = 1e-5;

/// A layer, a GRU from either end, and a head over their last states.
#[derive(Module, Debug)]
pub struct Reader {
    input: Affine,
    forwards: Gru,
    backwards: Gru,
    hidden: Affine,
    /// Parameters of a layer normalisation, `[h]` each.
    scale: Param<Tensor<1>>,
    shift: Param<Tensor<1>>,
    output: Affine,
}

impl Reader {
    /// A reader of rows of `channels`, with states of `width` numbers, into `dim`.
    pub fn init([channels, width, dim]: [usize; 3], rng: &mut ChaCha8Rng, device: &Device) -> Self {
        Self {
            input: Affine::new(channels, width, rng, device),
            forwards: Gru::init(width, width, rng, device),
            backwards: Gru::init(width, width, rng, device),
            hidden: Affine::new(2 * width, width, rng, device),
            scale: constant([width], 1.0, device),
            shift: constant([width], 0.0, device),
            output: Affine::new(width, dim, rng, device),
        }
    }

    /// The device of the parameters.
    pub fn device(&self) -> Device {
        self.output.device()
    }

    /// A vector of each sequence, `[n, e]`.
    pub fn read(&self, x_mc: Tensor<2>, order: &Order) -> Tensor<2> {
        let x_mh = self.input.forward(x_mc);
        let forwards = self.forwards.last(&x_mh, order, &order.forwards());
        let backwards = self.backwards.last(&x_mh, order, &order.backwards());
        let hidden = self.hidden.forward(Tensor::cat(vec![forwards, backwards], 1));
        self.output.forward(leaky_relu(self.normalised(hidden), SLOPE))
    }

    fn normalised(&self, x_nh: Tensor<2>) -> Tensor<2> {
        let centred = x_nh.clone() - x_nh.mean_dim(1);
        let deviation = centred.clone().powi_scalar(2).mean_dim(1).add_scalar(EPSILON).sqrt();
        centred / deviation * self.scale.val().unsqueeze() + self.shift.val().unsqueeze()
    }
}

// [`Gru`]: a recurrence over rows, in one direction.

/// A gated recurrent unit (Cho et al. 2014) with PyTorch's gates, whose first state is learned:
///
/// r = σ(W_r x + U_r h), z = σ(W_z x + U_z h), ĥ = tanh(W x + r ⊙ U h), h ← z ⊙ h + (1 − z) ⊙ ĥ,
/// each product with its bias.
#[derive(Module, Debug)]
struct Gru {
    /// `[c, 3h]`: W_r, W_z and W.
    input: Affine,
    /// `[h, 3h]`: U_r, U_z and U.
    state: Affine,
    /// `[1, h]`.
    first: Param<Tensor<2>>,
}

impl Gru {
    /// A recurrence over rows of `channels` with a state of `width` numbers.
    fn init(channels: usize, width: usize, rng: &mut ChaCha8Rng, device: &Device) -> Self {
        Self {
            input: Affine::new(channels, 3 * width, rng, device),
            state: Affine::new(width, 3 * width, rng, device),
            first: normal([1, width], 1.0, rng, device),
        }
    }

    /// The state after the last row of each sequence, `[n, h]`: `rows` are the rows of `x_mc` in the
    /// order in which they are read, as of [`Order::forwards`].
    fn last(&self, x_mc: &Tensor<2>, order: &Order, rows: &Arc<[u32]>) -> Tensor<2> {
        let device = x_mc.device();
        let kernels = Kernels::for_device(&device);
        let gates = kernels.select_rows(self.input.forward(x_mc.clone()), rows);
        let mut state_nh = self.first.val().repeat_dim(0, order.len());
        for (step, gates_n3h) in steps(gates, order.steps()).into_iter().enumerate() {
            let mut change_nh = self.change(gates_n3h, &state_nh);
            if let Some(goes_on) = order.going_on(step, &device) {
                change_nh = change_nh * goes_on;
            }
            state_nh = state_nh + change_nh;
        }
        state_nh
    }

    /// (1 − z) ⊙ (ĥ − h), `[n, h]`.
    fn change(&self, input_n3h: Tensor<2>, state_nh: &Tensor<2>) -> Tensor<2> {
        let h = state_nh.dims()[1];
        let recurrent_n3h = self.state.forward(state_nh.clone());
        let both =
            input_n3h.clone().narrow(1, 0, 2 * h) + recurrent_n3h.clone().narrow(1, 0, 2 * h);
        let gates = sigmoid(both);
        let (reset, update) = (gates.clone().narrow(1, 0, h), gates.narrow(1, h, h));
        let recurrent = reset * recurrent_n3h.narrow(1, 2 * h, h);
        let candidate = (input_n3h.narrow(1, 2 * h, h) + recurrent).tanh();
        (candidate - state_nh.clone()) * update.neg().add_scalar(1.0)
    }
}

/// Rows of equal steps as one tensor a step. Halves are parted again and again, so that the way back,
/// which writes as many zeros as there are rows for each part, takes t log t rows and not t².
fn steps(rows: Tensor<2>, n_steps: usize) -> Vec<Tensor<2>> {
    if n_steps <= 1 {
        return vec![rows; n_steps];
    }
    let (all, first) = (rows.dims()[0], n_steps / 2);
    let per_step = all / n_steps;
    let second = rows.clone().narrow(0, first * per_step, (n_steps - first) * per_step);
    let mut parts = steps(rows.narrow(0, 0, first * per_step), first);
    parts.extend(steps(second, n_steps - first));
    parts
}

// [`Order`]: sequences side by side, row after row, for a recurrence.

/// Sequences of different lengths, of which a recurrence reads the t-th rows together.
#[derive(Clone, Debug)]
pub struct Order {
    /// The first row of each sequence, and how many it has.
    sequences: Vec<(usize, usize)>,
}

impl Order {
    /// Concatenated sequences.
    pub fn packed(lengths: &[usize]) -> Self {
        let start = |end: &mut usize, length: &usize| {
            let start = *end;
            *end += length;
            Some((start, *length))
        };
        Self { sequences: lengths.iter().scan(0, start).collect() }
    }

    /// Sequences `stride` rows apart.
    pub fn padded(lengths: &[usize], stride: usize) -> Self {
        let at = |(i, length): (usize, &usize)| (i * stride, *length);
        Self { sequences: lengths.iter().enumerate().map(at).collect() }
    }

    /// Sequences.
    fn len(&self) -> usize {
        self.sequences.len()
    }

    /// Rows of the longest sequence.
    fn steps(&self) -> usize {
        self.sequences.iter().map(|(_, length)| *length).max().unwrap_or(0)
    }

    /// The rows of all first steps, then of all second ones, and so on; beyond the end of a sequence, its last row.
    fn forwards(&self) -> Arc<[u32]> {
        self.rows(|step, start, length| start + step.min(length - 1))
    }

    /// The same in reverse.
    fn backwards(&self) -> Arc<[u32]> {
        self.rows(|step, start, length| start + (length - 1).saturating_sub(step))
    }

    fn rows(&self, row: impl Fn(usize, usize, usize) -> usize) -> Arc<[u32]> {
        let of = |step| self.sequences.iter().map(move |(start, length)| (step, *start, *length));
        let all = (0..self.steps()).flat_map(of);
        all.map(|(step, start, length)| row(step, start, length) as u32).collect()
    }

    /// 1 for sequences that continue at a step, else 0, `[n, 1]`; `None` if all do.
    fn going_on(&self, step: usize, device: &Device) -> Option<Tensor<2>> {
        let goes = |(_, length): &(usize, usize)| f32::from(u8::from(step < *length));
        let values: Vec<f32> = self.sequences.iter().map(goes).collect();
        let ended = values.contains(&0.0);
        ended.then(|| Tensor::from_data(TensorData::new(values, [self.len(), 1]), device))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_chacha::rand_core::SeedableRng;

    fn host<const D: usize>(tensor: Tensor<D>) -> Vec<f64> {
        tensor.into_data().iter::<f64>().collect()
    }

    /// x W + b in double precision.
    fn affine(layer: &Affine, x: &[f64]) -> Vec<f64> {
        let x: Vec<f32> = x.iter().map(|x| *x as f32).collect();
        let n = x.len();
        host(layer.forward(Tensor::from_data(TensorData::new(x, [1, n]), &Device::flex())))
    }

    /// The formula above, one number after another.
    fn by_hand(gru: &Gru, rows: &[[f64; 3]]) -> Vec<f64> {
        let sigma = |x: f64| 1.0 / (1.0 + (-x).exp());
        let mut state = host(gru.first.val());
        for row in rows {
            let (w, u, h) = (affine(&gru.input, row), affine(&gru.state, &state), state.len());
            let next = |i: usize| {
                let (r, z) = (sigma(w[i] + u[i]), sigma(w[h + i] + u[h + i]));
                z * state[i] + (1.0 - z) * (w[2 * h + i] + r * u[2 * h + i]).tanh()
            };
            state = (0..h).map(next).collect();
        }
        state
    }

    #[test]
    fn it_is_its_formula_in_both_directions_at_any_length() {
        let (device, mut rng) = (Device::flex(), ChaCha8Rng::seed_from_u64(3));
        let gru = Gru::init(3, 5, &mut rng, &device);
        let rows: Vec<[f64; 3]> =
            (0..7).map(|i| [0.1, 0.7, -0.9].map(|x| x * f64::from(i - 2))).collect();
        let flat: Vec<f32> = rows.iter().flatten().map(|x| *x as f32).collect();
        let x = Tensor::<2>::from_data(TensorData::new(flat, [7, 3]), &device);
        let order = Order::packed(&[4, 1, 2]);
        let reversed =
            |range: std::ops::Range<usize>| rows[range].iter().rev().copied().collect::<Vec<_>>();
        let forwards = [rows[0..4].to_vec(), rows[4..5].to_vec(), rows[5..7].to_vec()];
        let backwards = [reversed(0..4), reversed(4..5), reversed(5..7)];
        let cases = [(order.forwards(), forwards), (order.backwards(), backwards)];
        for (read, sequences) in cases {
            let expected: Vec<f64> =
                sequences.iter().flat_map(|rows| by_hand(&gru, rows)).collect();
            let found = host(gru.last(&x, &order, &read));
            assert!(found.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-5), "{found:?}");
        }
    }

    #[test]
    fn the_gradient_is_that_of_finite_differences() {
        let device = Device::flex().autodiff();
        let gru = Gru::init(2, 3, &mut ChaCha8Rng::seed_from_u64(4), &device);
        let order = Order::packed(&[3, 2]);
        let values: Vec<f32> = (0..10).map(|i| (i as f32 * 1.7).sin()).collect();
        let of = |values: &[f32]| {
            Tensor::<2>::from_data(TensorData::new(values.to_vec(), [5, 2]), &device)
        };
        let loss = |x: &Tensor<2>| gru.last(x, &order, &order.forwards()).powi_scalar(2).sum();
        let x = of(&values).require_grad();
        let gradient = host(x.grad(&loss(&x).backward()).expect("it is tracked"));
        for (i, slope) in gradient.iter().enumerate() {
            let moved = |by: f32| {
                let mut values = values.clone();
                values[i] += by;
                f64::from(loss(&of(&values)).into_scalar::<f32>())
            };
            let expected = (moved(1e-2) - moved(-1e-2)) / 2e-2;
            assert!((slope - expected).abs() < 2e-3, "{i}: {slope} and {expected}");
        }
    }

    #[test]
    fn each_sequence_is_read_from_either_end() {
        let packed = Order::packed(&[3, 1]);
        assert_eq!((packed.len(), packed.steps()), (2, 3));
        assert_eq!(packed.forwards()[..], [0, 3, 1, 3, 2, 3]);
        assert_eq!(packed.backwards()[..], [2, 3, 1, 3, 0, 3]);
        let padded = Order::padded(&[3, 1], 4);
        assert_eq!(padded.backwards()[..], [2, 4, 1, 4, 0, 4]);
        let device = Device::flex();
        assert!(packed.going_on(0, &device).is_none());
        let second: Vec<f32> = packed.going_on(1, &device).unwrap().into_data().iter().collect();
        assert_eq!(second, [1.0, 0.0]);
    }
}
