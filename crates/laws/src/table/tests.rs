//! Whole tables: the order of the steps, the messages on rows, and the published tables.

use proptest::prelude::*;
use std::fmt::Write;
use std::path::PathBuf;

use super::*;
use crate::laws::{IsoFlopPoint, Metric, Parameters, RunFacts, simulated};

fn table(columns: &[(&str, &[f64])]) -> Table {
    let n_rows = columns[0].1.len();
    let column =
        |(name, cells): &(&str, &[f64])| (name.to_string(), Column::Number(cells.to_vec()));
    Table { columns: columns.iter().map(column).collect(), n_rows, notes: vec![] }
}

fn runs() -> Table {
    table(&[
        ("params", &[1e6, 2e6, 3e6, 4e6, 5e6]),
        ("tokens", &[1e9, 1e9, 1e9, 1e9, f64::NAN]),
        ("loss", &[3.0, 2.0, 5.0, 4.0, 9.0]),
        ("group", &[1.0, 1.0, 1.0, 0.0, 1.0]),
    ])
}

fn request(columns: &str, filters: &[&str]) -> TableRequest {
    let filters = filters.iter().map(ToString::to_string).collect();
    TableRequest { columns: Some(columns.to_string()), filters, ..TableRequest::default() }
}

fn error(table: &Table, request: &TableRequest) -> String {
    load(table, request).unwrap_err().to_string()
}

#[test]
fn a_point_says_which_column_or_expression_its_loss_is() {
    let metric = |columns: &str| {
        let loaded = load(&runs(), &request(columns, &[])).unwrap();
        loaded.points[0].metric.name().to_string()
    };
    assert_eq!(
        [metric(""), metric("loss=group"), metric("loss=loss-1")],
        ["loss", "group", "loss-1"]
    );
}

#[test]
fn filters_come_first_then_what_is_missing_then_the_highest_losses() {
    let request = TableRequest { drop_highest: 1, ..request("", &["group == 1"]) };
    let loaded = load(&runs(), &request).unwrap();
    let ids: Vec<_> = loaded.points.iter().map(|point| point.run_id.as_str()).collect();
    assert_eq!(ids, ["row 1", "row 2"]);
    let dropped: Vec<_> =
        loaded.dropped.iter().map(|row| format!("{} {}", row.run_id, row.stage)).collect();
    assert_eq!(dropped, ["row 5 missing", "row 3 drop-highest"]);
    assert_eq!(loaded.dropped[0].reason, "tokens is missing");
    assert!(loaded.notes.contains(&"--where group == 1: 4 of 5 rows pass".to_string()));
    assert!(!loaded.budget_declared);
}

#[test]
fn copies_of_a_row_are_no_further_runs_and_are_named() {
    let once = runs();
    let ten = |cells: &[f64]| cells.repeat(10);
    let columns = once.columns.iter().map(|(name, column)| match column {
        Column::Number(cells) => (name.clone(), Column::Number(ten(cells))),
        _ => panic!("numbers alone"),
    });
    let copied = Table { columns: columns.collect(), n_rows: 50, notes: vec![] };
    let [once, copied] = [once, copied].map(|table| load(&table, &request("", &[])).unwrap());
    assert_eq!(once.points, copied.points);
    let copies = copied.dropped.iter().filter(|row| row.stage == DropStage::Copy);
    assert_eq!(copies.clone().count(), 45);
    let first = copies.clone().next().unwrap();
    assert!(first.run_id == "row 6" && first.reason.starts_with("it is row 1 again"), "{first:?}");
}

#[test]
fn a_missing_cell_that_nothing_needs_drops_no_row() {
    let mut table = runs();
    table.columns.push(("d_model".into(), Column::Number(vec![f64::NAN; 5])));
    let loaded = load(&table, &request("", &["group == 1"])).unwrap();
    assert_eq!(loaded.points.len(), 3);
}

#[test]
fn a_value_without_a_logarithm_is_an_error_that_names_row_and_column() {
    let text = error(&runs(), &request("params=group*1e6", &[]));
    assert!(
        text.starts_with("run row 4: params (`group*1e6`) is 0, but it must be finite"),
        "{text}"
    );
    let text = error(&runs(), &request("weight=group - 2", &[]));
    assert!(text.starts_with("run row 1: weight (`group - 2`) is -1"), "{text}");
    let text = error(&runs(), &request("seed=loss/2", &[]));
    assert!(text.contains("must be a whole number"), "{text}");
}

