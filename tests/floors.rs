//! The floors of the libraries, as the table in each `lib.rs` has them, held by every import.

#[path = "floors/circles.rs"]
mod circles;
#[path = "floors/imports.rs"]
mod imports;
#[path = "floors/picture.rs"]
mod picture;
#[path = "floors/tokens.rs"]
mod tokens;
#[path = "floors/tree.rs"]
mod tree;

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

use circles::circles;
use tree::{Edge, Tree};

const LIBRARIES: [&str; 5] = [
    "src/lib.rs",
    "crates/laws/src/lib.rs",
    "crates/model/src/lib.rs",
    "crates/motion/src/lib.rs",
    "crates/spec/src/lib.rs",
];
const PROGRAM: &str = "src/main.rs";

/// A line of the table.
struct Floor {
    number: usize,
    beside: BTreeSet<String>,
}

/// The table in the documentation of a library.
fn floors(library: &str) -> BTreeMap<String, Floor> {
    let text = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(library)).unwrap();
    let rows = text.lines().filter_map(|line| line.strip_prefix("//! |")).skip(2);
    rows.map(|row| {
        let cells: Vec<&str> = row.split('|').map(str::trim).collect();
        let [number, module, _, beside, ""] = cells[..] else { panic!("not a row: {row}") };
        let beside = beside.split(',').map(str::trim).filter(|name| !name.is_empty());
        let beside = beside.map(ToString::to_string).collect();
        let number = number.parse().unwrap_or_else(|_| panic!("not a floor: {number}"));
        (module.trim_matches(['[', ']', '`']).to_string(), Floor { number, beside })
    })
    .collect()
}

fn fail_for(problems: &[String], what: &str) {
    assert!(problems.is_empty(), "{what}:\n\n{}\n", problems.join("\n"));
}

#[test]
fn the_table_has_every_module_and_no_other() {
    LIBRARIES.into_iter().for_each(the_table_is_whole);
}

fn the_table_is_whole(library: &str) {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join(library);
    let src = fs::read_dir(root.parent().unwrap()).unwrap();
    let names = src.map(|entry| {
        let path = entry.unwrap().path();
        path.file_stem().unwrap().to_str().unwrap().to_string()
    });
    // The roots of the library and of the program, and the program's own modules.
    let modules: BTreeSet<String> =
        names.filter(|name| !["lib", "main", "commands"].contains(&name.as_str())).collect();
    let floors = floors(library);
    let mut problems = Vec::new();
    for module in &modules {
        if !floors.contains_key(module) {
            problems.push(format!("{module} has no line in the table of {library}"));
        }
    }
    for (module, floor) in &floors {
        if !modules.contains(module) {
            problems.push(format!("the table of {library} has `{module}`, which is no module"));
        }
        for beside in &floor.beside {
            if floors.get(beside).is_none_or(|beside| beside.number != floor.number) {
                problems.push(format!("`{beside}` does not stand beside `{module}`"));
            }
        }
    }
    fail_for(&problems, "the table of floors and the modules differ");
}

#[test]
fn a_module_imports_what_stands_below_it_or_is_named_beside_it() {
    LIBRARIES.into_iter().for_each(every_import_goes_down);
}

fn every_import_goes_down(library: &str) {
    imports_go_down(library, library, &[]);
}

#[test]
fn a_room_of_the_laws_imports_from_lower_floors() {
    imports_go_down("crates/laws/src/lib.rs", "crates/laws/src/laws/mod.rs", &["laws"]);
}

/// Of the modules of `parent`, whose floors are told in `table`.
fn imports_go_down(library: &str, table: &str, parent: &[&str]) {
    let (floors, tree) = (floors(table), Tree::read(library));
    let child = |path: &[String]| {
        let within = path.iter().zip(parent).all(|(name, own)| name == own);
        path.get(parent.len()).filter(|_| within).cloned()
    };
    let mut problems = Vec::new();
    for named in tree.named() {
        let file = &tree.files[named.file];
        let (Some(module), Some(needed)) = (child(&file.module), child(&named.path)) else {
            continue;
        };
        let (module, needed) = (&module, &needed);
        let (Some(from), Some(to)) = (floors.get(module), floors.get(needed)) else { continue };
        let place = format!("{}:{}", file.path.display(), named.line);
        if module != needed && from.number < to.number {
            let [below, above] = [from.number, to.number];
            problems.push(format!(
                "{place}: `{module}` on floor {below} imports `{needed}` of floor {above}"
            ));
        } else if module != needed && from.number == to.number && !from.beside.contains(needed) {
            problems.push(format!("{place}: `{needed}` is not named beside `{module}`"));
        }
    }
    fail_for(&problems, &format!("imports against the table of {table}"));
}

