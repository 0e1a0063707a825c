//! Files of the largest sizes that are still real, within the limits of one input.

use crate::harness;
use crate::kinds::{models, motion, runs, sweeps, tables};

#[test]
fn a_bvh_with_a_line_of_20_mb_is_read_or_refused() {
    let head = "HIERARCHY\nROOT a\n{\nOFFSET 0 0 0\nCHANNELS 1 Yposition\n}\nMOTION\nFrames: 1\nFrame Time: 1\n";
    let numbers = [head.as_bytes(), &b"1.25 ".repeat(4 << 20)].concat();
    let name = [b"HIERARCHY\nROOT ", &b"x".repeat(20 << 20)[..], b"\nMOTION\n"].concat();
    let frames =
        [head.replace("Frames: 1", "Frames: 500000").as_bytes(), &b"1.25\n".repeat(500_000)]
            .concat();
    let joints = "JOINT a\n{\n".repeat(50_000);
    let deep = format!(
        "HIERARCHY\nROOT a\n{{\n{joints}{}}}\nMOTION\nFrames: 0\nFrame Time: 1\n",
        "}\n".repeat(50_000)
    );
    for bytes in [numbers, name, frames, deep.into_bytes()] {
        harness::one(&motion::BVH, &bytes);
    }
}

#[test]
fn a_table_with_a_cell_of_50_mb_or_many_rows_is_read_or_refused() {
    let table = |csv: &str| {
        format!("=== table\n{csv}\n=== columns\nparams=a,budget_flops=b,loss=c\n").into_bytes()
    };
    let cell = format!("a,b,c\n1,1e17,{}\n2,1e17,3\n", "9".repeat(50 << 20));
    let quoted = format!("a,b,c\n1,1e17,\"{}\n", "x\n".repeat(10 << 20));
    let rows = format!("a,b,c\n{}", "1e6,1e17,3.5\n".repeat(200_000));
    let columns = format!("{}\n{}\n", vec!["x"; 100_000].join(","), vec!["1"; 100_000].join(","));
    for csv in [cell, quoted, rows, columns] {
        harness::one(&tables::CSV, &table(&csv));
    }
}

#[test]
fn a_sweep_file_of_fifty_thousand_keys_is_refused() {
    let keys: String = (0..50_000).map(|i| format!("k{i}: 1\n")).collect();
    let vocab = format!(
        "name: a\ngrid: {{models: scamo, vocab: [{}], budgets: [1e18]}}\n",
        "64, ".repeat(20_000)
    );
    let seeds = format!(
        "name: a\nseeds: [{}0]\ngrid: {{models: scamo, vocab: [64], budgets: [1e18]}}\n",
        "0, ".repeat(20_000)
    );
    for text in [keys, vocab, seeds] {
        harness::one(&sweeps::SWEEP, text.as_bytes());
    }
}

#[test]
fn documents_of_20_mb_are_read_or_refused() {
    let deep = [b"[".repeat(10 << 20), b"]".repeat(10 << 20)].concat();
    let long = format!(
        "{{\"loss_nats\": 3, \"loss_normalised\": 1, \"device\": \"{}\"}}",
        "x".repeat(20 << 20)
    );
    let log = format!(
        "{{\"loss_nats\": 3, \"loss_normalised\": 1, \"log\": [{}]}}",
        vec!["1"; 5 << 20].join(",")
    );
    for bytes in [deep.clone(), long.into_bytes(), log.into_bytes()] {
        harness::one(&runs::RESULT, &bytes);
    }
    harness::one(&runs::RECORD, &deep);
    harness::one(&models::CLIP_CODES, &deep);
    harness::one(&motion::MAP, &deep);
    harness::one(&tables::EXPRESSION, &b"(".repeat(1 << 20));
}