#[test]
fn shares_of_the_data_and_distinct_tokens_are_read_where_a_row_has_them() {
    let table = table(&[
        ("params", &[1e6, 1e6]),
        ("tokens", &[1e8, 1e8]),
        ("loss", &[2.0, 1.9]),
        ("share", &[0.25, f64::NAN]),
        ("unique_tokens", &[1e7, f64::NAN]),
    ]);
    let points = load(&table, &TableRequest::default()).unwrap().points;
    let of = |i: usize| (points[i].about.share, points[i].about.unique_tokens, points[i].share());
    assert_eq!(of(0), (Some(0.25), Some(1e7), 0.25));
    assert_eq!(of(1), (None, None, 1.0));
}

#[test]
fn a_bad_row_that_is_not_kept_is_no_error() {
    let mut table = runs();
    table.columns[2].1 = Column::Number(vec![3.0, -2.0, f64::INFINITY, 4.0, 9.0]);
    assert!(error(&table, &TableRequest::default()).starts_with("run row 3: loss is inf"));
    let request = TableRequest { drop_highest: 1, ..TableRequest::default() };
    assert_eq!(load(&table, &request).unwrap().points[1].loss, -2.0);
}

#[test]
fn the_step_that_leaves_nothing_is_named() {
    let text = error(&runs(), &request("", &["group == 1", "loss > 99"]));
    assert_eq!(text, "no rows are left: --where loss > 99 passes none of them");
    let all = TableRequest { drop_highest: 9, ..TableRequest::default() };
    assert!(error(&runs(), &all).starts_with("no rows are left after drop-highest, which dropped"));
    let few = TableRequest { outliers: vec![OutlierStage::FewLevels], ..TableRequest::default() };
    let text = error(&runs(), &few);
    assert!(text.contains("after few-levels, which dropped the last 4; row 1: budget"), "{text}");
    let nothing = table(&[("params", &[1.0]), ("tokens", &[1.0]), ("loss", &[f64::NAN])]);
    assert!(error(&nothing, &TableRequest::default()).contains("after missing"));
}

#[test]
fn what_a_stage_cannot_tell_is_a_note_and_a_doubt() {
    let request = TableRequest { outliers: vec![OutlierStage::Spline], ..request("", &[]) };
    let request = TableRequest { columns: None, ..request };
    let loaded = load(&runs(), &request).unwrap();
    assert_eq!(loaded.points.len(), 4);
    let said = |all: &[String]| all.iter().any(|line| line.contains("spline judges no run"));
    assert!(said(&loaded.notes) && said(&loaded.doubts), "{:?}", loaded.doubts);
}

#[test]
fn a_text_where_numbers_are_needed_is_named_with_its_row() {
    let mut table = runs();
    table.columns[2].1 = Column::Text(["1", "2", "n.a.", "", "3"].map(Into::into).into());
    let text = error(&table, &TableRequest::default());
    assert!(text.contains("column `loss` is text (row 3 is `n.a.`)"), "{text}");
    assert!(text.contains("--columns loss=…"), "{text}");
}

fn shared(path: &str) -> Option<Table> {
    let path =
        PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data/runs")).join(path);
    if !path.exists() {
        eprintln!("skipped: {} is absent", path.display());
        return None;
    }
    Some(read(&path).unwrap())
}

#[test]
fn the_table_of_hoffmann_et_al_loads_as_published() {
    let Some(table) = shared("epoch_chinchilla/svg_extracted_data.csv") else { return };
    let columns = request("params=Model Size,budget_flops=Training FLOP,loss=loss", &[]);
    let loaded = load(&table, &columns).unwrap();
    assert_eq!((loaded.points.len(), loaded.parameters), (245, Parameters::Total));
    assert!(loaded.budget_declared && loaded.dropped.is_empty());
    let first = &loaded.points[0];
    assert_eq!(first.tokens, 9.993_852_799_709_755e18 / (6.0 * 6_795_600_349.289_497));
    assert_eq!(first.params_vocab, 0.0);
    let loaded = load(&table, &TableRequest { drop_highest: 5, ..columns }).unwrap();
    assert_eq!((loaded.points.len(), loaded.dropped.len()), (240, 5));
    let highest = loaded.points.iter().map(|point| point.loss).fold(0.0, f64::max);
    assert!(loaded.dropped.iter().all(|row| row.reason.contains("5 highest")) && highest < 5.0);
}

#[test]
fn one_experiment_of_a_collection_is_chosen_by_its_name() {
    let Some(table) = shared("isoflop_collection/isoflops.csv") else { return };
    let filter = "experiment == \"ml_scalefit__massivetext__chinchilla\"";
    let loaded = load(&table, &request("budget_flops=budget", &[filter])).unwrap();
    assert_eq!(loaded.points.len(), 124);
    let request = request("budget_flops=budget", &[filter, "not outlier"]);
    assert!(load(&table, &request).unwrap().points.len() < 124);
}

