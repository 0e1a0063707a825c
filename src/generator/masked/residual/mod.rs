//! MoMask's second stage, for codes of several layers: the codes of a layer all at once, from the text
//! and the codes of the layers before it.
//!
//! A place of a clip is one position: the sum of the embeddings of its codes in the layers before, and
//! a learned vector of the layer that is asked for. Every position of `[text | places]` sees every other.
//! The network has the shape of the first stage and no parameter of it. MoMask gives the layer as a
//! position of its own, and takes its heads from the embeddings; here each layer has a head of its own,
//! as the scales of the scale-by-scale transformer have, but where `model.tie_embeddings` asks for
//! MoMask's.

pub mod batch;
mod evaluate;
mod model;
mod objective;
mod probe;
mod sample;
mod stages;

pub use batch::{Asked, LayerBatch};
pub use model::{ResidualModel, ResidualTransformer};
pub use objective::{TwoStages, first_stages};
pub(super) use probe::probed;
pub(super) use sample::draw_layers;
pub use stages::{StageWeights, Stages};
