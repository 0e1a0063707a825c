//! The models of a grid: listed, by name, or by a rule; and the shapes that follow.

use super::presets;
use super::sections::{ModelEntry, ModelList, ModelSpec};
use crate::spec::{Ffn, ModelShape, TextSpec};

/// The models of a list, a preset or a rule; none for an unknown preset.
pub fn models(list: &ModelList) -> Vec<ModelEntry> {
    match list {
        ModelList::List(models) => models.clone(),
        ModelList::Preset(name) => presets::models(name).unwrap_or_default(),
        ModelList::Rule(rule) => rule
            .d_model
            .iter()
            .map(|&d_model| ModelEntry {
                n_layer: ((d_model as f64 / rule.width_per_layer as f64).round() as usize).max(1),
                n_head: (d_model / rule.head_dim).max(1),
                d_model,
                d_ff: None,
            })
            .collect(),
    }
}

/// The shape of a listed model under the sweep's shared settings.
pub fn shape(entry: &ModelEntry, model: &ModelSpec, text: &TextSpec) -> ModelShape {
    ModelShape {
        n_layer: entry.n_layer,
        n_head: entry.n_head,
        d_model: entry.d_model,
        d_ff: entry.d_ff.unwrap_or_else(|| d_ff(entry.d_model, model)),
        n_ctx: text.max_tokens + model.motion_slots,
        d_text: text.dim,
        ffn: model.ffn,
        tie_embeddings: model.tie_embeddings,
        rope_base: model.rope_base,
    }
}

/// 8d/3 (SwiGLU) or 4d (GELU), up to the next multiple.
fn d_ff(d_model: usize, model: &ModelSpec) -> usize {
    let width = match model.ffn {
        Ffn::SwiGlu => 8 * d_model / 3,
        Ffn::Gelu => 4 * d_model,
    };
    width.next_multiple_of(model.ffn_multiple)
}