#[test]
fn a_split_by_vocabulary_is_read_from_its_size_and_the_width() {
    let Some(table) = shared("scaling_with_vocab/exp_data.csv") else { return };
    let columns = "params_nonvocab=Non_vocab_parameters,n_vocab=vocab_size,d_model=embed_dim,\
                   budget_flops=FLOPs,loss=Lossu";
    let loaded = load(&table, &request(columns, &[])).unwrap();
    assert_eq!((loaded.points.len(), loaded.parameters), (1200, Parameters::Split));
    assert_eq!(loaded.points[0].params_vocab, 4096.0 * 512.0);
}

#[test]
fn every_stage_runs_on_a_published_table_and_names_what_it_drops() {
    let Some(table) = shared("isoflop_collection/isoflops.csv") else { return };
    let filter = "experiment == \"epochai_chinchilla__massivetext__chinchilla\"";
    for (name, stage) in OutlierStage::ALL {
        let request =
            TableRequest { outliers: vec![stage], ..request("budget_flops=budget", &[filter]) };
        let loaded = load(&table, &request).unwrap();
        assert_eq!(loaded.points.len() + loaded.dropped.len(), 123, "{name}");
        assert!(loaded.dropped.iter().all(|row| row.stage.to_string() == name));
        println!("{name}: {} dropped", loaded.dropped.len());
    }
}

#[test]
fn a_slip_of_the_pen_finds_its_name_and_nonsense_finds_none() {
    let names = ["Model Size", "Training FLOP", "loss"];
    assert_eq!(nearest("modle size", names.into_iter()), Some("Model Size"));
    assert_eq!(nearest("qqq", names.into_iter()), None);
    assert_eq!(hint("los", names.into_iter()), "did you mean `loss`? ");
}

// Rows that cannot be trusted.

/// A run of a budget with one N and loss.
fn run(budget_flops: f64, params_nonvocab: f64, loss: f64) -> IsoFlopPoint {
    IsoFlopPoint {
        run_id: format!("{budget_flops:e} {params_nonvocab:e}"),
        budget_flops,
        flops: budget_flops,
        tokens: budget_flops / 6.0 / params_nonvocab,
        ..simulated::point(params_nonvocab, 0.0, loss, 0)
    }
}

/// Sizes from 1e6 to 1e6·2^(count − 1) on a parabola in ln N with its vertex at 1e6·2^vertex.
fn parabola(budget_flops: f64, count: usize, vertex: f64) -> Vec<IsoFlopPoint> {
    let loss = |z: f64| 3.0 + 0.05 * (z - vertex).powi(2);
    let sizes = (0..count).map(|i| i as f64);
    sizes.map(|z| run(budget_flops, 1e6 * z.exp2(), loss(z))).collect()
}

#[test]
fn a_stage_is_read_by_the_name_it_prints() {
    for (name, stage) in OutlierStage::ALL {
        assert_eq!((name.parse(), stage.to_string().as_str()), (Ok(stage), name));
    }
    let error = "off-center".parse::<OutlierStage>().unwrap_err().to_string();
    assert!(error.contains("did you mean `off-centre`?"), "{error}");
}

#[test]
fn the_first_of_two_runs_within_one_per_cent_stays() {
    let runs = [(1e18, 1.009e6, 3.0), (1e18, 1.0e6, 3.1), (1e18, 2.0e6, 2.9), (1e19, 1.0e6, 2.8)];
    let points = runs.map(|(budget, n, loss)| run(budget, n, loss)).to_vec();
    let Split { kept, dropped, .. } = OutlierStage::Duplicates.split(points.clone());
    assert_eq!(kept, [points[0].clone(), points[2].clone(), points[3].clone()]);
    assert_eq!(dropped[0].0, points[1]);
    assert!(dropped[0].1.contains("1e18 1.009e6"), "{}", dropped[0].1);
}

#[test]
fn another_seed_or_vocabulary_is_no_duplicate() {
    let one = run(1e18, 1e6, 3.0);
    let points = vec![
        one.clone(),
        IsoFlopPoint { seed: 1, ..one.clone() },
        IsoFlopPoint { n_vocab: 64.0, ..one },
    ];
    assert!(OutlierStage::Duplicates.split(points).dropped.is_empty());
}

