//! Derives missing quantities from the given ones.
//!
//! | quantity | if not given | unit |
//! | --- | --- | --- |
//! | N_v | V·d, else N − N_nv | parameters |
//! | V | N_v/d; N_v where d is unknown | codes |
//! | N_nv | N − N_v | parameters |
//! | D | C/(6 N), with the declared budget C | tokens |
//! | C | 6 N D | FLOPs |
//! | FLOPs spent | 6 N D | FLOPs |
//! | seed, weight | 0, 1 | |
//! | share of the data, distinct tokens | unknown | , tokens |
//!
//! N = N_nv + N_v. If only N is given, it is stored as N_nv, and N_v and V are 0.
//! 6 N D counts the multiplications and additions of one forward and one backward pass (Kaplan et
//! al. 2020, without attention).

use super::{Quantity, Table, TableError};
use crate::laws::text::times;
use crate::laws::{IsoFlopPoint, Metric, Parameters, RunFacts};
use crate::table::columns::Named;

/// Budgets beyond this factor of 6 N D are a slip of the unit rather than another FLOP rule.
const LIKELY_SLIP: f64 = 3.0;
/// Fewer parameters in a model, or fewer tokens in the longest run, are a slip of the unit.
const FEWEST: [f64; 2] = [200.0, 1e5];
/// Every quantity of a point, a value a row; NaN where something it follows from is missing.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Derived {
    pub parameters: Parameters,
    pub budget_declared: bool,
    /// The column or expression that gives the loss.
    pub metric: Metric,
    /// N_nv is under the name of N if that is all that is known.
    pub columns: Vec<(Quantity, Vec<f64>)>,
    pub notes: Vec<String>,
    /// Sentences on likely errors in all rows.
    pub doubts: Vec<String>,
}

/// Fills in missing quantities; `table` is named in errors.
pub(super) fn derive(named: &Named, table: &Table) -> Result<Derived, TableError> {
    let n_rows = named.run_ids.len();
    let missing = |what, remedy| TableError::Missing { what, remedy, columns: table.listed() };
    let given = |quantity| named.numbers.get(&quantity).map(Vec::as_slice);
    let loss = given(Quantity::Loss).ok_or_else(|| missing("loss", "`loss`"))?;
    let (mut notes, mut doubts) = (Vec::new(), Vec::new());
    let model = model_sizes(named, &mut notes).map_err(|(what, remedy)| missing(what, remedy))?;
    let params = zip(&model.nonvocab, &model.vocab, |a, b| a + b);
    let (budget, tokens) = (given(Quantity::BudgetFlops), given(Quantity::Tokens));
    let (budget_flops, tokens) = match (budget, tokens) {
        (Some(c), Some(d)) => (c.to_vec(), d.to_vec()),
        (Some(c), None) => (c.to_vec(), zip(c, &params, |c, n| c / (6.0 * n))),
        (None, Some(d)) => (flops_6nd(&params, d), d.to_vec()),
        (None, None) => return Err(missing("tokens", "`tokens`, or `budget_flops`,")),
    };
    if budget.is_some() && given(Quantity::Tokens).is_some() {
        doubts.extend(unit_slip(&budget_flops, &flops_6nd(&params, &tokens)));
    }
    doubts.extend(too_small(&params, &tokens));
    let all =
        |quantity, otherwise| given(quantity).map_or(vec![otherwise; n_rows], <[f64]>::to_vec);
    let flops = given(Quantity::Flops).map_or_else(|| flops_6nd(&params, &tokens), <[f64]>::to_vec);
    Ok(Derived {
        parameters: model.parameters,
        budget_declared: budget.is_some(),
        metric: named.sources.get(&Quantity::Loss).map_or_else(Metric::default, |m| Metric::new(m)),
        columns: vec![
            (Quantity::Loss, loss.to_vec()),
            (size(model.parameters), model.nonvocab),
            (Quantity::ParamsVocab, model.vocab),
            (Quantity::NVocab, model.n_vocab),
            (Quantity::Tokens, tokens),
            (Quantity::BudgetFlops, budget_flops),
            (Quantity::Flops, flops),
            (Quantity::Seed, all(Quantity::Seed, 0.0)),
            (Quantity::Weight, all(Quantity::Weight, 1.0)),
            (Quantity::Share, all(Quantity::Share, f64::NAN)),
            (Quantity::UniqueTokens, known(all(Quantity::UniqueTokens, f64::NAN))),
        ],
        notes,
        doubts,
    })
}

