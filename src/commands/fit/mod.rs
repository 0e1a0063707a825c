//! `isoflop fit`: laws from a sweep, or from any table of runs.

mod args;
mod by;
mod fitted;
mod laws;
mod next;
mod request;
mod slow;
mod source;
mod study;
mod sweep;
mod table;

use std::path::PathBuf;

use anyhow::{Result, bail};
use isoflop::laws::{LawKind, Laws};

use super::exit::Exit;
use super::output::Output;
use fitted::Fitted;
use source::Source;

pub use args::{FitArgs, TableArgs};
pub use fitted::text;
pub use study::{TableStudy, beside};
pub use sweep::{fit_records, options, points};

pub fn fit(args: &FitArgs, output: &Output) -> Result<Exit> {
    let request = args.resolved();
    if let Some(column) = &args.by {
        return by::fit(column, &request, output);
    }
    let source = table::open(&args.source, &request)?;
    source.tell(output);
    let fitted = Fitted::of(&source, &request, output)?;
    if let (Some(path), Some(own)) = (&args.next, &source.sweep) {
        next::write(path, own, &fitted.laws)?;
        output.note(&format!("what to run next is {}", path.display()));
    } else if args.next.is_some() {
        bail!("--next wants a sweep's folder: nothing is known of how {} was made", source.name);
    }
    let own = own_file(&source, &fitted.laws);
    if let Some(path) = args.out.clone().or_else(|| own.filter(|_| args.save)) {
        fitted.write(&path)?;
    }
    output.result(&fitted.document, &fitted.text)?;
    let undetermined = fitted.laws.answer().exponents.is_undetermined();
    Ok(if undetermined { Exit::NotIdentifiable } else { Exit::Done })
}

/// A sweep's folder holds its own laws; those of another law stand beside them.
fn own_file(source: &Source, laws: &Laws) -> Option<PathBuf> {
    let folder = &source.sweep.as_ref()?.folder;
    Some(match laws.law {
        LawKind::Isoflop | LawKind::Published => folder.file("laws.json"),
        other => folder.file(format!("laws-{}.json", other.name())),
    })
}
