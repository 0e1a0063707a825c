//! [`Network`]: what every model is to its encoder.

use candle_core::Tensor;

/// What a model makes of captions.
pub trait Network: Send + Sync {
    /// States of the tokens of captions of one length, `[n, tokens]` to `[n, tokens, dim]`.
    fn states(&self, ids: &Tensor) -> candle_core::Result<Tensor>;

    /// One vector a caption, `[n, dim]`, of its tokens and their states; by default the mean of these.
    fn sentence(&self, _ids: &Tensor, states: &Tensor) -> candle_core::Result<Tensor> {
        states.mean(1)
    }
}
