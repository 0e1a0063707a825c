//! The language, its errors, and that any text is either understood or refused.

use proptest::prelude::*;

use super::*;
use crate::table::Column;

fn table() -> Table {
    let number = |name: &str, values: [f64; 3]| (name.to_string(), Column::Number(values.into()));
    let names = ["first", "", "second"].map(Into::into);
    let columns = vec![
        number("a", [1.0, 2.0, f64::NAN]),
        number("b", [4.0, 0.0, 8.0]),
        number("a-b", [10.0, 20.0, 30.0]),
        number("Model", [0.5, 0.5, 0.5]),
        number("Model Size", [7.0, 70.0, 400.0]),
        number("max", [3.0, 3.0, 3.0]),
        number("loss (nats)", [5.0, 6.0, 7.0]),
        number("and so on", [1.0, 0.0, 1.0]),
        number("N/D", [2.0, 2.0, 2.0]),
        ("experiment".to_string(), Column::Text(Vec::from(names))),
    ];
    Table { columns, n_rows: 3, notes: vec![] }
}

fn first(text: &str) -> f64 {
    let expression = Expression::parse(text, &table()).unwrap_or_else(|e| panic!("{e}"));
    expression.numbers(&table()).unwrap()[0]
}

fn mask(text: &str) -> Vec<bool> {
    let expression = Expression::parse(text, &table()).unwrap_or_else(|e| panic!("{e}"));
    expression.mask(&table()).unwrap()
}

fn error(text: &str) -> String {
    Expression::parse(text, &table()).unwrap_err().to_string()
}

#[test]
fn operators_bind_as_the_table_says() {
    let truths = [
        ("2+3*4", 14.0),
        ("(2+3)*4", 20.0),
        ("2^3^2", 512.0),
        ("-2^2", -4.0),
        ("2^-1", 0.5),
        ("2^-1*6", 3.0),
        ("8/4/2", 1.0),
        ("8-4-2", 2.0),
        ("1e9*1.5e-3", 1.5e6),
        (".5+1.", 1.5),
        ("not 1 == 2", 1.0),
        ("not 1 and 0", 0.0),
        ("not (1 and 0)", 1.0),
        ("1 or 0 and 0", 1.0),
        ("1+1 == 2 && !(2 < 1) || false", 1.0),
        ("not not 5", 1.0),
        ("2 = 2", 1.0),
        ("-a", -1.0),
        ("- -a", 1.0),
    ];
    for (text, value) in truths {
        assert_eq!(first(text), value, "{text}");
    }
}

#[test]
fn functions_take_one_argument_but_min_and_max_take_several() {
    let values = [
        ("ln(exp(2))", 2.0),
        ("log10(1e3)", 3.0),
        ("log2(8)", 3.0),
        ("sqrt(9)+abs(-1)", 4.0),
        ("round(2.5)+floor(-0.5)+ceil(0.5)", 3.0),
        ("max(1,2,-3)*min (4, 3)", 6.0),
    ];
    for (text, value) in values {
        assert!((first(text) - value).abs() < 1e-12, "{text}");
    }
}

#[test]
fn the_longest_column_name_that_fits_is_taken() {
    let values = [
        ("Model Size*1e6", 7e6),
        ("Model*2", 1.0),
        ("a-b", 10.0),
        ("a - b", -3.0),
        ("`a`-b", -3.0),
        ("max+max(1,2)", 5.0),
        ("loss (nats)+1", 6.0),
        ("and so on and and so on", 1.0),
        ("`N/D`*2", 4.0),
        ("(Model Size)", 7.0),
    ];
    for (text, value) in values {
        assert_eq!(first(text), value, "{text}");
    }
}

#[test]
fn what_is_missing_stays_missing_and_fails_a_filter() {
    for text in ["a > 0", "not (a > 0)", "a^0 == 1", "max(a, 1) == 1", "a or true", "1 == 1^a"] {
        assert!(!mask(text)[2], "{text}");
    }
    assert_eq!(mask("ln(b - 1) > -9"), [true, false, true]);
    assert_eq!(mask("true"), [true; 3]);
}

#[test]
fn texts_are_compared_and_an_empty_cell_is_missing() {
    assert_eq!(mask("experiment == \"first\""), [true, false, false]);
    assert_eq!(mask("experiment != 'first'"), [false, false, true]);
    assert_eq!(mask("experiment == ''"), [false, true, false]);
    assert_eq!(mask("experiment == experiment"), [true, false, true]);
    assert_eq!(mask("'it''s' = \"it's\""), [true; 3]);
}

#[test]
fn an_error_shows_the_place_and_the_nearest_name() {
    let columns = "columns: `a`, `b`, `a-b`, `Model`, `Model Size`, `max`, `loss (nats)`, \
                   `and so on`, `N/D`, `experiment`";
    let expected = format!(
        "no column is named `Modle Size`; did you mean `Model Size`? {columns}\n  \
         1e6*Modle Size + a\n      ^^^^^^^^^^"
    );
    assert_eq!(error("1e6*Modle Size + a"), expected);
    assert!(error("experiment = first").contains("did you mean the text 'first'? "));
    let expected =
        "a text is compared with a number\n  a and experiment == 3\n        ^^^^^^^^^^^^^^^";
    assert_eq!(error("a and experiment == 3"), expected);
}

