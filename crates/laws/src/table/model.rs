//! A model's parameters, with and without the vocabulary's, from whatever counts are given.

use super::Quantity;
use super::columns::Named;
use crate::laws::Parameters;

/// N may differ from N_nv + N_v by this share before a note says so.
const SAME_PARAMS: f64 = 0.01;

/// N_nv, N_v and V.
pub(super) struct ModelSizes {
    pub parameters: Parameters,
    pub nonvocab: Vec<f64>,
    pub vocab: Vec<f64>,
    pub n_vocab: Vec<f64>,
}

/// The counts of parameters that the columns given lead to.
pub(super) fn model_sizes(
    named: &Named,
    notes: &mut Vec<String>,
) -> Result<ModelSizes, (&'static str, &'static str)> {
    let given = |quantity| named.numbers.get(&quantity).map(Vec::as_slice);
    let (total, nonvocab) = (given(Quantity::Params), given(Quantity::ParamsNonvocab));
    let (n_vocab, d_model) = (given(Quantity::NVocab), given(Quantity::DModel));
    let product = || Some(zip(n_vocab?, d_model?, |v, d| v * d));
    let vocab = given(Quantity::ParamsVocab).map(<[f64]>::to_vec).or_else(product);
    let nothing = || vec![0.0; named.run_ids.len()];
    let (nonvocab, vocab) = match (nonvocab, total, vocab) {
        (Some(nonvocab), total, Some(vocab)) => {
            notes.extend(total.and_then(|total| disagreement(total, nonvocab, &vocab)));
            (nonvocab.to_vec(), vocab)
        }
        (Some(nonvocab), Some(total), None) => {
            (nonvocab.to_vec(), zip(total, nonvocab, |n, a| n - a))
        }
        (None, Some(total), Some(vocab)) => (zip(total, &vocab, |n, v| n - v), vocab),
        (None, Some(total), None) => {
            notes.extend(unused(named));
            return Ok(ModelSizes {
                parameters: Parameters::Total,
                nonvocab: total.to_vec(),
                vocab: nothing(),
                n_vocab: nothing(),
            });
        }
        (Some(_), None, None) => return Err(NO_VOCABULARY),
        (None, None, Some(_)) => return Err(NO_NONVOCAB),
        (None, None, None) => return Err(NO_PARAMS),
    };
    let n_vocab = n_vocab.map(<[f64]>::to_vec);
    let n_vocab = n_vocab.or_else(|| Some(zip(&vocab, d_model?, |params, d| params / d)));
    if n_vocab.is_none() {
        notes.push(
            "V is unknown, neither n_vocab nor d_model being given: vocabularies are told apart by \
             N_v, which stands in the place of V"
                .into(),
        );
    }
    let n_vocab = n_vocab.unwrap_or_else(|| vocab.clone());
    Ok(ModelSizes { parameters: Parameters::Split, nonvocab, vocab, n_vocab })
}

const NO_PARAMS: (&str, &str) = (
    "parameters",
    "`params`, or `params_nonvocab` and one of `params_vocab` and `n_vocab,d_model`,",
);
const NO_NONVOCAB: (&str, &str) =
    ("parameters beside the vocabulary's", "`params_nonvocab` or `params`");
const NO_VOCABULARY: (&str, &str) = (
    "vocabulary parameters beside params_nonvocab",
    "`params_vocab`, or `n_vocab` and `d_model`, or the count itself as `params`,",
);

/// Joins two columns row by row.
pub(super) fn zip(a: &[f64], b: &[f64], of: impl Fn(f64, f64) -> f64) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| of(*a, *b)).collect()
}

/// Names what a table without vocabulary parameters cannot use.
fn unused(named: &Named) -> Option<String> {
    let has = |quantity: &Quantity| named.numbers.contains_key(quantity);
    let of = [Quantity::NVocab, Quantity::DModel];
    let names: Vec<_> = of.iter().filter(|q| has(q)).map(|q| q.name()).collect();
    (!names.is_empty()).then(|| {
        format!("only N is used, not {}: the vocabulary's parameters are unknown", names.join(", "))
    })
}

fn disagreement(total: &[f64], nonvocab: &[f64], vocab: &[f64]) -> Option<String> {
    let sum = zip(nonvocab, vocab, |a, b| a + b);
    let off = |(n, sum): (&f64, &f64)| (n - sum).abs() > SAME_PARAMS * sum.abs();
    let count = total.iter().zip(&sum).filter(|pair| off(*pair)).count();
    (count > 0).then(|| {
        format!("in {count} row(s) params is not params_nonvocab + params_vocab; the sum is used")
    })
}