/// The name of a model's size.
fn size(parameters: Parameters) -> Quantity {
    match parameters {
        Parameters::Split => Quantity::ParamsNonvocab,
        Parameters::Total => Quantity::Params,
    }
}

/// A trainer writes 0 if the value is unknown.
fn known(mut values: Vec<f64>) -> Vec<f64> {
    values.iter_mut().filter(|value| **value == 0.0).for_each(|value| *value = f64::NAN);
    values
}

fn flops_6nd(params: &[f64], tokens: &[f64]) -> Vec<f64> {
    zip(params, tokens, |n, d| 6.0 * n * d)
}

/// A note where budgets and 6 N D differ by more than any FLOP rule explains.
fn unit_slip(budgets: &[f64], flops: &[f64]) -> Option<String> {
    let mut ratios: Vec<f64> =
        zip(budgets, flops, |c, f| c / f).into_iter().filter(|r| r.is_finite()).collect();
    ratios.sort_by(f64::total_cmp);
    let median = *ratios.get(ratios.len() / 2)?;
    let likely = !(1.0 / LIKELY_SLIP..=LIKELY_SLIP).contains(&median);
    likely.then(|| {
        format!(
            "budget_flops is {median:.3e} times 6 N D (median): check the units of params, tokens \
             and budget_flops, and scale them in --columns, as in params=millions*1e6"
        )
    })
}

/// Notes if a table seems to count parameters in millions, or tokens in billions.
fn too_small(params: &[f64], tokens: &[f64]) -> impl Iterator<Item = String> {
    // Rows with other numbers are refused.
    let size = params.iter().copied().filter(|n| *n > 0.0).reduce(f64::min);
    let data = tokens.iter().copied().filter(|n| *n > 0.0).reduce(f64::max);
    let size = size.filter(|n| *n < FEWEST[0]).map(times).map(|n| {
        format!("The smallest model has {n} parameters: if these are millions, say params=column*1e6 in --columns")
    });
    let data = data.filter(|n| *n < FEWEST[1]).map(times).map(|n| {
        format!("No run has more than {n} tokens: if these are billions, say tokens=column*1e9 in --columns")
    });
    size.into_iter().chain(data)
}

// A model's parameters, with and without the vocabulary's, from whatever counts are given.

/// N may differ from N_nv + N_v by this share before a note says so.
const SAME_PARAMS: f64 = 0.01;

/// N_nv, N_v and V.
struct ModelSizes {
    parameters: Parameters,
    nonvocab: Vec<f64>,
    vocab: Vec<f64>,
    n_vocab: Vec<f64>,
}

/// The counts of parameters that the columns given lead to.
fn model_sizes(
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
fn zip(a: &[f64], b: &[f64], of: impl Fn(f64, f64) -> f64) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| of(*a, *b)).collect()
}

/// Names quantities that a table without vocabulary parameters cannot use.
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

// One row into a point, if all of its logarithms exist.

/// The largest whole number below which a float holds every one.
const LARGEST_SEED: f64 = 9_007_199_254_740_992.0;

/// "tokens", with its column or expression if the name differs.
pub(super) fn source(named: &Named, quantity: Quantity) -> String {
    match named.sources.get(&quantity) {
        Some(text) if text != quantity.name() => format!("{quantity} (`{text}`)"),
        Some(_) => quantity.to_string(),
        None => format!("{quantity} (derived)"),
    }
}

