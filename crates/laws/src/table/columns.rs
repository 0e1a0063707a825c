//! `--columns name=expression,…`: maps the columns of a table to quantities.

use std::collections::BTreeMap;

use super::{Expression, Quantity, Table, TableError};
use crate::laws::LOSS_NORMALISED;

/// The columns of one table by quantity.
#[derive(Clone, Debug, Default)]
pub(super) struct Named {
    pub numbers: BTreeMap<Quantity, Vec<f64>>,
    /// The name of each row in messages.
    pub run_ids: Vec<String>,
    /// The source of each quantity, for messages.
    pub sources: BTreeMap<Quantity, String>,
    pub notes: Vec<String>,
}

/// Reads `--columns`, and takes the columns that are themselves named as a quantity.
pub(super) fn named(columns: Option<&str>, table: &Table) -> Result<Named, TableError> {
    let chosen = given(columns.unwrap_or(""), table)?;
    let run_ids = (1..=table.n_rows).map(|row| format!("row {row}")).collect();
    let mut named = Named { run_ids, ..Named::default() };
    let taken = implicit(&chosen, table);
    if !taken.is_empty() {
        let taken: Vec<_> = taken.iter().map(|(quantity, e)| shown(*quantity, e.text())).collect();
        named.notes.push(format!("columns taken by their own names: {}", taken.join(", ")));
    }
    for (quantity, expression) in chosen {
        let failed = |error| TableError::Column { quantity, error };
        evaluate(quantity, &expression, table, &mut named).map_err(failed)?;
    }
    for (quantity, expression) in taken {
        let failed = |error| TableError::Implicit { quantity, error };
        evaluate(quantity, &expression, table, &mut named).map_err(failed)?;
    }
    Ok(named)
}

fn shown(quantity: Quantity, column: &str) -> String {
    if column == quantity.name() { column.to_string() } else { format!("{quantity} = {column}") }
}

fn evaluate(
    quantity: Quantity,
    expression: &Expression,
    table: &Table,
    named: &mut Named,
) -> Result<(), super::ExpressionError> {
    named.sources.insert(quantity, expression.text().to_string());
    if quantity != Quantity::RunId {
        named.numbers.insert(quantity, expression.numbers(table)?);
        return Ok(());
    }
    let given = expression.texts(table)?.into_iter().zip(&mut named.run_ids);
    given.filter(|(text, _)| !text.is_empty()).for_each(|(text, id)| *id = text);
    Ok(())
}

/// The entries of `--columns`, in order.
fn given(text: &str, table: &Table) -> Result<Vec<(Quantity, Expression)>, TableError> {
    let mut chosen: Vec<(Quantity, Expression)> = Vec::new();
    for part in split(text) {
        let (quantity, expression) = assignment(part.trim(), table)?;
        if chosen.iter().any(|(of, _)| *of == quantity) {
            return Err(TableError::Repeated(quantity));
        }
        chosen.push((quantity, expression));
    }
    Ok(chosen)
}

fn assignment(part: &str, table: &Table) -> Result<(Quantity, Expression), TableError> {
    let sides = part.split_once('=').map(|(name, of)| (name.trim(), of.trim()));
    let sides = sides.filter(|(_, expression)| !expression.is_empty());
    let (name, text) = sides.ok_or_else(|| TableError::NotAnAssignment(part.to_string()))?;
    let quantity = name.parse()?;
    let failed = |error| TableError::Column { quantity, error };
    let expression = match Expression::column(text, table) {
        Some(column) => column,
        None => Expression::parse(text, table).map_err(failed)?,
    };
    Ok((quantity, expression))
}

/// Splits at commas outside parentheses, quotes and backticks; a last comma ends the last part.
fn split(text: &str) -> Vec<&str> {
    let (mut depth, mut quote, mut start, mut parts) = (0usize, None, 0, Vec::new());
    for (i, c) in text.char_indices() {
        match (quote, c) {
            (Some(open), _) => quote = (c != open).then_some(open),
            (None, '"' | '\'' | '`') => quote = Some(c),
            (None, '(') => depth += 1,
            (None, ')') => depth = depth.saturating_sub(1),
            (None, ',') if depth == 0 => {
                parts.push(&text[start..i]);
                start = i + 1;
            }
            _ => (),
        }
    }
    if !text[start..].trim().is_empty() {
        parts.push(&text[start..]);
    }
    parts
}

