//! `isoflop cancel`: ends a sweep as Ctrl-C would, wherever it runs.

use anyhow::{Context, Result};
use isoflop::engine::{Cancelled, ENGINES};
use isoflop::jobs::ResultsFolder;
use serde_json::json;

use super::args::FolderArg;
use super::exit::Exit;
use super::output::Output;
use super::status;

pub fn cancel(args: &FolderArg, output: &Output) -> Result<Exit> {
    let folder = ResultsFolder::new(&args.results);
    status::state_of(&folder)?;
    let mut end = Cancelled::NothingRan;
    // Those that start work elsewhere first.
    for engine in ENGINES.into_iter().rev() {
        let asking = || format!("asking the engine {} to end", engine.name());
        end = end.max(engine.cancel(&folder, output).with_context(asking)?);
    }
    let state = status::state_of(&folder)?;
    let said = match end {
        Cancelled::NothingRan => "nothing is running here",
        Cancelled::Ended => "ended; what is finished stays",
        Cancelled::Killed => "ended, some of it by force; what is finished stays",
        Cancelled::StillAtWork => {
            "still at work a minute after it was asked to end; it may yet end"
        }
    };
    let (state, text) = status::told(&folder, &state)?;
    let document = json!({
        "was_running": end != Cancelled::NothingRan,
        "ended": end != Cancelled::StillAtWork,
        "state": state,
    });
    output.result(&document, &format!("{said}\n\n{text}"))?;
    Ok(if end == Cancelled::StillAtWork { Exit::SomeRunsFailed } else { Exit::Done })
}
