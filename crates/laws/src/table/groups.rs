//! The groups of a column, whose rows are fitted apart.

use super::group::{Group, distinct};
use super::nearest::hint;
use super::rows::filtered;
use super::{Table, TableError, TableRequest};

/// The groups of `column` among the rows that pass the filters, in the table's order. Rows whose
/// cell is empty are in none.
///
/// # Errors
/// [`TableError::NoColumn`] with the nearest name; a filter that does not fit the table.
pub fn groups(
    table: &Table,
    request: &TableRequest,
    column: &str,
) -> Result<Vec<Group>, TableError> {
    let cells = table.column(column).ok_or_else(|| TableError::NoColumn {
        name: column.to_string(),
        hint: hint(column, table.names()),
        columns: table.listed(),
    })?;
    let rows = filtered(table, &TableRequest { group: None, ..request.clone() }, &mut Vec::new())?;
    let values = distinct(cells, &rows);
    if values.is_empty() {
        return Err(TableError::NoGroups(column.to_string()));
    }
    Ok(values.into_iter().map(|value| Group { column: column.to_string(), value }).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::table::{Column, load};

    /// Two experiments of four rows at one budget.
    fn table() -> Table {
        let number = |name: &str, of: fn(usize) -> f64| {
            (name.to_string(), Column::Number((0..8).map(of).collect()))
        };
        let text = |name: &str, of: fn(usize) -> String| {
            (name.to_string(), Column::Text((0..8).map(of).collect()))
        };
        Table {
            columns: vec![
                number("params", |i| 1e6 * 2f64.powi(i as i32 % 4)),
                number("budget_flops", |_| 1e15),
                number("loss", |i| 3.0 + i as f64),
                number("size", |i| (i % 2) as f64),
                text("experiment", |i| ["ours", "theirs"][i / 4].to_string()),
                text("run", |i| format!("run {i}")),
            ],
            n_rows: 8,
            notes: vec![],
        }
    }

    #[test]
    fn rows_of_a_group_alone_are_loaded_under_their_own_numbers() {
        let request = TableRequest { filters: vec!["loss > 3".into()], ..TableRequest::default() };
        let all = groups(&table(), &request, "experiment").unwrap();
        assert_eq!(all.iter().map(|group| &*group.value).collect::<Vec<_>>(), ["ours", "theirs"]);
        let request = TableRequest { group: Some(all[1].clone()), ..request };
        let loaded = load(&table(), &request).unwrap();
        assert_eq!(loaded.points.len(), 4);
        assert_eq!(loaded.points[0].run_id, "row 5");
        let sizes = groups(&table(), &TableRequest::default(), "size").unwrap();
        assert_eq!(sizes.iter().map(|group| &*group.value).collect::<Vec<_>>(), ["0", "1"]);
    }

    #[test]
    fn a_column_that_is_not_there_is_told_with_the_nearest() {
        let error = groups(&table(), &TableRequest::default(), "experimnet").unwrap_err();
        assert!(error.to_string().contains("did you mean `experiment`?"), "{error}");
    }

    #[test]
    fn experiments_that_share_a_budget_are_told_and_fitted_apart_they_are_not() {
        let notes = |request: &TableRequest| load(&table(), request).unwrap().notes.join("\n");
        let all = notes(&TableRequest::default());
        assert!(
            all.contains("`experiment` has 2 values") && all.contains("--by experiment fits each")
        );
        let one = Group { column: "experiment".into(), value: "ours".into() };
        let one = notes(&TableRequest { group: Some(one), ..TableRequest::default() });
        assert!(!one.contains("--by"), "{one}");
        let columns = Some("budget_flops=10^(15+size)".to_string());
        let mut apart = table();
        apart.columns[3].1 = Column::Number((0..8).map(|i| (i / 4) as f64).collect());
        let notes =
            load(&apart, &TableRequest { columns, ..TableRequest::default() }).unwrap().notes;
        assert!(!notes.join("\n").contains("--by"), "{notes:?}");
    }
}
