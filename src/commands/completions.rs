//! `isoflop completions`, `man` and `schema`: files for shells, manuals and editors.

use super::prelude::*;
use clap::Command;
use clap_complete::Shell;
use isoflop::sweep;

#[derive(Args)]
pub struct CompletionsArgs {
    /// The shell
    #[arg(value_enum)]
    pub shell: Shell,
}

pub fn completions(args: &CompletionsArgs, mut cli: Command, output: &Output) -> Result<Exit> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut cli, "isoflop", &mut script);
    let script = String::from_utf8_lossy(&script);
    output.result(&json!({ "script": script }), &script)
}

#[derive(Args)]
pub struct ManArgs {
    /// The folder to write the pages to, one for each command
    #[arg(long, default_value = "man")]
    pub out: PathBuf,
}

pub fn man(args: &ManArgs, cli: Command, output: &Output) -> Result<Exit> {
    let place = || format!("writing manual pages to {}", args.out.display());
    std::fs::create_dir_all(&args.out).with_context(place)?;
    clap_mangen::generate_to(cli, &args.out).with_context(place)?;
    let said = format!("{}: isoflop.1 and a page for each command", args.out.display());
    output.result(&json!({ "man": args.out }), &said)
}

pub fn schema(output: &Output) -> Result<Exit> {
    let schema = sweep::schema();
    output.result(&schema, &serde_json::to_string_pretty(&schema)?)
}
