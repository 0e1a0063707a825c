//! What a person gets wrong: told all at once, with place and remedy, before anything is written.

use super::support::Place;

fn refused(text: &str, args: &[&str]) -> (Place, super::support::Ended) {
    let place = Place::new();
    place.write("sweep.yaml", text);
    let ended = place.isoflop(&[&["run", "sweep.yaml"], args].concat()).exits(2);
    assert_eq!(place.names(""), ["sweep.yaml"], "nothing is written");
    assert_eq!(ended.stdout(), "");
    (place, ended)
}

const SOUND: &str = "name: sound
grid:
  models:
    - {n_layer: 1, n_head: 1, d_model: 8}
  vocab: [64]
  budgets: [1e9]
";

#[test]
fn every_problem_of_a_file_is_shown_at_once_where_it_stands() {
    let text = "name: bad/name
seed: [0]
grid:
  models:
    - {n_layer: 1, n_head: 1, d_modle: 8}
    - {n_layer: 1, n_head: 3, d_model: 16}
  vocab: [63, 64, 64]
  budgets: [ten]
train: {min_steps: [1], lr: {coeficient: 3}}
";
    let (_, ended) = refused(text, &[]);
    for words in [
        "sweep.yaml:2:1",
        "unknown name `seed`",
        "did you mean `seeds`?",
        "sweep.yaml:5:31",
        "unknown name `d_modle`",
        "did you mean `d_model`?",
        "sweep.yaml:6:7",
        "3 heads do not divide a width of 16",
        "sweep.yaml:8:13",
        "expected a number, found `ten`",
        "sweep.yaml:9:20",
        "sweep.yaml:9:30",
        "did you mean `coefficient`?",
        "^^^^^^^^^^",
        "sweep.yaml: 10 problems",
    ] {
        assert!(ended.stderr().contains(words), "no `{words}` in:\n{}", ended.stderr());
    }
}

#[test]
fn impossible_cells_are_found_beside_unknown_names() {
    let text = "name: bad
grid:
  models:
    - {n_layer: 1, n_head: 3, d_model: 16}
    - {n_layer: 1, n_head: 16, d_model: 16}
  vocab: [63, 64, 64]
  budgets: [1e9, -1]
trian: {}
";
    let (_, ended) = refused(text, &[]);
    for words in [
        "did you mean `train`?",
        "sweep.yaml:4:7",
        "3 heads do not divide a width of 16",
        "sweep.yaml:5:7",
        "RoPE turns pairs",
        "sweep.yaml:6:11",
        "ScaMo gives no levels for 63 codes",
        "sweep.yaml:6:19",
        "stands in the list a second time",
        "sweep.yaml:7:18",
        "-1 is out of range: 1 to 1e30",
        "sweep.yaml: 6 problems",
    ] {
        assert!(ended.stderr().contains(words), "no `{words}` in:\n{}", ended.stderr());
    }
}

#[test]
fn files_that_are_no_sweeps_are_refused() {
    let (_, ended) = refused("name: a\ngrid: {models: [\nseeds: 3", &[]);
    ended.says("not valid YAML").says("sweep.yaml:3");
    refused("", &[]).1.says("a sweep file is a mapping");
    refused("- a\n- b\n", &[]).1.says("a sweep file is a mapping");
    refused("name: a\n", &[]).1.says("missing field `grid`");
    let place = Place::new();
    place.isoflop(&["run", "absent.yaml"]).exits(2).says("cannot read absent.yaml");
    place.write("bytes.yaml", [0xff, 0xfe, 0x00]);
    place.isoflop(&["plan", "bytes.yaml"]).exits(2).says("cannot read bytes.yaml");
}

#[test]
fn a_setting_that_cannot_be_laid_over_the_file_is_shown_as_typed() {
    for (setting, words) in [
        ("nonsense", "--set nonsense: no `=` in it"),
        ("grid.vocab[7]=64", "there is no such entry"),
        ("grid.vocab=[64", "the value is not valid YAML"),
        ("train.min_step=3", "did you mean `min_steps`?"),
        ("train.min_steps=many", "in --set train.min_steps=many"),
        ("grid.models[0].n_head=3", "3 heads do not divide a width of 8"),
        ("data.source=humanml3d", "needs a `path`"),
        ("data.path=motions", "a folder, where `source` reads none"),
        ("data.fps=30", "the rate of files, where `source` reads none"),
        ("text.encoder=file", "`encoder: file` needs a `path`"),
        ("text.path=captions.safetensors", "`encoder: hashed-ngrams` reads no file"),
    ] {
        refused(SOUND, &["--set", setting]).1.says(words);
    }
}