impl Derived {
    /// One quantity, a value a row.
    pub fn of(&self, quantity: Quantity) -> &[f64] {
        let own = self.columns.iter().find(|(own, _)| *own == quantity);
        own.map_or(&[], |(_, values)| values)
    }

    /// Every value of a row by the quantity that it is.
    pub fn values(&self, row: usize) -> impl Iterator<Item = (Quantity, f64)> {
        self.columns.iter().map(move |(quantity, values)| (*quantity, values[row]))
    }

    /// The point of a row whose logarithms all exist.
    pub fn checked(&self, row: usize, named: &Named) -> Result<IsoFlopPoint, TableError> {
        let run_id = &named.run_ids[row];
        for (quantity, value) in self.values(row) {
            if let Some(expected) = self.rejects(quantity, value) {
                let source_of = source(named, quantity);
                let run_id = run_id.clone();
                return Err(TableError::BadValue { run_id, source_of, value, expected });
            }
        }
        let at = |quantity| self.of(quantity)[row];
        let known = |quantity| Some(at(quantity)).filter(|value| !value.is_nan());
        Ok(IsoFlopPoint {
            run_id: run_id.clone(),
            seed: at(Quantity::Seed) as u64,
            budget_flops: at(Quantity::BudgetFlops),
            flops: at(Quantity::Flops),
            params_nonvocab: at(size(self.parameters)),
            params_vocab: at(Quantity::ParamsVocab),
            n_vocab: at(Quantity::NVocab),
            tokens: at(Quantity::Tokens),
            metric: self.metric.clone(),
            loss: at(Quantity::Loss),
            weight: at(Quantity::Weight),
            about: RunFacts {
                share: known(Quantity::Share),
                unique_tokens: known(Quantity::UniqueTokens),
                ..RunFacts::default()
            },
        })
    }

