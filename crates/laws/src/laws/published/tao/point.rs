//! [`FrontierPoint`]: what a frontier is made of.

/// A run, or a point between runs, that improves on all that spent less.
#[derive(Clone, Debug, PartialEq)]
pub struct FrontierPoint {
    /// C = 6 (N_nv + N_v) D.
    pub flops: f64,
    /// N_nv.
    pub params_nonvocab: f64,
    /// N_v = V·d.
    pub params_vocab: f64,
    /// V.
    pub n_vocab: f64,
    /// L_u.
    pub loss_normalised: f64,
}