/// Columns named like a quantity that `--columns` does not give; a sweep's table names its loss [`LOSS_NORMALISED`],
/// and budgets may be named `budget`.
///
/// If `--columns` gives N, a column N_nv is ignored: the two could disagree.
fn implicit(given: &[(Quantity, Expression)], table: &Table) -> Vec<(Quantity, Expression)> {
    let is_given = |quantity| given.iter().any(|(of, _)| *of == quantity);
    let mut taken = Vec::new();
    for (name, quantity) in Quantity::ALL {
        let disagrees = quantity == Quantity::ParamsNonvocab && is_given(Quantity::Params)
            || quantity == Quantity::Params && is_given(Quantity::ParamsNonvocab);
        let other = match quantity {
            Quantity::Loss => Some(LOSS_NORMALISED),
            Quantity::BudgetFlops => Some("budget"),
            _ => None,
        };
        let mut names = [Some(name), other].into_iter().flatten();
        let column = names.find_map(|name| Expression::column(name, table));
        if let Some(column) = column.filter(|_| !is_given(quantity) && !disagrees) {
            taken.push((quantity, column));
        }
    }
    taken
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::table::Column;

    fn table() -> Table {
        let number = |name: &str| (name.to_string(), Column::Number(vec![1.0, 2.0]));
        let names =
            ["Model Size", "a,b", "6N/D", "loss_normalised", "tokens", "params_nonvocab", "budget"];
        let mut columns: Vec<_> = names.into_iter().map(number).collect();
        columns.push(("name".into(), Column::Text(vec!["first".into(), String::new()])));
        Table { columns, n_rows: 2, notes: vec![] }
    }

    fn error(columns: &str) -> String {
        named(Some(columns), &table()).unwrap_err().to_string()
    }

    #[test]
    fn commas_part_only_outside_parentheses_quotes_and_backticks() {
        let parts = split("a=max(b,c), d=`a,b`,e=f == 'x,y' ,");
        assert_eq!(parts, ["a=max(b,c)", " d=`a,b`", "e=f == 'x,y' "]);
    }

    #[test]
    fn an_expression_is_evaluated_and_a_columns_exact_name_is_the_column() {
        let named = named(Some("params=Model Size*1e6,weight=6N/D,run_id=name"), &table()).unwrap();
        assert_eq!(named.numbers[&Quantity::Params], [1e6, 2e6]);
        assert_eq!(named.numbers[&Quantity::Weight], [1.0, 2.0]);
        assert_eq!(named.run_ids, ["first", "row 2"]);
    }

    #[test]
    fn columns_named_as_a_quantity_are_taken_and_said() {
        let named = named(Some("tokens=Model Size"), &table()).unwrap();
        let note = "columns taken by their own names: params_nonvocab, budget_flops = budget, loss = loss_normalised";
        assert_eq!(named.notes, [note]);
        assert_eq!(named.numbers[&Quantity::Loss], [1.0, 2.0]);
    }

    #[test]
    fn a_given_total_keeps_a_column_of_non_vocabulary_parameters_out() {
        let named = named(Some("params=Model Size"), &table()).unwrap();
        assert!(!named.numbers.contains_key(&Quantity::ParamsNonvocab));
    }

    #[test]
    fn what_is_wrong_with_the_argument_is_named() {
        assert!(error("parms=tokens").contains("did you mean `params`? valid: params, "));
        assert!(error("loss=tokens,loss=tokens").contains("loss twice"));
        assert!(error("loss").contains("`loss` is not of the form"));
        assert!(error("loss=").contains("`loss=` is not of the form"));
        let text = error("loss=name");
        assert!(text.contains("column `name` is text (row 1 is `first`)"), "{text}");
    }
}
