//! The BERT family: MiniLM, BERT, and what else has its layers.

use candle_core::Tensor;
use candle_transformers::models::bert::{BertModel, Config};

use super::folder::{ModelFolder, Network};

use crate::text::store::TextError;

/// The network and the width of its states.
pub fn load(folder: &ModelFolder) -> Result<(Box<dyn Network>, usize), TextError> {
    let config: Config = folder.config()?;
    let model = folder.network(folder.weights()?, |weights| BertModel::load(weights, &config))?;
    Ok((Box::new(model), config.hidden_size))
}

impl Network for BertModel {
    fn states(&self, ids: &Tensor) -> candle_core::Result<Tensor> {
        self.forward(ids, &ids.zeros_like()?, None)
    }
}
