//! Tables there and back, with columns and cells missing.

use super::*;
use crate::record::tests::{of_format_1, whole};

/// A table as another build may have written it.
fn rewritten(
    records: &[RunRecord],
    change: impl FnOnce(&mut DataFrame),
) -> Result<Vec<RunRecord>, String> {
    let place = tempfile::tempdir().unwrap();
    let mut frame = frame(records).unwrap();
    change(&mut frame);
    let file = File::create(place.path().join("runs.parquet")).unwrap();
    ParquetWriter::new(file).finish(&mut frame).unwrap();
    read(place.path()).map_err(|error| error.to_string())
}

fn drop_columns(frame: &mut DataFrame, names: &[&str]) {
    *frame = frame.drop_many(names.iter().copied());
}

#[test]
fn a_table_reads_back_equal_with_its_nulls_and_metrics_that_nobody_declared() {
    let mut sparse = of_format_1();
    sparse.measured.wall_s = None;
    sparse.metrics = [("nats_per_second", 1.5)].into_iter().collect();
    let records = [whole(), of_format_1(), sparse];
    let place = tempfile::tempdir().unwrap();
    write(place.path(), &records).unwrap();
    assert_eq!(read(place.path()).unwrap(), records);
    // The CSV stands in for it where it alone was kept.
    std::fs::remove_file(place.path().join("runs.parquet")).unwrap();
    assert_eq!(read(place.path()).unwrap(), records);
}

#[test]
fn the_columns_are_those_of_format_1_then_the_new_ones_then_other_metrics() {
    let place = tempfile::tempdir().unwrap();
    write(place.path(), &[whole(), of_format_1()]).unwrap();
    let csv = std::fs::read_to_string(place.path().join("runs.csv")).unwrap();
    let rows: Vec<Vec<&str>> = csv.lines().map(|line| line.split(',').collect()).collect();
    let file = include_str!("../../../tests/fixtures/record-format-1.json");
    let mut expected: Vec<&str> = file.lines().filter_map(|line| line.split('"').nth(1)).collect();
    assert_eq!((expected[0], expected.len()), ("run_id", 34));
    expected.extend(["generator", "tokenizer_kind", "quantizer", "varied", "share", "fid"]);
    assert_eq!(rows[0], expected);
    assert_eq!(
        rows[1][34..],
        ["autoregressive", "convolutional", "vq", "train.lr=0.001", "0.5", "0.25"]
    );
    assert_eq!(rows[2][34..], [""; 6], "what the older record lacks is empty");
    assert!(rows[2][..34].iter().all(|cell| !cell.is_empty()));
}

#[test]
fn a_missing_column_reads_as_null() {
    let names = ["lr", "device", "peak_bytes", "loss_nats"];
    let read = rewritten(&[whole(), whole()], |frame| drop_columns(frame, &names)).unwrap();
    let mut expected = whole();
    (expected.planned.lr, expected.measured.device, expected.measured.peak_bytes) =
        (None, None, None);
    let others = whole();
    let others = others.metrics.iter().filter(|(name, _)| *name != "loss_nats");
    expected.metrics = others.map(|(name, value)| (name.to_string(), value)).collect();
    assert_eq!(read, [expected.clone(), expected]);
}

#[test]
fn an_unknown_column_of_numbers_is_a_metric_and_any_other_is_passed_over() {
    let add = |frame: &mut DataFrame| {
        frame.with_column(Column::new("diversity".into(), [Some(2.5), None])).unwrap();
        frame.with_column(Column::new("host".into(), ["a", "b"])).unwrap();
        frame.with_column(Column::new("gpus".into(), [1u64, 2])).unwrap();
    };
    let read = rewritten(&[whole(), whole()], add).unwrap();
    let mut measured = whole();
    measured.metrics.set("diversity", 2.5);
    assert_eq!(read, [measured, whole()]);
}

#[test]
fn a_table_without_what_a_row_is_nothing_without_is_refused() {
    let refused = |change: fn(&mut DataFrame)| rewritten(&[whole(), whole()], change).unwrap_err();
    let error = refused(|frame| drop_columns(frame, &["tokens"]));
    assert!(error.contains("runs.parquet: ") && error.contains("tokens"), "{error}");
    let error = refused(|frame| {
        frame.with_column(Column::new("n_vocab".into(), [Some(64u64), None])).unwrap();
    });
    assert!(error.contains("column n_vocab has an empty cell"), "{error}");
    let error = refused(|frame| drop_columns(frame, LOSSES));
    assert!(error.contains("row 1 has none of the losses loss_nats, "), "{error}");
}
