//! Files that are not what was written: cut short, or with a bit turned over.

use std::fs;

use super::*;

fn cut(path: &Path) {
    let bytes = fs::read(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    fs::write(path, &bytes[..bytes.len() / 2]).expect("a writable file");
}

/// Turns a bit of the last number over.
fn flip(path: &Path) {
    let mut bytes = fs::read(path).expect("a readable file");
    *bytes.last_mut().expect("a file with something in it") ^= 4;
    fs::write(path, bytes).expect("a writable file");
}

fn logs(results: &Path) -> String {
    let logs = files_with(results, "log.txt").into_iter();
    logs.map(|path| fs::read_to_string(path).unwrap_or_default()).collect()
}

#[test]
fn a_damaged_checkpoint_is_set_aside_and_the_job_begins_before_it() {
    for kind in ["runs", "tokenizers"] {
        for damage in [cut, flip] {
            // Tokenizers of a few steps are done before they have a checkpoint.
            let settings = ["--set", "train.checkpoint_s=0"];
            let place = killed_with_checkpoint(kind, &settings);
            let results = place.path("results/mini");
            let damaged = checkpoints(&results, kind);
            damaged.iter().for_each(|path| damage(path));
            place.isoflop(&[&["run", "mini.yaml"], &settings[..]].concat()).exits(0);
            assert_undisturbed(&results);
            assert_eq!(logs(&results).matches("is set aside as").count(), damaged.len(), "{kind}");
        }
    }
}

#[test]
fn runs_of_a_damaged_trunk_are_trained_without_it_to_the_same_bits() {
    let place = Place::with("mini.yaml");
    let settings = ["kind=wsd", "share=true"].map(|one| format!("train.schedule.{one}"));
    let settings = ["--set", &settings[0], "--set", &settings[1], "--set", "grid.vocab=[16]"];
    let args = [&["run", "mini.yaml"], &settings[..]].concat();
    place.isoflop(&args).exits(0);
    let results = place.path("results/mini");
    let expected = records::timeless(&results);
    for damage in [cut, flip] {
        run_folders(&place, "mini").iter().for_each(|run| {
            fs::remove_dir_all(place.path(run)).expect("a run's folder");
        });
        let trunks = files_with(&results.join("trunks"), "state.safetensors");
        assert!(trunks.len() > 1);
        trunks.iter().for_each(|path| damage(path));
        place.isoflop(&args).exits(0);
        assert!(records::timeless(&results) == expected);
        assert!(logs(&results).contains("is set aside as"));
        // As they were, for the next kind of damage.
        fs::remove_dir_all(results.join("trunks")).expect("the trunks");
        run_folders(&place, "mini").iter().for_each(|run| {
            fs::remove_dir_all(place.path(run)).expect("a run's folder");
        });
        place.isoflop(&args).exits(0);
    }
}

/// A finished sweep, but for one run, with a file of the folder cut short.
fn with_cut(find: impl Fn(&Place) -> String) -> (Place, String) {
    with_damage(find, cut)
}

/// The same with a file of the folder damaged.
fn with_damage(find: impl Fn(&Place) -> String, damage: fn(&Path)) -> (Place, String) {
    let place = finished_mini();
    let run = run_folders(&place, "mini").remove(0);
    fs::remove_file(place.path(&run).join("record.json")).expect("a record");
    let file = find(&place);
    damage(&place.path(&file));
    (place, file)
}

/// A file of the run that [`with_cut`] makes missing, or of what that run reads.
fn read_by_it(place: &Place, folder: &str, file: &str) -> String {
    let run = run_folders(place, "mini").remove(0);
    let spec = place.json(&format!("{run}/spec.json"));
    let id = |name: &str| spec[name].as_str().expect("an id").to_string();
    match folder {
        "tokenizers" => format!("results/mini/tokenizers/{}/{file}", id("tokenizer_id")),
        "text" => format!("results/mini/text/{}/{file}", id("text_id")),
        _ => format!("{run}/{file}"),
    }
}

#[test]
fn every_file_that_is_cut_short_is_made_again_by_the_same_command() {
    let inputs = [
        ("tokenizers", "tokens/codes.safetensors"),
        ("tokenizers", "metrics.json"),
        ("tokenizers", "job.json"),
        ("text", "vectors.safetensors"),
        ("runs", "spec.json"),
    ];
    for (folder, file) in inputs {
        let (place, path) = with_cut(|place| read_by_it(place, folder, file));
        place.isoflop(&["status", "results/mini"]).exits(0);
        place.isoflop(&["run", "mini.yaml"]).exits(0);
        assert_undisturbed(&place.path("results/mini"));
        let half = fs::read(place.path(&path)).expect("it is there again").len();
        let whole = fs::read(finished_mini().path(&path)).expect("as it was").len();
        assert!(half.abs_diff(whole) < 64, "{path}: {half} bytes and not {whole}");
    }
    for file in [
        "plan.json",
        "sweep.yaml",
        "command.json",
        "laws.json",
        "finished.json",
        "runs.parquet",
        "schedule.jsonl",
    ] {
        let (place, _) = with_cut(|_| format!("results/mini/{file}"));
        place.isoflop(&["run", "mini.yaml"]).exits(0);
        assert_undisturbed(&place.path("results/mini"));
    }
}

#[test]
fn codes_and_vectors_with_a_bit_turned_over_are_made_again() {
    for (folder, file) in
        [("tokenizers", "tokens/codes.safetensors"), ("text", "vectors.safetensors")]
    {
        let (place, path) = with_damage(|place| read_by_it(place, folder, file), flip);
        place.isoflop(&["run", "mini.yaml"]).exits(0);
        assert_undisturbed(&place.path("results/mini"));
        let whole = fs::read(finished_mini().path(&path)).expect("as it was");
        assert!(fs::read(place.path(&path)).expect("it is there again") == whole, "{path}");
    }
}

/// Changes a digit of the first number of a text that has a decimal point.
fn change(path: &Path) {
    let mut bytes = fs::read(path).expect("a readable file");
    let at = bytes.windows(2).position(|pair| pair[0] == b'.' && pair[1].is_ascii_digit());
    let at = at.unwrap_or_else(|| panic!("no number in {}", path.display())) + 1;
    bytes[at] = if bytes[at] == b'9' { b'1' } else { bytes[at] + 1 };
    fs::write(path, bytes).expect("a writable file");
}

#[test]
fn a_product_with_one_number_changed_is_found_and_made_again() {
    for (folder, file) in
        [("tokenizers", "metrics.json"), ("tokenizers", "job.json"), ("runs", "spec.json")]
    {
        let (place, path) = with_damage(|place| read_by_it(place, folder, file), change);
        let ended = place.isoflop(&["run", "mini.yaml"]).exits(0);
        ended.says(&format!("{path} is damaged (its bytes are not those that were written"));
        assert_undisturbed(&place.path("results/mini"));
    }
    let place = finished_mini();
    let record = format!("{}/record.json", run_folders(&place, "mini").remove(3));
    let results = place.path("results/mini");
    change(&place.path(&record));
    let words = "not those that were written";
    place.isoflop(&["status", "results/mini"]).exits(0).says(&record).says(words);
    place.isoflop(&["run", "mini.yaml"]).exits(0).says(&record).says("1 jobs to do");
    assert_undisturbed(&results);
    for (file, readers) in [
        ("laws.json", &["plot", "report", "predict 1e9 --law"][..]),
        ("prediction.json", &["report"]),
        ("sweep.yaml", &["fit"]),
        ("runs.parquet", &["fit", "plot", "report", "export --to parquet"]),
        ("plan.json", &["status"]),
    ] {
        let path = results.join(file);
        let whole = fs::read(&path).expect("it is there");
        if file == "runs.parquet" {
            middle(&path);
        } else {
            change(&path);
        }
        for reader in readers {
            let words: Vec<&str> = reader.split(' ').chain(["results/mini"]).collect();
            let ended = place.isoflop(&words).exits(2).says(file);
            ended.says("its bytes are not those that were written");
        }
        place.isoflop(&["run", "mini.yaml"]).exits(0);
        fs::write(&path, whole).expect("a writable file");
    }
    // Without its digest a file is the user's own.
    let laws = place.json("results/mini/laws.json").to_string().replace("\"mini\"", "\"mine\"");
    place.write("results/mini/laws.json", laws);
    place.isoflop(&["plot", "results/mini", "--format", "svg"]).exits(0);
}

/// Turns a bit in the middle of a file over.
fn middle(path: &Path) {
    let mut bytes = fs::read(path).expect("a readable file");
    let at = bytes.len() / 2;
    bytes[at] ^= 1;
    fs::write(path, bytes).expect("a writable file");
}

#[test]
fn a_tokenizer_whose_weights_are_damaged_is_trained_again_where_its_codes_are_wanted() {
    let (place, weights) = with_cut(|place| read_by_it(place, "tokenizers", "weights.safetensors"));
    let tokenizer = place.path(&weights);
    let tokenizer = tokenizer.parent().expect("a tokenizer's folder");
    fs::remove_file(tokenizer.join("tokens/codes.safetensors")).expect("its codes");
    place.isoflop(&["run", "mini.yaml"]).exits(0);
    assert_undisturbed(&place.path("results/mini"));
    assert!(logs(tokenizer).contains("the tokenizer is trained again"));
}

#[test]
fn a_damaged_record_is_named_by_all_and_trained_again_by_run() {
    let place = finished_mini();
    let run = run_folders(&place, "mini").remove(3);
    let record = format!("{run}/record.json");
    cut(&place.path(&record));
    let state = place.isoflop(&["status", "results/mini", "--json"]).exits(0);
    let state = state.says(&record).says("is damaged").says("`isoflop run` sets it aside").json();
    assert_eq!(state["runs"]["done"], 8);
    place.isoflop(&["plan", "mini.yaml"]).exits(0);
    place.isoflop(&["plot", "results/mini"]).exits(0);
    let ended = place.isoflop(&["run", "mini.yaml"]).exits(0);
    ended.says(&record).says("is damaged").says("1 jobs to do");
    assert!(place.path(&format!("{run}/damaged-record.json")).exists());
    assert_undisturbed(&place.path("results/mini"));
}

#[test]
fn a_damaged_failure_is_a_failure_all_the_same() {
    let place = Place::trained_by("exit 3");
    place.isoflop(&["run", "own.yaml"]).exits(1);
    let failure = format!("{}/failure.json", run_folders(&place, "own")[0]);
    cut(&place.path(&failure));
    let told = only_failure(&place, "results/own");
    assert_eq!(told["failure"], "damaged");
    assert!(told["reason"].as_str().expect("a sentence").contains("failure.json is damaged"));
    place.isoflop(&["run", "own.yaml"]).exits(1).says("[damaged]").says("--retry-failed");
    place.write("train.sh", GOOD);
    assert_eq!(follow_advice(&place, &told["retry"]).status.code(), Some(0));
}

#[test]
fn commands_that_only_read_say_what_is_damaged_and_how_to_mend_it() {
    let place = finished_mini();
    for (file, command) in [("plan.json", "status"), ("laws.json", "plot")] {
        cut(&place.path(&format!("results/mini/{file}")));
        let ended = place.isoflop(&[command, "results/mini"]).exits(2);
        ended.says(&format!("{file} is damaged")).says("`isoflop run` writes it again");
    }
}
