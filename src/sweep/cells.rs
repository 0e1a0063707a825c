//! The elements of a grid: its models, by a list, a name or a rule, their shapes, and conditions of its cells.

use super::sections::{ModelEntry, ModelList, ModelSection};
use crate::spec::{Ffn, ModelShape, TextSpec};

/// The models of a list, of a list's name or of a rule; none for an unknown name.
pub fn models(list: &ModelList) -> Vec<ModelEntry> {
    match list {
        ModelList::List(models) => models.clone(),
        ModelList::Named(name) => named_models(name).unwrap_or_default(),
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

/// Names allowed in `grid.models`.
pub const MODEL_LISTS: [&str; 1] = ["scamo"];

/// The models of a list that has a name; `None` for an unknown one.
pub fn named_models(name: &str) -> Option<Vec<ModelEntry>> {
    // The six rows of ScaMo's Table 1 (44M, 111M, 343M, 775M, 1.4B, 3B), which are LlamaGen's shapes. Widths of the
    // feed-forward layer are those of the released code: 8d/3 up to a multiple of 256.
    let scamo = [
        (8, 8, 512, 1536),
        (12, 12, 768, 2048),
        (24, 16, 1024, 2816),
        (36, 20, 1280, 3584),
        (48, 24, 1536, 4096),
        (24, 32, 3200, 8704),
    ]
    .map(|(n_layer, n_head, d_model, d_ff)| (n_layer, n_head, d_model, Some(d_ff)));
    let entry = |(n_layer, n_head, d_model, d_ff)| ModelEntry { n_layer, n_head, d_model, d_ff };
    (name == "scamo").then(|| scamo.map(entry).to_vec())
}

// Conditions.

/// Comparisons of `grid.exclude`, as `n_vocab > 1000 and d_model < 64`, that must all hold.
#[derive(Clone, Debug)]
pub struct Condition(Vec<Comparison>);

#[derive(Clone, Debug)]
struct Comparison {
    /// Index of one of [`Condition::FIELDS`].
    field: usize,
    holds: Holds,
    value: f64,
}

type Holds = fn(&f64, &f64) -> bool;

/// Longer operators first, so that `<=` is not read as `<`.
const OPERATORS: [(&str, Holds); 6] = [
    ("<=", f64::le),
    (">=", f64::ge),
    ("==", f64::eq),
    ("!=", f64::ne),
    ("<", f64::lt),
    (">", f64::gt),
];

impl Condition {
    /// Names that a condition may compare, in the order of [`Condition::holds`].
    pub const FIELDS: [&str; 6] = ["n_layer", "n_head", "d_model", "n_vocab", "budget", "share"];

    /// Reads a condition; the error names the part that was not understood.
    pub fn parse(text: &str) -> Result<Self, String> {
        text.split(" and ").map(comparison).collect::<Result<_, _>>().map(Self)
    }

    /// Whether every comparison holds for the cell with these values of [`Condition::FIELDS`].
    pub fn holds(&self, values: [f64; Self::FIELDS.len()]) -> bool {
        self.0.iter().all(|Comparison { field, holds, value }| holds(&values[*field], value))
    }
}

fn comparison(text: &str) -> Result<Comparison, String> {
    let split = |(operator, holds)| Some((text.split_once(operator)?, holds));
    let found = OPERATORS.into_iter().find_map(split);
    let ((field, value), holds) = found.ok_or(format!("no comparison in `{}`", text.trim()))?;
    let (field, value) = (field.trim(), value.trim());
    let unknown = || format!("unknown name `{field}`; valid: {}", Condition::FIELDS.join(", "));
    let field = Condition::FIELDS.iter().position(|name| *name == field).ok_or_else(unknown)?;
    let value = value.parse().map_err(|_| format!("`{value}` is not a number"))?;
    Ok(Comparison { field, holds, value })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spec::flops::openai_per_token;

    /// ScaMo's Table 1 by the arithmetic of its released code: blocks and the final norm.
    #[test]
    fn scamo_models_have_their_true_parameter_counts() {
        let text = TextSpec { dim: 2048, max_tokens: 150, ..TextSpec::default() };
        let counts = named_models("scamo")
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
        let found = named_models("scamo").unwrap().into_iter().map(|entry| {
            let shape = shape(&entry, &ModelSection::default(), &text);
            [240, 1000, 64000].map(|n_vocab| openai_per_token(&shape, n_vocab))
        });
        assert_eq!(found.collect::<Vec<_>>(), expected);
    }

    #[test]
    fn every_comparison_must_hold() {
        let condition = Condition::parse("n_vocab >= 1e3 and d_model < 64").unwrap();
        let cell = |v: f64, d: f64| [d, d, d, v, d, d];
        assert!(condition.holds(cell(1000.0, 32.0)));
        assert!(!condition.holds(cell(999.0, 32.0)));
        assert!(!condition.holds(cell(1000.0, 64.0)));
    }

    #[test]
    fn what_is_not_a_condition_is_named() {
        assert!(Condition::parse("n_vocab").unwrap_err().contains("no comparison"));
        assert!(Condition::parse("width > 3").unwrap_err().contains("`width`"));
        assert!(Condition::parse("d_model > big").unwrap_err().contains("`big`"));
    }
}
