//! The figures of a simulated sweep, whole and with parts missing.

use std::fs;

pub mod simulated;

use super::*;
use crate::codes::Continuity;
use crate::laws::MinimumFlag;
use crate::record::RunRecord;
use crate::record::facts::LOSS_NORMALISED;
use simulated::Simulated;

fn drawn(input: &FigureInput) -> (tempfile::TempDir, Drawn) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let drawn = draw_all(input, folder.path(), |_| true, &Format::ALL).expect("figures are drawn");
    (folder, drawn)
}

fn left_out(input: &FigureInput) -> Vec<String> {
    drawn(input).1.left_out.into_iter().map(|left_out| left_out.name).collect()
}

#[test]
fn every_figure_of_a_whole_sweep_is_drawn_in_every_format() {
    let sweep = simulated::sweep();
    let (folder, drawn) = drawn(&sweep.input());
    assert_eq!(drawn.left_out, []);
    for (name, _) in figures(&sweep.input()) {
        let svg = fs::read_to_string(folder.path().join(format!("{name}.svg"))).unwrap();
        assert!(svg.starts_with("<svg ") && svg.trim_end().ends_with("</svg>"), "{name}");
        assert!(svg.contains("quickstart") && svg.contains(style::FAMILY), "{name}");
        let png = fs::read(folder.path().join(format!("{name}.png"))).unwrap();
        assert_eq!(&png[..8], b"\x89PNG\r\n\x1a\n", "{name}");
        assert!(png_is_twice_the_svg(&png, &svg), "{name}");
        let pdf = fs::read(folder.path().join(format!("{name}.pdf"))).unwrap();
        assert!(pdf.starts_with(b"%PDF-"), "{name}");
    }
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), drawn.paths.len());
}

fn png_is_twice_the_svg(png: &[u8], svg: &str) -> bool {
    let width = u32::from_be_bytes([png[16], png[17], png[18], png[19]]);
    svg.starts_with(&format!("<svg width=\"{}\"", width / 2))
}

#[test]
fn drawing_again_gives_the_same_bytes() {
    let sweep = simulated::sweep();
    let (first, second) = (drawn(&sweep.input()), drawn(&sweep.input()));
    assert_eq!(first.1.paths.len(), Format::ALL.len() * (FIGURES.len() - 1));
    for (a, b) in first.1.paths.iter().zip(&second.1.paths) {
        assert_eq!(a.file_name(), b.file_name());
        assert!(fs::read(a).unwrap() == fs::read(b).unwrap(), "{}", a.display());
    }
}

#[test]
fn the_order_of_the_rows_does_not_matter() {
    let mut sweep = simulated::sweep();
    let before = drawn(&sweep.input());
    // Means over two seeds do not depend on which came first.
    sweep.records.reverse();
    let after = drawn(&sweep.input());
    for (a, b) in before.1.paths.iter().zip(&after.1.paths) {
        assert!(fs::read(a).unwrap() == fs::read(b).unwrap(), "{}", a.display());
    }
}

#[test]
fn without_laws_the_figures_of_runs_remain() {
    let sweep = simulated::sweep();
    let input = FigureInput { laws: None, ..sweep.input() };
    assert_eq!(left_out(&input), ["vocab_vs_nonvocab", "loss_vs_budget", "power_laws"]);
}

#[test]
fn with_one_vocabulary_what_compares_vocabularies_is_left_out() {
    let mut sweep = simulated::sweep();
    sweep.records.retain(|run| run.planned.n_vocab == 256);
    sweep.tokenizers.truncate(1);
    assert_eq!(left_out(&sweep.input()), ["loss_vs_vocab", "tokenizers"]);
}

#[test]
fn movement_of_tokenizers_is_drawn_where_it_was_measured() {
    let mut sweep = simulated::sweep();
    let panels = |sweep: &Simulated| {
        let (folder, _) = drawn(&sweep.input());
        let svg = fs::read_to_string(folder.path().join("tokenizers.svg")).unwrap();
        ["Boundaries of codes", "Jerk", "Root at the end"].map(|title| svg.contains(title))
    };
    assert_eq!(panels(&sweep), [false; 3]);
    sweep.tokenizers[0].continuity = Some(Continuity {
        boundary_step_ratio: Some(1.4),
        jerk: 120.0,
        jerk_ratio: Some(1.5),
        root_error: None,
        root_end_error: None,
        travelling_clips: 0,
        still_clips: 7,
    });
    assert_eq!(panels(&sweep), [true, true, false]);
}

/// The same runs on half of the data.
fn halved(records: &[RunRecord]) -> Vec<RunRecord> {
    let mut half = records.to_vec();
    for record in &mut half {
        record.planned.share = Some(0.5);
        record.measured.unique_tokens = record.measured.unique_tokens.map(|n| n / 2);
    }
    half
}

#[test]
fn several_shares_of_the_data_have_a_figure_of_their_own() {
    let mut sweep = simulated::sweep();
    let alone = drawn(&sweep.input());
    sweep.records.extend(halved(&sweep.records));
    let both = drawn(&sweep.input());
    let more = |drawn: &Drawn| {
        drawn.paths.iter().filter(|path| path.ends_with("loss_vs_data.svg")).count()
    };
    assert_eq!((more(&alone.1), more(&both.1)), (0, 1));
    let same = |name: &str| {
        let read = |place: &tempfile::TempDir| fs::read(place.path().join(name)).unwrap();
        read(&alone.0) == read(&both.0)
    };
    assert!(same("isoflop_parabolas.svg") && same("loss_vs_flops.svg"));
}

