//! Tables made elsewhere, and the expressions over them.

use std::fs;
use std::path::Path;

use isoflop::table::{self, Column, Expression, OutlierStage, Table, TableRequest};

use super::{bundle, bytes_of, first_lines, part, words};
use crate::harness::Kind;
use crate::mutate;

pub const CSV: Kind =
    Kind { name: "csv", file: "a.bundle", seeds: csvs, mutate: mutate::text, read: csv };
pub const PARQUET: Kind = Kind {
    name: "parquet",
    file: "a.parquet",
    seeds: parquets,
    mutate: mutate::binary,
    read: parquet,
};
pub const EXPRESSION: Kind = Kind {
    name: "expression",
    file: "expression",
    seeds: expressions,
    mutate: mutate::text,
    read: expression,
};

fn csvs(_: &Path) -> Vec<Vec<u8>> {
    let with = |csv: Vec<u8>, columns: &str, filter: &str, stages: &str| {
        let csv = String::from_utf8(csv).expect("a CSV file of text");
        bundle(&[
            ("table", csv.as_str()),
            ("columns", columns),
            ("where", filter),
            ("stages", stages),
        ])
    };
    let theirs =
        "size_m;C;ce;who\n10;1,5e17;3,9;a\n20;1e17;3.7;b\n7M;1e17;\"3,8\";a\n40M;2E18;3.1;b\n";
    let runs = || first_lines("results/cmu-motion/runs.csv", 6);
    vec![
        with(theirs.into(), "params=size_m*1,budget_flops=C,loss=ce", "", ""),
        with(
            first_lines("tests/fixtures/losses/cmu-small.csv", 8),
            "params_nonvocab=12*n_layer*d_model^2,loss=loss_normalised",
            "",
            "",
        ),
        with(runs(), "loss=loss_nats", "n_vocab > 10 and d_model < 100", ""),
        with(runs(), "", "", "duplicates"),
    ]
}

fn csv(path: &Path) -> Result<(), String> {
    let bytes = fs::read(path).expect("just written");
    let csv = path.with_extension("csv");
    fs::write(&csv, part(&bytes, "table")).expect("a writable folder");
    let line = |name: &str| String::from_utf8_lossy(&part(&bytes, name)).trim().to_string();
    let some = |name: &str| Some(line(name)).filter(|text| !text.is_empty());
    let stages = line("stages");
    let named = stages.split(',').filter(|name| !name.is_empty());
    let outliers =
        named.map(|name| name.parse::<OutlierStage>().map_err(words)).collect::<Result<_, _>>()?;
    let table = table::read(&csv).map_err(words)?;
    sound(&table);
    let request = TableRequest {
        columns: some("columns"),
        filters: some("where").into_iter().collect(),
        outliers,
        ..TableRequest::default()
    };
    loaded(&table, &request)
}

/// Columns of one length.
fn sound(table: &Table) {
    for (name, column) in &table.columns {
        let n = match column {
            Column::Number(cells) => cells.len(),
            Column::Text(cells) => cells.len(),
            Column::Written { numbers, cells } => {
                assert_eq!(numbers.len(), cells.len());
                cells.len()
            }
        };
        assert_eq!(n, table.n_rows, "column {name}");
    }
}

/// The points of a table are numbers.
fn loaded(table: &Table, request: &TableRequest) -> Result<(), String> {
    let loaded = table::load(table, request).map_err(words)?;
    for point in &loaded.points {
        let numbers =
            [point.budget_flops, point.flops, point.params_nonvocab, point.tokens, point.loss];
        assert!(numbers.iter().all(|x| x.is_finite()), "{point:?}");
    }
    Ok(())
}

fn parquets(place: &Path) -> Vec<Vec<u8>> {
    let small = (crate::kinds::runs::RUNS_PARQUET.seeds)(place);
    small.into_iter().chain([bytes_of("results/quality/runs.parquet")]).collect()
}

fn parquet(path: &Path) -> Result<(), String> {
    let table = table::read(path).map_err(words)?;
    sound(&table);
    let _ = loaded(&table, &TableRequest::default());
    Ok(())
}

fn expressions(_: &Path) -> Vec<Vec<u8>> {
    let all = [
        "size*1e6 + 2^-3 - log10(loss) / exp(1)",
        "loss < 4 and not (who == \"a\" or who in [\"b\", \"c\"])",
        "who != 'a'",
        "min(size, 3) + max(loss, 2) - sqrt(abs(size))",
        "`model size` > 7M",
        "size",
    ];
    let table = small_table();
    let all = all.into_iter().filter(|text| Expression::parse(text, &table).is_ok());
    all.map(|text| text.as_bytes().to_vec()).collect()
}

fn small_table() -> Table {
    let texts = |all: [&str; 3]| all.map(String::from).to_vec();
    let written =
        Column::Written { numbers: vec![7e6, f64::NAN, 0.0], cells: texts(["7M", "", "0"]) };
    let columns = [
        ("size", Column::Number(vec![1.0, -0.0, f64::NAN])),
        ("loss", Column::Number(vec![3.0, f64::INFINITY, 1e300])),
        ("who", Column::Text(texts(["a", "b", ""]))),
        ("model size", written),
    ];
    let columns = columns.into_iter().map(|(name, column)| (name.to_string(), column)).collect();
    Table { columns, n_rows: 3, notes: Vec::new() }
}

fn expression(path: &Path) -> Result<(), String> {
    let bytes = fs::read(path).expect("just written");
    let table = small_table();
    let expression = Expression::parse(&String::from_utf8_lossy(&bytes), &table).map_err(words)?;
    assert_eq!(expression.mask(&table).map_err(words)?.len(), table.n_rows);
    Ok(())
}
