//! The models of a grid: listed, by name, or by a rule; and the shapes that follow.

use super::model_lists;
use super::sections::{ModelEntry, ModelList, ModelSection};
use crate::spec::{Ffn, ModelShape, TextSpec};

/// The models of a list, of a list's name or of a rule; none for an unknown name.
pub fn models(list: &ModelList) -> Vec<ModelEntry> {
    match list {
        ModelList::List(models) => models.clone(),
        ModelList::Named(name) => model_lists::models(name).unwrap_or_default(),
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
pub fn shape(entry: &ModelEntry, model: &ModelSection, text: &TextSpec) -> ModelShape {
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
fn d_ff(d_model: usize, model: &ModelSection) -> usize {
    let width = match model.ffn {
        Ffn::SwiGlu => 8 * d_model / 3,
        Ffn::Gelu => 4 * d_model,
    };
    width.next_multiple_of(model.ffn_multiple)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spec::flops::openai_per_token;

    /// ScaMo's Table 1 by the arithmetic of its released code: blocks and the final norm.
    #[test]
    fn scamo_models_have_their_true_parameter_counts() {
        let text = TextSpec { dim: 2048, max_tokens: 150, ..TextSpec::default() };
        let counts = model_lists::models("scamo")
            .unwrap()
            .into_iter()
            .map(|entry| shape(&entry, &ModelSection::default(), &text).params_of(15360).nonvocab);
        let expected =
            [27_271_680, 84_953_856, 308_331_520, 731_475_200, 1_359_103_488, 2_988_598_400];
        assert_eq!(counts.collect::<Vec<_>>(), expected);
    }

    #[test]
    fn feed_forward_widths_follow_the_multiple() {
        let model = |ffn_multiple| ModelSection { ffn_multiple, ..ModelSection::default() };
        let widths = [512, 768, 1024, 1280, 1536, 3200].map(|d| d_ff(d, &model(256)));
        assert_eq!(widths, [1536, 2048, 2816, 3584, 4096, 8704]);
        assert_eq!(d_ff(32, &model(8)), 88);
    }

    /// The integers follow from Code 1 at n_ctx = 201, for V = 240, 1000, 64000.
    #[test]
    fn openai_counts_of_the_scamo_grid() {
        let expected = [
            [52226048, 53004288, 117516288],
            [173945856, 175113216, 271881216],
            [614354944, 615911424, 744935424],
            [1434721280, 1436666880, 1597946880],
            [2748291072, 2750625792, 2944161792],
            [5930662400, 5935526400, 6338726400],
        ];
        let text = TextSpec { max_tokens: 150, ..TextSpec::default() };
        let found = model_lists::models("scamo").unwrap().into_iter().map(|entry| {
            let shape = shape(&entry, &ModelSection::default(), &text);
            [240, 1000, 64000].map(|n_vocab| openai_per_token(&shape, n_vocab))
        });
        assert_eq!(found.collect::<Vec<_>>(), expected);
    }
}
