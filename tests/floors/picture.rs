//! The picture of ARCHITECTURE.md: the modules of each crate on their floors, and who imports whom.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;

use crate::{LIBRARIES, floors, tree::Tree};

/// The crates from the top down, each with its root file.
const CRATES: [(&str, &str); 5] = [
    ("isoflop", LIBRARIES[0]),
    ("isoflop-model", LIBRARIES[2]),
    ("isoflop-motion", LIBRARIES[3]),
    ("isoflop-spec", LIBRARIES[4]),
    ("isoflop-laws", LIBRARIES[1]),
];

const WIDTH: usize = 760;
const BOX: [usize; 2] = [92, 26];
/// From one floor to the next, and from the top of a crate to its first floor.
const FLOOR: usize = 56;
const HEAD: usize = 16;

/// Every import of one module by another of any crate, without those that follow from others.
fn imports() -> BTreeSet<(String, String)> {
    let mut all = BTreeSet::new();
    let modules: BTreeSet<String> =
        CRATES.iter().flat_map(|(_, root)| floors(root).into_keys()).collect();
    for (_, root) in CRATES {
        let tree = Tree::read(root);
        for named in tree.named() {
            let ends = (tree.files[named.file].module.first(), named.path.first());
            if let (Some(from), Some(to)) = ends
                && from != to
                && modules.contains(to)
            {
                all.insert((from.clone(), to.clone()));
            }
        }
    }
    let reached = |from: &str, to: &str| {
        let mut next: Vec<&str> =
            all.iter().filter(|(a, b)| a == from && b != to).map(|(_, b)| b.as_str()).collect();
        let mut seen = BTreeSet::new();
        while let Some(module) = next.pop() {
            if seen.insert(module) {
                next.extend(all.iter().filter(|(a, _)| a == module).map(|(_, b)| b.as_str()));
            }
        }
        seen.contains(to)
    };
    all.iter().filter(|(from, to)| !reached(from, to)).cloned().collect()
}

/// The picture as SVG.
pub fn picture() -> String {
    let (mut crates, mut boxes) = (String::new(), String::new());
    let mut at = BTreeMap::<String, [usize; 2]>::new();
    let mut top = 8;
    for (name, root) in CRATES {
        let mut rows = BTreeMap::<usize, Vec<String>>::new();
        let is_program = root == LIBRARIES[0];
        let table = floors(root);
        for (module, floor) in table {
            rows.entry(floor.number).or_default().push(module);
        }
        if is_program {
            rows.insert(usize::MAX, vec!["commands".to_string()]);
        }
        let height = HEAD + rows.len() * FLOOR - (FLOOR - BOX[1]) + 14;
        let _ = writeln!(
            crates,
            "<rect x=\"4\" y=\"{top}\" width=\"{}\" height=\"{height}\" rx=\"6\" class=\"crate\"/>\
             <text x=\"14\" y=\"{}\" class=\"name\">{name}</text>",
            WIDTH - 8,
            top + 18,
        );
        for (row, modules) in rows.values().rev().enumerate() {
            let y = top + HEAD + row * FLOOR;
            for (i, module) in modules.iter().enumerate() {
                // One alone stands now left, now right of the middle: lines down the middle would meet.
                let aside = if modules.len() == 1 { 200 * (row % 2) } else { 100 };
                let x = (2 * i + 1) * (WIDTH - 120) / (2 * modules.len()) + 20 + aside;
                at.insert(module.clone(), [x, y]);
                let _ = writeln!(
                    boxes,
                    "<rect x=\"{}\" y=\"{y}\" width=\"{}\" height=\"{}\" rx=\"4\" class=\"module\"/>\
                     <text x=\"{x}\" y=\"{}\" class=\"label\">{module}</text>",
                    x - BOX[0] / 2,
                    BOX[0],
                    BOX[1],
                    y + 17,
                );
            }
        }
        top += height + 10;
    }
    let mut lines = String::new();
    for (from, to) in imports() {
        let ([x1, y1], [x2, y2]) = (at[&from], at[&to]);
        let _ = match y1 == y2 {
            // Beside one another: an arc above both.
            true => {
                writeln!(lines, "<path d=\"M{x1},{y1} C{x1},{0} {x2},{0} {x2},{y2}\"/>", y1 - 18)
            }
            false => {
                let below = y1 + BOX[1];
                let bend = (y2 - below) / 2;
                let (c1, c2) = (below + bend, y2 - bend);
                writeln!(lines, "<path d=\"M{x1},{below} C{x1},{c1} {x2},{c2} {x2},{y2}\"/>")
            }
        };
    }
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {top}\" width=\"{WIDTH}\" \
         height=\"{top}\" font-family=\"sans-serif\">\n<style>.crate{{fill:#f3f5f8;stroke:#c9d1db}}\
         .module{{fill:#fff;stroke:#33475b}}.name{{font-size:12px;font-weight:bold;fill:#33475b}}\
         .label{{font-size:13px;text-anchor:middle;fill:#111}}path{{fill:none;stroke:#6b8cae;opacity:.75}}\
         </style>\n<rect width=\"{WIDTH}\" height=\"{top}\" fill=\"#fff\"/>\n{crates}{lines}{boxes}</svg>\n"
    )
}
