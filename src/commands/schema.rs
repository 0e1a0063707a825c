//! `isoflop schema`: the JSON Schema of sweep files, for editors.

use anyhow::Result;
use isoflop::sweep::schema as of_sweeps;

use super::exit::Exit;
use super::output::Output;

pub fn schema(output: &Output) -> Result<Exit> {
    let schema = of_sweeps();
    output.result(&schema, &serde_json::to_string_pretty(&schema)?)
}