#[test]
fn an_empty_sweep_draws_nothing_and_says_why() {
    let input =
        FigureInput { title: "none", loss_name: None, records: &[], laws: None, tokenizers: &[] };
    let (folder, drawn) = drawn(&input);
    assert_eq!(drawn.left_out.len(), FIGURES.len() - 1);
    assert!(drawn.left_out.iter().all(|left_out| !left_out.reason.is_empty()));
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
fn a_sweep_of_one_run_is_still_drawn() {
    let mut sweep = simulated::sweep();
    sweep.records.truncate(1);
    let (_folder, drawn) = drawn(&FigureInput { laws: None, ..sweep.input() });
    assert!(drawn.paths.iter().any(|path| path.ends_with("loss_vs_flops.png")));
}

#[test]
fn a_diverged_run_is_named_and_the_rest_drawn() {
    let mut sweep = simulated::sweep();
    sweep.records[7].metrics.set(LOSS_NORMALISED, f64::NAN);
    let name = format!("run {}", sweep.records[7].planned.run_id);
    assert_eq!(left_out(&sweep.input()), [name]);
}

#[test]
fn laws_without_a_single_fit_are_drawn_as_minima() {
    let Simulated { records, mut laws, tokenizers } = simulated::sweep();
    (laws.power_laws, laws.loss, laws.vocab_from_nonvocab) = Default::default();
    laws.bootstrap.clear();
    laws.held_out = None;
    laws.minima.iter_mut().for_each(|minimum| minimum.flags = vec![MinimumFlag::FewLevels]);
    let input = FigureInput {
        title: "bare",
        loss_name: None,
        records: &records,
        laws: Some(&laws),
        tokenizers: &tokenizers,
    };
    let (folder, drawn) = drawn(&input);
    assert_eq!(drawn.left_out, []);
    let svg = fs::read_to_string(folder.path().join("power_laws.svg")).unwrap();
    assert_eq!(svg.matches("not determined").count(), 3);
}

#[test]
fn a_rule_that_no_run_records_is_refused() {
    let mut sweep = simulated::sweep();
    sweep.laws.flops_rule = "guess".to_owned();
    let folder = tempfile::tempdir().unwrap();
    let error = draw_all(&sweep.input(), folder.path(), |_| true, &Format::ALL).unwrap_err();
    assert!(matches!(error, FigureError::UnknownRule { rule } if rule == "guess"));
}

#[test]
fn every_text_of_every_page_lies_on_the_page() {
    let (sweep, many) = (simulated::sweep(), simulated::large_grid());
    let shared = [sweep.records.clone(), halved(&sweep.records)].concat();
    for records in [&sweep.records, &many, &shared] {
        let input = FigureInput { records, ..sweep.input() };
        let sources = Sources::of(&input).unwrap();
        for (name, draw) in figures(&input) {
            every_text_lies_on(&draw(&sources).unwrap(), name);
        }
    }
}

fn every_text_lies_on(scene: &Scene, name: &str) {
    let text = |shape: &'_ scene::Shape| match shape {
        scene::Shape::Text(text) => Some(text.clone()),
        _ => None,
    };
    let texts: Vec<_> = scene.shapes.iter().filter_map(text).collect();
    assert!(texts.len() > 10, "{name} has {} texts", texts.len());
    for text in texts {
        assert!(lies_on(&text, scene), "{name}: {:?} at {:?}", text.content, text.at);
    }
}

fn lies_on(text: &scene::Text, scene: &Scene) -> bool {
    let width = style::measure(&text.content, text.weight, text.em);
    let before = text.anchor.share() * width;
    let (x, y) = text.at;
    if text.upward {
        y + before <= scene.height && y + before - width >= 0.0
    } else {
        x - before >= 0.0 && x - before + width <= scene.width && y <= scene.height
    }
}

/// To renew it after a meant change, run `gallery` and copy the file from target/gallery/sweep.
#[test]
fn the_vocabulary_figure_is_the_golden_one() {
    let sweep = simulated::sweep();
    let (folder, _) = drawn(&sweep.input());
    let svg = fs::read_to_string(folder.path().join("vocab_vs_nonvocab.svg")).unwrap();
    let golden = include_str!("../../tests/golden/vocab_vs_nonvocab.svg");
    let different = svg.lines().zip(golden.lines()).find(|(now, then)| now != then);
    assert_eq!(different, None, "the first line that differs, now and then");
    assert_eq!(svg.lines().count(), golden.lines().count());
}

#[test]
#[ignore = "for the eye: writes the figures of simulated sweeps to target/gallery"]
fn gallery() {
    let (sweep, many) = (simulated::sweep(), simulated::large_grid());
    let one_vocab: Vec<_> =
        sweep.records.iter().filter(|r| r.planned.n_vocab == 256).cloned().collect();
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("target/gallery");
    for (name, records) in [("sweep", &sweep.records), ("large", &many), ("plain", &one_vocab)] {
        let input = FigureInput { records, ..sweep.input() };
        let drawn = draw_all(&input, &folder.join(name), |_| true, &Format::ALL)
            .expect("figures are drawn");
        assert!(drawn.paths.len() >= 2 * (FIGURES.len() - 1));
    }
}
