//! [`Reader`]: rows of a sequence into one vector, read from both ends.
//!
//! Shapes: n sequences, m rows, c channels, h numbers of a state, e numbers of an embedding.

use burn::module::{Module, Param};
use burn::tensor::activation::leaky_relu;
use burn::tensor::{Device, Tensor};
use rand_chacha::ChaCha8Rng;

use super::gru::Gru;
use super::order::Order;
use crate::learn::layers::Affine;
use crate::learn::params::constant;

/// Slope of the rectifiers below 0.
pub const SLOPE: f64 = 0.2;

/// What a variance is raised by before it divides.
const EPSILON: f64 = 1e-5;

/// A layer, a GRU from either end, and a head over their last states.
#[derive(Module, Debug)]
pub struct Reader {
    input: Affine,
    forwards: Gru,
    backwards: Gru,
    hidden: Affine,
    /// Of a layer normalisation, `[h]` each.
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

    /// Where the parameters are.
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
