//! Each rule, what is missing, and that FLOPs(N, D) = C whichever is left out.

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
