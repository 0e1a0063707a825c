//! Where words go: one JSON document, 80 columns, closed pipes, colours.

use std::process::{Command, Stdio};

use super::support::{Place, finished_mini, lawful};

#[test]
fn json_is_one_document_on_standard_output() {
    let place = lawful();
    for args in [
        &["plan", "lawful.yaml"][..],
        &["run", "lawful.yaml"],
        &["fit", "results/lawful"],
        &["plot", "results/lawful"],
        &["predict", "1e12", "1e13", "--law", "results/lawful"],
        &["export", "results/lawful", "--to", "notebook"],
    ] {
        let document = place.isoflop(&[args, &["--json"]].concat()).exits(0).json();
        assert!(document.is_object() || document.is_array(), "{document}");
    }
}

#[test]
fn a_command_line_that_cannot_be_read_is_a_document_too() {
    let place = Place::with("mini.yaml");
    let ended = place.isoflop(&["run", "mini.yaml", "--jobs", "many", "--json"]).exits(2);
    let error = &ended.json()["error"];
    assert_eq!(error["exit"], 2);
    let message = error["message"].as_str().unwrap();
    assert!(message.starts_with("invalid value 'many'") && message.contains("--jobs"), "{message}");
    assert!(ended.stderr().contains("invalid value 'many'"));
    let help = place.isoflop(&["run", "--help", "--json"]).exits(0).stdout();
    assert!(help.starts_with("Run the missing jobs"), "{help}");
}

#[test]
fn more_is_logged_when_asked_and_only_on_standard_error() {
    let place = Place::with("mini.yaml");
    let args = ["run", "mini.yaml", "--set", "grid.budgets=[1e9]", "-vv"];
    let ended = place.isoflop(&args).exits(0);
    for event in ["data opened", "worker started", "worker ended", "written"] {
        assert!(ended.stderr().contains(event), "{event}: {}", ended.stderr());
        assert!(!ended.stdout().contains(event), "{event}");
    }
    place.isoflop(&args[..4]).exits(0).does_not_say("data opened");
}

#[test]
fn text_for_people_is_at_most_80_columns_wide() {
    let place = lawful();
    place.write(
        "scamo.yaml",
        "name: a
data: {source: humanml3d, path: no}
grid: {models: scamo, vocab: [256, 65536], budgets: [1.2345678e18, 1e9], exclude: [d_model > 2000]}
",
    );
    for args in [
        &["plan", "lawful.yaml"][..],
        &["plan", "scamo.yaml"],
        &["run", "lawful.yaml"],
        &["plan", "lawful.yaml", "--set", "train.lr.coefficient=0.1"],
        &["fit", "results/lawful"],
        &["predict", "1e18", "3.3333333e24", "--law", "scamo"],
        &["predict", "1e12", "--law", "results/lawful"],
    ] {
        let text = place.isoflop(args).exits(0).stdout();
        assert!(text.lines().count() > 3, "{args:?}: {text}");
        let wide: Vec<&str> = text.lines().filter(|line| line.chars().count() > 80).collect();
        assert!(wide.is_empty(), "{args:?}: {wide:#?}");
    }
}

#[test]
fn laws_and_predictions_of_a_study_fit_one_screen() {
    let place = Place::new();
    for (study, budgets) in [
        ("procedural-law", "3e12,3e13,1e14"),
        ("motion-law-again", "3.2e11"),
        ("motion-shares", "3.2e11"),
        ("cmu-motion", "1e11"),
    ] {
        let folder = format!("{}/results/{study}", env!("CARGO_MANIFEST_DIR"));
        let text = place.isoflop(&["fit", &folder, "--predict", budgets]).exits(0).stdout();
        // Each further budget has two lines of a table; `run` adds one line, of its files.
        let further = 2 * (budgets.split(',').count() - 1);
        assert!(text.lines().count() < 25 + further, "{study}: {text}");
    }
}

#[test]
fn a_reader_that_goes_away_is_no_error() {
    let place = lawful();
    for args in [&["plan", "lawful.yaml", "--json"][..], &["run", "lawful.yaml"]] {
        let mut child = (place.program(args).stdout(Stdio::piped()).stderr(Stdio::piped()))
            .spawn()
            .expect("the binary can be started");
        drop(child.stdout.take());
        let ended = child.wait_with_output().unwrap();
        let stderr = String::from_utf8_lossy(&ended.stderr);
        assert_eq!(ended.status.code(), Some(0), "{args:?}: {stderr}");
        assert!(!stderr.contains("panicked"), "{stderr}");
    }
}

#[test]
fn a_sweep_goes_on_when_nobody_reads_its_progress() {
    let place = Place::with("mini.yaml");
    let cell = ["--set", "grid.vocab=[16]", "--set", "grid.budgets=[1e9]"];
    let args = [&["run", "mini.yaml"], &cell[..]].concat();
    let mut child = (place.program(&args).stdout(Stdio::piped()).stderr(Stdio::piped()))
        .spawn()
        .expect("the binary can be started");
    drop((child.stdout.take(), child.stderr.take()));
    assert_eq!(child.wait().unwrap().code(), Some(0));
    assert_eq!(super::support::records::bytes(&place.path("results/mini")).len(), 2);
}

#[test]
fn quiet_leaves_results_and_warnings() {
    let place = finished_mini();
    let loud = place.isoflop(&["run", "mini.yaml"]).exits(0).says("nothing to train");
    let quiet = place.isoflop(&["run", "mini.yaml", "-q"]).exits(0);
    let quiet = quiet.does_not_say("nothing to train").says("warning: ");
    assert_eq!(loud.stdout(), quiet.stdout());
}

/// `script` gives the program a terminal; without one it writes no colours anyway.
#[test]
fn no_color_is_honoured_on_a_terminal() {
    let place = Place::new();
    place.write("bad.yaml", "name: a\ngird: {}\n");
    let command = format!("{} plan bad.yaml", env!("CARGO_BIN_EXE_isoflop"));
    let shown = |no_color: Option<&str>| {
        let mut script = Command::new("script");
        script.args(["-qec", &command, "/dev/null"]).current_dir(place.path(""));
        script.env("TERM", "xterm-256color").env_remove("NO_COLOR").stdin(Stdio::null());
        no_color.iter().for_each(|value| {
            script.env("NO_COLOR", value);
        });
        script.output().ok().map(|output| String::from_utf8_lossy(&output.stdout).into_owned())
    };
    let Some(coloured) = shown(None) else {
        return println!("skipped: `script` is not installed");
    };
    assert!(coloured.contains("did you mean `grid`?"), "{coloured}");
    assert!(coloured.contains("\u{1b}["), "{coloured}");
    let plain = shown(Some("1")).expect("it ran before");
    assert!(plain.contains("did you mean `grid`?"), "{plain}");
    assert!(!plain.contains('\u{1b}'), "{plain}");
}