#[test]
fn each_way_to_be_wrong_has_its_message() {
    let messages = [
        ("", "missing here"),
        ("1+", "missing here"),
        ("*2", "missing here"),
        ("6a", "operator is missing"),
        ("a b", "operator is missing"),
        ("(1+2", "never closed"),
        ("1)", "nothing opens"),
        ("max(1", "never closed"),
        ("max(1)", "two arguments or more, not 1"),
        ("ln(1,2)", "one argument, not 2"),
        ("logg(1)", "did you mean `log2`"),
        ("1 < a < 3", "do not chain"),
        ("1 + not a", "binds less"),
        ("experiment*2", "is text"),
        ("'x'", "a text can only be compared"),
        ("-'x'", "a text can only be compared"),
        ("experiment < 'x'", "a text can only be compared"),
        ("'open", "never closed"),
        ("a # b", "`#` has no meaning"),
        ("`nothing`", "no column is named `nothing`"),
        (".", "`.` is not a number"),
    ];
    for (text, message) in messages {
        let parsed = Expression::parse(text, &table()).and_then(|e| e.numbers(&table()));
        let error = parsed.expect_err(text).to_string();
        assert!(error.contains(message), "{text}: {error}");
    }
}

#[test]
fn nesting_has_a_limit_instead_of_exhausting_the_stack() {
    let deep = ["(".repeat(100_000), "-".repeat(100_000), format!("1{}", "+1".repeat(100_000))];
    for text in deep {
        assert!(
            Expression::parse(&text, &table()).unwrap_err().to_string().starts_with("more than")
        );
    }
    assert_eq!(first(&format!("1{}", "+1".repeat(150))), 151.0);
}

#[test]
fn a_table_without_the_column_is_refused() {
    let expression = Expression::parse("Model Size", &table()).unwrap();
    let error = expression.numbers(&Table::default()).unwrap_err().to_string();
    assert!(error.contains("no column `Model Size`"), "{error}");
}

/// An expression as it is written, and its value in the first row.
#[derive(Clone, Debug)]
struct Written {
    text: String,
    value: f64,
    /// How tightly its outermost operator binds; atoms most.
    power: u8,
}

/// The text in the fewest parentheses, for a place that needs `least`.
fn within(part: &Written, least: u8) -> String {
    if part.power < least { format!("({})", part.text) } else { part.text.clone() }
}

fn atom() -> impl Strategy<Value = Written> {
    let columns = [("a", 1.0), ("a-b", 10.0), ("`N/D`", 2.0), ("Model Size", 7.0), ("max", 3.0)];
    let column = prop::sample::select(columns.to_vec());
    let column = column.prop_map(|(text, value)| (text.to_string(), value));
    let number = (-9.0..9.0f64).prop_map(|x| (format!("{:e}", x.abs()), x.abs()));
    prop_oneof![column, number].prop_map(|(text, value)| Written { text, value, power: 20 })
}

fn infix((left, symbol, right): (Written, usize, Written)) -> Written {
    let truth = |holds: bool| f64::from(u8::from(holds));
    let (a, b) = (left.value, right.value);
    let (symbol, power, value) = [
        (" or ", 1, truth(a != 0.0 || b != 0.0)),
        ("&&", 2, truth(a != 0.0 && b != 0.0)),
        (" <= ", 4, truth(a <= b)),
        ("!=", 4, truth(a != b)),
        (" + ", 5, a + b),
        (" - ", 5, a - b),
        ("*", 6, a * b),
        (" / ", 6, a / b),
        ("^", 8, a.powf(b)),
    ][symbol];
    let value = if a.is_nan() || b.is_nan() { f64::NAN } else { value };
    let (least_left, least_right) = match power {
        4 => (5, 5),
        8 => (9, 7),
        _ => (power, power + 1),
    };
    let text = format!("{}{symbol}{}", within(&left, least_left), within(&right, least_right));
    Written { text, value, power }
}

fn written() -> impl Strategy<Value = Written> {
    atom().prop_recursive(6, 40, 2, |part| {
        let negate = part.clone().prop_map(|of| Written {
            text: format!("-{}", within(&of, 7)),
            value: -of.value,
            power: 7,
        });
        let not = part.clone().prop_map(|of| Written {
            text: format!("not {}", within(&of, 3)),
            value: if of.value.is_nan() { f64::NAN } else { f64::from(u8::from(of.value == 0.0)) },
            power: 3,
        });
        let call = part.clone().prop_map(|of| Written {
            text: format!("abs( {} )", of.text),
            value: of.value.abs(),
            power: 20,
        });
        let infix = (part.clone(), 0..9usize, part).prop_map(infix);
        prop_oneof![4 => infix, 1 => negate, 1 => not, 1 => call]
    })
}

/// Evaluates what can be read and shows what cannot.
fn understood_or_refused(text: &str) {
    let parsed = Expression::parse(text, &table()).and_then(|e| e.mask(&table()));
    let _ = parsed.map_err(|error| error.to_string());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn a_tree_printed_with_the_fewest_parentheses_reads_back_to_its_value(tree in written()) {
        let found = first(&tree.text);
        let same = found == tree.value || found.is_nan() && tree.value.is_nan();
        prop_assert!(same, "{}: {found} is not {}", tree.text, tree.value);
    }

    #[test]
    fn any_text_is_understood_or_refused(text in "\\PC{0,40}") {
        understood_or_refused(&text);
    }

    #[test]
    fn any_string_of_words_is_understood_or_refused(
        words in prop::collection::vec(prop::sample::select(vec![
            "a", "b", "Model Size", "experiment", "not ", " and ", " or ", "(", ")", ",", "'x'", "-",
            "^", "*", "<", "==", "1e9", "max(", "ln(", "`a`", " ", "é", "\t", "2.5.5", "&&", "!",
        ]), 0..24),
    ) {
        let text = words.concat();
        understood_or_refused(&text);
    }
}