#[test]
fn a_grid_of_which_nothing_is_left_is_refused() {
    refused(SOUND, &["--set", "grid.exclude=['n_vocab > 1']"]).1.says("every cell");
}

#[test]
fn data_that_is_not_there_is_named() {
    let data = ["--set", "data.source=humanml3d", "--set", "data.path=no/such/folder"];
    refused(SOUND, &data).1.says("opening the data").says("no/such/folder/new_joint_vecs");
}

#[test]
fn a_file_in_the_place_of_the_results_is_named() {
    let place = Place::with("mini.yaml");
    place.write("occupied", "");
    let ended = place.isoflop(&["run", "mini.yaml", "--out", "occupied"]).exits(2);
    ended.says("cannot make the folder occupied/mini");
    assert_eq!(place.read("occupied"), b"");
}

#[test]
fn a_command_line_that_makes_no_sense_is_a_usage_error() {
    let place = Place::with("mini.yaml");
    for (args, words) in [
        (&["predict", "nonsense"][..], "nonsense is not a number of FLOPs"),
        (&["predict", "-1e9"], "--"),
        (&["predict", "1e18"], "--law scamo"),
        (&["predict", "--params", "7e9", "--law", "scamo"], "--tokens"),
        (&["predict", "1e18", "--params", "7e9", "--tokens", "1e12"], "cannot be used with"),
        (&["predict", "1e18", "--law", "/no/such"], "/no/such does not exist; laws are those of"),
        (&["run", "mini.yaml", "--jobs", "0"], "--jobs"),
        (&["plan"], "SWEEP"),
        (&["sing"], "sing"),
        (&["plot", "nowhere"], "nowhere"),
        (&["fit", "nowhere"], "nowhere"),
        (&["export", "nowhere", "--to", "notebook"], "nowhere"),
    ] {
        place.isoflop(args).exits(2).says(words);
    }
    assert_eq!(place.names(""), ["mini.yaml"]);
}

#[test]
fn sizes_that_no_machine_has_are_refused_before_anything_is_made() {
    let many: Vec<String> = (1..=1000).map(|i| format!("{i}e9")).collect();
    let seeds: Vec<String> = (0..2000).map(|i| i.to_string()).collect();
    let budgets = format!("grid.budgets=[{}]", many.join(", "));
    let seeds = format!("seeds=[{}]", seeds.join(", "));
    let (_, ended) = refused(SOUND, &["--set", &budgets, "--set", &seeds]);
    assert!(ended.stderr().contains("makes 2e6 runs"), "{}", ended.stderr());
    let (_, ended) = refused(SOUND, &["--set", "text.dim=2147483648"]);
    assert!(
        ended.stderr().contains("2147483648 is out of range: 1 to 65536"),
        "{}",
        ended.stderr()
    );
    let deep = format!("{SOUND}train: {}\n", "[".repeat(100_000));
    let (_, ended) = refused(&deep, &[]);
    assert!(ended.stderr().contains("nest deeper than 128"), "{}", ended.stderr());
}

#[test]
fn a_path_that_is_not_utf8_is_refused_by_every_command() {
    use std::os::unix::ffi::OsStrExt;
    let path = std::ffi::OsStr::from_bytes(b"bad\xff");
    for words in
        [&["status"][..], &["report"], &["plot"], &["cancel"], &["predict", "1e9", "--law"]]
    {
        let mut program = std::process::Command::new(env!("CARGO_BIN_EXE_isoflop"));
        let ended = program.args(words).arg(path).output().expect("the program starts");
        let told = String::from_utf8_lossy(&ended.stderr).into_owned();
        assert_eq!(ended.status.code(), Some(2), "{words:?}: {told}");
        assert!(told.contains("is not UTF-8"), "{words:?}: {told}");
    }
}