#[test]
fn no_modules_need_one_another() {
    LIBRARIES.into_iter().for_each(no_modules_of_a_library_need_one_another);
}

fn no_modules_of_a_library_need_one_another(library: &str) {
    let tree = Tree::read(library);
    let named: Vec<(&str, String, String)> = tree
        .named()
        .filter_map(|named| {
            let file = &tree.files[named.file];
            let (from, to) = (file.module.first()?, named.path.first()?);
            let place =
                format!("{}:{}: {}", file.path.display(), named.line, named.path.join("::"));
            (from != to).then(|| (from.as_str(), to.clone(), place))
        })
        .collect();
    let circles = circles(named.iter().map(|(from, to, _)| (*from, to.as_str())));
    let problems = circles.iter().flat_map(|circle| {
        let within =
            named.iter().filter(|(from, to, _)| circle.contains(from) && circle.contains(&**to));
        within.map(|(_, _, place)| place.clone())
    });
    fail_for(&problems.collect::<Vec<_>>(), "modules that need one another");
}

#[test]
fn no_files_need_one_another() {
    let mut problems = Vec::new();
    for root in LIBRARIES.into_iter().chain([PROGRAM]) {
        let tree = Tree::read(root);
        let edges = tree.edges();
        for circle in circles(edges.iter().map(|edge| (edge.from, edge.to))) {
            let within = |edge: &&Edge| circle.contains(&edge.from) && circle.contains(&edge.to);
            let shown = tree.shown(edges.iter().filter(within));
            problems.push(format!("{} files:\n{}\n", circle.len(), shown.join("\n")));
        }
    }
    fail_for(&problems, "files that need one another");
}

#[test]
fn the_picture_shows_the_modules_and_their_imports() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/architecture.svg");
    let drawn = picture::picture();
    if std::env::var_os("ISOFLOP_BLESS").is_some() {
        fs::write(&path, &drawn).unwrap();
    }
    let kept = fs::read_to_string(&path).unwrap_or_default();
    assert!(kept == drawn, "draw it again: ISOFLOP_BLESS=1 cargo test --release --test floors");
}

#[test]
fn every_form_of_an_import_is_read() {
    let said = imports::said(
        r##"
        //! use crate::comment;
        use crate::{a::{self, B as C}, d::*, e::{F, g::{H, I}}};
        pub(crate) use super::passed;
        mod child;
        #[cfg(test)]
        mod fixtures;
        #[cfg(test)]
        use crate::only_tests;
        #[serde(with = "crate::number::count")]
        fn f<'a>(x: &'a [u8; 3], y: char) -> impl Fn() + use<'a> {
            let _ = ('"', '\'', b'"', "use crate::text;", r#"use crate::"raw";"#);
            #[cfg(test)]
            let x = { crate::hidden::of() };
            crate::inline::path::<u8>(); self::here::now()
        }
        #[cfg(all(test, unix))]
        mod tests { use crate::nested; mod deeper { use crate::more; } }
        fn last() { super::last::word() }
        "##,
    );
    let written = |path: &imports::Path| path.segments.join("::");
    let imported: Vec<String> = said.imports.iter().map(|i| written(&i.path)).collect();
    let all = ["a", "a::B", "d", "e::F", "e::g::H", "e::g::I"].map(|path| format!("crate::{path}"));
    assert_eq!(imported[..6], all);
    assert_eq!(imported[6..], ["super::passed"]);
    let names: Vec<&str> = said.imports.iter().map(|import| import.name.as_str()).collect();
    assert_eq!(names, ["a", "C", "*", "F", "H", "I", "passed"]);
    assert_eq!(said.imports.iter().filter(|import| import.public).count(), 1);
    let paths: Vec<String> = said.paths.iter().map(written).collect();
    assert_eq!(
        paths,
        ["crate::number::count", "crate::inline::path", "self::here::now", "super::last::word"]
    );
    assert_eq!(said.paths[1].line, 15);
    assert_eq!(said.children, BTreeSet::from(["child".to_string()]));
    assert_eq!(said.test_modules, BTreeSet::from(["fixtures".to_string()]));
}

#[test]
fn a_circle_is_found_and_its_neighbours_are_not_part_of_it() {
    let edges = [(1, 2), (2, 3), (3, 1), (3, 4), (4, 5), (6, 1), (7, 8), (8, 7)];
    assert_eq!(circles(edges), [BTreeSet::from([1, 2, 3]), BTreeSet::from([7, 8])]);
}
