//! The encoder of T5.

use std::sync::{Mutex, PoisonError};

use candle_core::Tensor;
use candle_transformers::models::t5::{Config, T5EncoderModel};

use super::folder::{ModelFolder, Network};

use crate::text::store::TextError;

/// The network and the width of its states.
pub fn load(folder: &ModelFolder) -> Result<(Box<dyn Network>, usize), TextError> {
    let config: Config = folder.config()?;
    let load = |weights| T5EncoderModel::load(weights, &config);
    let model = folder.network(folder.weights()?, load)?;
    Ok((Box::new(Mutex::new(model)), config.d_model))
}

/// Its forward pass wants it for itself, though an encoder keeps nothing.
impl Network for Mutex<T5EncoderModel> {
    fn states(&self, ids: &Tensor) -> candle_core::Result<Tensor> {
        self.lock().unwrap_or_else(PoisonError::into_inner).forward(ids)
    }
}
