//! Model lists that have a name.

use crate::sweep::sections::ModelEntry;

/// Names that `grid.models` knows.
pub const NAMES: [&str; 1] = ["scamo"];

/// The models of a list; `None` for an unknown name.
pub fn models(name: &str) -> Option<Vec<ModelEntry>> {
    (name == "scamo").then(scamo)
}

/// The six rows of ScaMo's Table 1 (44M, 111M, 343M, 775M, 1.4B, 3B), which are LlamaGen's shapes.
///
/// Widths of the feed-forward layer are those of the released code: 8d/3 up to a multiple of 256.
fn scamo() -> Vec<ModelEntry> {
    [
        (8, 8, 512, 1536),
        (12, 12, 768, 2048),
        (24, 16, 1024, 2816),
        (36, 20, 1280, 3584),
        (48, 24, 1536, 4096),
        (24, 32, 3200, 8704),
    ]
    .map(|(n_layer, n_head, d_model, d_ff)| ModelEntry {
        n_layer,
        n_head,
        d_model,
        d_ff: Some(d_ff),
    })
    .to_vec()
}