    /// The requirement that the value fails; `None` if it is valid.
    fn rejects(&self, quantity: Quantity, value: f64) -> Option<&'static str> {
        let unknown = match quantity {
            Quantity::ParamsVocab | Quantity::NVocab => self.parameters == Parameters::Total,
            // A row that does not say saw all of the data.
            Quantity::Share | Quantity::UniqueTokens => value.is_nan(),
            _ => false,
        };
        let is_seed = (0.0..=LARGEST_SEED).contains(&value) && value.fract() == 0.0;
        match quantity {
            _ if unknown => None,
            Quantity::Loss => (!value.is_finite()).then_some("finite"),
            Quantity::Seed => (!is_seed).then_some("a whole number from 0"),
            _ => (!(value.is_finite() && value > 0.0)).then_some("finite and above 0"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use Quantity::*;

    fn named(values: &[(Quantity, f64)]) -> Named {
        let numbers = values.iter().map(|(quantity, value)| (*quantity, vec![*value])).collect();
        Named { numbers, run_ids: vec!["row 1".into()], ..Named::default() }
    }

    fn derived(values: &[(Quantity, f64)]) -> Derived {
        derive(&named(&[values, &[(Loss, 3.0)]].concat()), &Table::default()).unwrap()
    }

    fn error(values: &[(Quantity, f64)]) -> String {
        derive(&named(values), &Table::default()).unwrap_err().to_string()
    }

    #[test]
    fn the_vocabulary_follows_from_any_two_of_its_three() {
        let rest = [(Tokens, 1e3), (ParamsNonvocab, 100.0)];
        for given in [[(NVocab, 8.0), (DModel, 4.0)], [(ParamsVocab, 32.0), (DModel, 4.0)]] {
            let derived = derived(&[&rest[..], &given].concat());
            assert_eq!((derived.of(ParamsVocab)[0], derived.of(NVocab)[0]), (32.0, 8.0));
            assert_eq!(derived.of(Flops), [6.0 * 132.0 * 1e3]);
            assert_eq!(derived.parameters, Parameters::Split);
        }
    }

    #[test]
    fn non_vocabulary_parameters_are_the_total_less_the_vocabularys() {
        let derived = derived(&[(Params, 132.0), (ParamsVocab, 32.0), (Tokens, 1.0)]);
        assert_eq!((derived.of(ParamsNonvocab)[0], derived.of(NVocab)[0]), (100.0, 32.0));
        assert!(derived.notes[0].contains("V is unknown"));
    }

    #[test]
    fn a_total_alone_is_not_told_apart() {
        let derived = derived(&[(Params, 100.0), (BudgetFlops, 6e5), (NVocab, 8.0)]);
        assert_eq!(derived.parameters, Parameters::Total);
        assert_eq!((derived.of(Params)[0], derived.of(ParamsVocab)[0]), (100.0, 0.0));
        assert_eq!((derived.of(NVocab)[0], derived.of(Tokens)[0]), (0.0, 1e3));
        assert!(derived.notes[0].contains("n_vocab"));
    }

    #[test]
    fn budgets_are_declared_or_what_was_spent() {
        let spent = derived(&[(Params, 100.0), (Tokens, 1e3), (Flops, 7e5)]);
        assert_eq!((spent.of(BudgetFlops)[0], spent.of(Flops)[0]), (6e5, 7e5));
        assert!(!spent.budget_declared);
        let declared = derived(&[(Params, 100.0), (Tokens, 1e3), (BudgetFlops, 8e5)]);
        assert_eq!((declared.of(BudgetFlops)[0], declared.of(Flops)[0]), (8e5, 6e5));
        assert!(declared.budget_declared && declared.notes.is_empty());
    }

    #[test]
    fn budgets_far_from_6nd_are_a_likely_slip_of_the_unit() {
        let slip = derived(&[(Params, 100.0), (Tokens, 1e3), (BudgetFlops, 6e11)]);
        assert!(slip.doubts[0].contains("1.000e6 times 6 N D"), "{:?}", slip.doubts);
    }

    #[test]
    fn counts_of_millions_and_billions_are_a_likely_slip_too() {
        let slip = derived(&[(Params, 70.0), (Tokens, 1.4)]).doubts.join(" ");
        assert!(slip.contains("has 70 parameters") && slip.contains("than 1.4 tokens"), "{slip}");
        assert!(derived(&[(Params, 856.0), (Tokens, 3e5)]).doubts.is_empty());
    }

    #[test]
    fn no_unique_tokens_are_unknown_ones() {
        let one = derived(&[(Params, 1e6), (Tokens, 1e7), (UniqueTokens, 0.0)]);
        assert!(one.of(UniqueTokens)[0].is_nan());
    }

    #[test]
    fn what_is_missing_is_named_with_what_would_do() {
        assert!(error(&[]).contains("no loss: name `loss`"));
        assert!(error(&[(Loss, 3.0)]).contains("no parameters: name `params`"));
        assert!(error(&[(Loss, 3.0), (Params, 1.0)]).contains("no tokens: name `tokens`"));
        assert!(error(&[(Loss, 3.0), (ParamsNonvocab, 1.0)]).contains("`params_vocab`, or"));
        assert!(error(&[(Loss, 3.0), (ParamsVocab, 1.0)]).contains("`params_nonvocab` or"));
    }

    proptest::proptest! {
        #[test]
        fn the_flops_are_the_budget_whichever_is_left_out(n in 1e3..1e12f64, d in 1e3..1e13f64) {
            let c = 6.0 * n * d;
            let from_tokens = derived(&[(Params, n), (Tokens, d)]);
            let from_budget = derived(&[(Params, n), (BudgetFlops, c)]);
            for derived in [from_tokens, from_budget] {
                for flops in [derived.of(Flops)[0], derived.of(BudgetFlops)[0]] {
                    proptest::prop_assert!((flops / c - 1.0).abs() < 1e-14);
                }
                proptest::prop_assert!((derived.of(Tokens)[0] / d - 1.0).abs() < 1e-14);
            }
        }
    }
}
