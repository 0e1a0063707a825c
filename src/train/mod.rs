//! Training: parameters, optimiser, batches, the loop, checkpoints and the loss.

pub mod adamw;
mod checkpoint;
mod error;
mod evaluate;
mod fitness;
pub mod params;
mod run;
mod schedule;
mod stream;
pub mod weights;

pub use checkpoint::LogLine;
pub use error::TrainError;
pub use evaluate::{SplitLoss, TARGETS_PER_PASS, split_loss, zero_count_targets};
pub use run::{Branch, Checkpoints, Inputs, Trained, train, train_trunk};
pub use schedule::learning_rate;
pub use stream::TokenStream;
