//! [`Kind`]: what a kind of generator says of itself.

use burn::module::Module;
use burn::tensor::{Device, Tensor};
use rand_chacha::ChaCha8Rng;

use super::sampling::Sampler;
use super::sums::SplitLoss;
use super::trained::Inputs;
use crate::data::Split;
use crate::learn::{Checkpoints, LearnError};
use crate::plan::RunSpec;
use crate::spec::Precision;

/// What is trained, on what, and where its state lies.
#[derive(Clone, Copy)]
pub struct Training<'a> {
    pub spec: &'a RunSpec,
    pub inputs: &'a Inputs<'a>,
    pub device: &'a Device,
    pub checkpoints: &'a Checkpoints<'a>,
}

/// A model of codes.
pub trait Network {
    /// Its parameters.
    type Weights: Module + Clone;

    /// What a step shows it.
    type Batch;

    /// The model of a run with drawn parameters; on an autodiff device it can be trained.
    fn drawn(spec: &RunSpec, precision: Precision, rng: &mut ChaCha8Rng, device: &Device) -> Self;

    /// The parameters as they are.
    fn weights(&self) -> &Self::Weights;

    /// Takes over parameters.
    fn set_weights(&mut self, weights: Self::Weights);

    /// Mean cross-entropy over the supervised codes of a batch, in nats, `[1]`.
    fn loss(&self, batch: &Self::Batch) -> Tensor<1>;
}

/// What a kind of generator shows its model in training, and how it measures it.
pub trait Objective<'a> {
    /// The model.
    type Network: Network;

    /// That of a run.
    fn new(spec: &'a RunSpec, inputs: &'a Inputs<'a>) -> Self;

    /// A step's batch, a pure function of the step, which counts from 0; and its forward FLOPs, by the
    /// exact count.
    fn batch(&mut self, network: &Self::Network, step: usize) -> (BatchOf<Self::Network>, f64);

    /// The loss of a model as it is on a split.
    fn split_loss(&self, network: &Self::Network, split: Split) -> SplitLoss;

    /// The loss of a model that knows nothing but which codes there are, in nats.
    fn uniform_nats(&self) -> f64;
}

type BatchOf<N> = <N as Network>::Batch;

/// A kind of generator, as it says of itself.
pub trait Kind: Sync + 'static {
    /// The model.
    type Network: Network;

    /// What its runs make small.
    type Objective<'a>: Objective<'a, Network = Self::Network>;

    /// Whether it asks for [`Inputs::scales`].
    const WANTS_SCALES: bool = false;

    /// A trained model that makes motions.
    fn sampler(spec: &RunSpec, network: Self::Network) -> Box<dyn Sampler>;

    /// A step's batch of made-up clips, and how many tokens it supervises.
    fn made_up(spec: &RunSpec, network: &Self::Network) -> (BatchOf<Self::Network>, usize);
}

/// Parameters of a model that a probe builds, at most.
pub const MOST_PROBED_PARAMS: usize = 4_000_000;

/// A run on made-up codes.
pub trait Probe {
    /// Takes a step that changes nothing.
    ///
    /// # Errors
    /// The device gives no number.
    fn step(&mut self) -> Result<(), LearnError>;

    /// FLOPs of a step, in the measure of the run's budget.
    fn flops(&self) -> f64;
}
