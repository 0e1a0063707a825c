//! `--next`: writes the advised runs as a sweep file that includes the sweep's own.

use super::source::OwnSweep;
use crate::commands::export::way;
use crate::commands::generators::home;
use crate::commands::prelude::*;
use crate::commands::sizes::{codes, distinct, model, nonvocab};
use isoflop::laws::{Advice, AdviceKind};
use isoflop::sweep::{GridPart, ModelEntry, ModelList, VocabSpec, models};

/// Largest factor between an advised size and a sweep's size that replaces it.
const SAME: f64 = 0.01;

/// Writes the advice of laws as a sweep that trains missing runs in the folder of the sweep's own runs.
///
/// # Errors
/// There is no advice for a grid; a model cannot be built; the file cannot be written.
pub fn write(path: &Path, own: &OwnSweep, laws: &Laws) -> Result<()> {
    if home(&own.folder).root() != own.folder.root() {
        bail!(
            "--next would train every generator of the sweep: run a sweep of one generator for it"
        );
    }
    let advised = laws.advice.iter().filter(|advice| advice.kind != AdviceKind::AddSeeds);
    let parts: Vec<(&Advice, GridPart)> =
        advised.map(|advice| Ok((advice, part(&own.sweep, advice)?))).collect::<Result<_>>()?;
    if parts.is_empty() {
        bail!("the laws of {} advise no further runs", laws.name);
    }
    let base = own.folder.file("sweep.yaml");
    let text = text(own, &relative(path, &base)?, path, &parts);
    Ok(atomic::write_bytes(path, text.as_bytes())?)
}

/// The sizes of an advice, as models and vocabularies that can be built.
fn part(sweep: &Sweep, advice: &Advice) -> Result<GridPart> {
    let tried = models(&sweep.grid.models);
    let entry = |size: &f64| -> Result<ModelEntry> {
        let near = |entry: &&ModelEntry| (nonvocab(sweep, entry) / size).ln().abs() < SAME;
        tried.iter().find(near).cloned().map_or_else(|| model(sweep, *size), Ok)
    };
    let vocabulary = |v: &f64| {
        let has =
            |entry: &&VocabSpec| sweep.quantizer(entry).is_ok_and(|own| own.n_vocab() as f64 == *v);
        sweep.grid.vocab.iter().find(has).cloned().unwrap_or_else(|| codes(*v, sweep))
    };
    let models: Vec<ModelEntry> =
        advice.params_nonvocab.iter().map(entry).collect::<Result<_>>()?;
    Ok(GridPart {
        models: ModelList::List(distinct(models)),
        vocab: distinct(advice.n_vocab.iter().map(vocabulary).collect()),
        budgets: vec![budget(advice)],
    })
}

/// A budget of the sweep exactly, a new one to four digits.
fn budget(advice: &Advice) -> f64 {
    let is_new = matches!(advice.kind, AdviceKind::LargerBudget | AdviceKind::NextBudget);
    let rounded = format!("{:.3e}", advice.budget_flops).parse();
    rounded.ok().filter(|_| is_new).unwrap_or(advice.budget_flops)
}

fn text(own: &OwnSweep, base: &Path, path: &Path, parts: &[(&Advice, GridPart)]) -> String {
    let OwnSweep { folder, sweep, .. } = own;
    let runs: usize = parts.iter().map(|(advice, _)| advice.runs).sum();
    let flops: f64 = parts.iter().map(|(advice, _)| advice.flops).sum();
    let out = folder.root().parent().unwrap_or(Path::new("")).display();
    let mut text = format!(
        "# What the laws of {} leave open: {runs} runs, {flops:.2e} FLOPs. They are trained beside the runs that are\n\
         # there, by\n#   isoflop run {} --out {out}\ninclude: {}\ngrid:\n  also:\n",
        sweep.name,
        path.display(),
        base.display()
    );
    sweep.grid.also.iter().for_each(|part| text += &yaml(part));
    for (advice, part) in parts {
        let why = wrap("", &format!("{:e} FLOPs: {}", budget(advice), advice.why));
        why.lines().for_each(|line| text += &format!("    # {line}\n"));
        text += &yaml(part);
    }
    text
}

fn yaml(part: &GridPart) -> String {
    let GridPart { models: list, vocab, budgets } = part;
    let model = |ModelEntry { n_layer, n_head, d_model, d_ff }: &ModelEntry| {
        let d_ff = d_ff.map_or_else(String::new, |d_ff| format!(", d_ff: {d_ff}"));
        format!("        - {{n_layer: {n_layer}, n_head: {n_head}, d_model: {d_model}{d_ff}}}\n")
    };
    let models: String = models(list).iter().map(model).collect();
    let vocabulary = |entry: &VocabSpec| match entry {
        VocabSpec::Size(n) => n.to_string(),
        VocabSpec::Levels(spec) => format!("{{levels: {:?}}}", spec.levels),
    };
    let vocab: Vec<String> = vocab.iter().map(vocabulary).collect();
    let budgets: Vec<String> = budgets.iter().map(|budget| format!("{budget:e}")).collect();
    format!(
        "    - models:\n{models}      vocab: [{}]\n      budgets: [{}]\n",
        vocab.join(", "),
        budgets.join(", ")
    )
}

/// The path of `base` from the folder of `file`.
fn relative(file: &Path, base: &Path) -> Result<PathBuf> {
    let folder = file.parent().filter(|folder| *folder != Path::new(""));
    let folder = folder.unwrap_or(Path::new("."));
    let find =
        |path: &Path| path.canonicalize().with_context(|| format!("finding {}", path.display()));
    let (folder, base) = (find(folder)?, find(base)?);
    Ok(way(&folder, &base))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_base_is_found_from_the_folder_of_the_file() {
        let root = tempfile::tempdir().unwrap();
        std::fs::create_dir_all(root.path().join("results/a")).unwrap();
        std::fs::create_dir_all(root.path().join("mine")).unwrap();
        let base = root.path().join("results/a/sweep.yaml");
        std::fs::write(&base, "").unwrap();
        let of = |file: &str| relative(&root.path().join(file), &base).unwrap();
        assert_eq!(of("mine/next.yaml"), Path::new("../results/a/sweep.yaml"));
        assert_eq!(of("results/a/next.yaml"), Path::new("sweep.yaml"));
        assert!(relative(&root.path().join("no/next.yaml"), &base).is_err());
    }
}