#[test]
fn repeats_of_a_size_are_one_level() {
    let twice = vec![run(1e18, 1e6, 3.0), run(1e18, 2e6, 3.0), run(1e18, 2e6, 3.1)];
    let enough = parabola(1e19, 3, 1.0);
    let Split { kept, dropped, .. } =
        OutlierStage::FewLevels.split([twice, enough.clone()].concat());
    assert_eq!(kept, enough);
    assert_eq!(dropped.len(), 3);
    assert!(dropped[0].1.contains("1e18 has 2 distinct N"), "{}", dropped[0].1);
}

#[test]
fn a_vertex_near_the_edge_drops_its_budget_and_the_reason_says_where() {
    let centred = parabola(1e18, 11, 5.0);
    let Split { kept, dropped, .. } =
        OutlierStage::OffCentre.split([centred.clone(), parabola(1e19, 11, 9.5)].concat());
    assert_eq!(kept, centred);
    assert_eq!(dropped.len(), 11);
    assert!(dropped[0].1.contains("N = 7.241e8, 95 % of the way"), "{}", dropped[0].1);
}

#[test]
fn a_budget_that_bends_downwards_is_dropped_and_two_sizes_are_not_judged() {
    let down = [1e6, 2e6, 4e6].map(|n| run(1e18, n, -(n / 2e6f64).ln().powi(2)));
    let two = [1e6, 2e6].map(|n| run(1e19, n, 1.0));
    let Split { kept, dropped, .. } = OutlierStage::OffCentre.split([&down[..], &two].concat());
    assert_eq!((kept.len(), dropped.len()), (2, 3));
    assert!(dropped[0].1.contains("does not open upwards"));
}

// Points that come back from a file.

fn any_point() -> impl Strategy<Value = IsoFlopPoint> {
    let sizes = (1e5..1e12f64, 1e3..1e10f64, 16.0..1e6f64);
    (sizes, 1e6..1e13f64, -9.0..9.0f64, 0..1000u64, 0.01..9.0f64, 0.5..2.0f64).prop_map(
        |((nonvocab, vocab, n_vocab), tokens, loss, seed, weight, ratio)| {
            let flops = 6.0 * (nonvocab + vocab) * tokens;
            IsoFlopPoint {
                run_id: format!("run, \"{seed}\""),
                seed,
                budget_flops: flops * ratio,
                flops,
                params_nonvocab: nonvocab,
                params_vocab: vocab,
                n_vocab,
                tokens,
                metric: Metric::default(),
                loss,
                weight,
                about: RunFacts::default(),
            }
        },
    )
}

/// The points as another program would write them, in millions and billions.
fn csv(points: &[IsoFlopPoint]) -> String {
    let mut text =
        "\u{feff}Run Name,seed,Budget (EFLOP),N-nv,N-v [M],V,D,\"Loss, L_u\",w\r\n".to_string();
    for p in points {
        let name = p.run_id.replace('"', "\"\"");
        let (c, n, v) = (p.budget_flops / 1e18, p.params_nonvocab / 1e6, p.params_vocab / 1e6);
        let (d, vocab, loss) = (p.tokens / 1e9, p.n_vocab, p.loss);
        let _ = write!(
            text,
            "\"{name}\",{},{c:e},{n:?},{v},{vocab},{d},{loss},{}\r\n",
            p.seed, p.weight
        );
    }
    text
}

const COLUMNS: &str = "run_id=Run Name,budget_flops=`Budget (EFLOP)`*1e18,params_nonvocab=N-nv*1e6,\
                       params_vocab=`N-v [M]`*1e6,n_vocab=V,tokens=D*1e9,loss=`Loss, L_u`,weight=w";

fn numbers(p: &IsoFlopPoint) -> [f64; 8] {
    let loss = p.loss + 100.0;
    [
        p.budget_flops,
        p.flops,
        p.params_nonvocab,
        p.params_vocab,
        p.n_vocab,
        p.tokens,
        loss,
        p.weight,
    ]
}

proptest! {
    #[test]
    fn points_written_as_csv_come_back_equal(points in prop::collection::vec(any_point(), 1..8)) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("runs.csv");
        std::fs::write(&path, csv(&points)).unwrap();
        let loaded = load(&read(&path).unwrap(), &request(COLUMNS, &[])).unwrap();
        prop_assert_eq!(loaded.points.len(), points.len());
        for (found, point) in loaded.points.iter().zip(&points) {
            prop_assert_eq!((&found.run_id, found.seed), (&point.run_id, point.seed));
            for (a, b) in numbers(found).into_iter().zip(numbers(point)) {
                prop_assert!((a / b - 1.0).abs() < 1e-12, "{} is not {}", a, b);
            }
        }
    }
}
