//! The files of an import, the groups that no split parts, and the splits.

use std::collections::{BTreeMap, HashMap, HashSet};
use std::path::{Path, PathBuf};

use super::options::{Form, GroupBy, ImportError, ImportOptions};
use crate::data::Split;
use crate::data::texts::read_splits;
use crate::files::{FileError, LARGE, read_regular};

/// A motion's file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SourceFile {
    pub path: PathBuf,
    /// Relative to the folder that is imported, with `/`.
    pub name: String,
    /// The stem, if it is unique.
    pub stem: Option<String>,
    /// Name of its clips: the stem, with the folders before it where two files have one stem.
    pub id: String,
}

impl SourceFile {
    /// The content, or why there is none.
    pub fn read(&self) -> Result<Vec<u8>, String> {
        read_regular(&self.path, LARGE).map_err(|error| format!("cannot be read: {error}"))
    }
}

/// The motions of a folder.
pub struct Listing {
    pub files: Vec<SourceFile>,
    /// The splits of its clips, if the folder has HumanML3D's layout.
    pub splits: Option<HashMap<String, Split>>,
    /// Its captions, if not next to the motions: the given ones, or those of that layout.
    pub texts: Option<PathBuf>,
    /// Whether it has that layout, so that its frames per second are known.
    pub humanml3d: bool,
}

/// Every file below `from` with the ending of its format, by name; in the HumanML3D layout those in `new_joints`, or for
/// KIT-ML with features only, in `new_joint_vecs`.
///
/// # Errors
/// The folder cannot be read, or has no such file.
pub fn list(options: &ImportOptions) -> Result<Listing, ImportError> {
    let ImportOptions { from: root, form, .. } = options;
    let own = layout(root, *form);
    let humanml3d = own.is_some();
    let base = own.unwrap_or_else(|| root.clone());
    let mut paths = below(&base, form.ending())?;
    if paths.is_empty() {
        return Err(ImportError::NoFiles { path: base, ending: form.ending() });
    }
    paths.sort();
    let texts = Some(root.join("texts")).filter(|folder| humanml3d && folder.is_dir());
    let texts = options.texts.clone().or(texts);
    let are_listed = humanml3d && root.join("train.txt").exists();
    let lists = are_listed.then(|| read_splits(root, false)).transpose()?;
    let splits =
        lists.map(|lists| lists.clips.into_iter().map(|(split, id)| (id, split)).collect());
    Ok(Listing { files: named(&base, paths), splits, texts, humanml3d })
}

/// The folder of motions in the HumanML3D layout; `None` for other layouts.
fn layout(root: &Path, form: Form) -> Option<PathBuf> {
    let places: &[&str] = match form {
        Form::Joints => &["new_joints"],
        Form::Kit => &["new_joints", "new_joint_vecs"],
        Form::Bvh | Form::SmplxJoints => &[],
    };
    places.iter().map(|place| root.join(place)).find(|place| place.is_dir())
}

/// The files below a folder with an ending, in no order. What links lead to counts once, under its own name if that lies
/// below the folder too.
fn below(folder: &Path, ending: &str) -> Result<Vec<PathBuf>, FileError> {
    let (mut seen, mut found) = (HashSet::new(), Vec::new());
    let (mut own, mut links) = (vec![folder.to_path_buf()], Vec::new());
    while let Some(path) = own.pop().or_else(|| links.pop()) {
        if !seen.insert(path.canonicalize().map_err(FileError::read(&path))?) {
            continue;
        }
        if !path.is_dir() {
            found.push(path);
            continue;
        }
        for entry in std::fs::read_dir(&path).map_err(FileError::read(&path))? {
            let entry = entry.map_err(FileError::read(&path))?.path();
            let hidden =
                entry.file_name().is_some_and(|name| name.to_string_lossy().starts_with('.'));
            let is_motion = entry.extension().is_some_and(|own| own.eq_ignore_ascii_case(ending));
            if !hidden && (is_motion || entry.is_dir()) {
                if entry.is_symlink() { links.push(entry) } else { own.push(entry) }
            }
        }
        // The first name of what several links lead to.
        links.sort_by(|a, b| b.cmp(a));
    }
    Ok(found)
}

fn named(base: &Path, paths: Vec<PathBuf>) -> Vec<SourceFile> {
    let stem = |path: &Path| path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let (mut stems, mut ids): (HashMap<String, usize>, HashMap<String, usize>) = Default::default();
    for path in &paths {
        *stems.entry(stem(path)).or_default() += 1;
        *ids.entry(clean(&stem(path))).or_default() += 1;
    }
    let named = paths.into_iter().map(|path| {
        let relative = path.strip_prefix(base).unwrap_or(&path);
        let name = relative.to_string_lossy().replace('\\', "/");
        let short = clean(&stem(&path));
        let long = clean(&relative.with_extension("").to_string_lossy());
        let own = Some(stem(&path)).filter(|stem| stems[stem] == 1);
        SourceFile { stem: own, id: if ids[&short] == 1 { short } else { long }, name, path }
    });
    distinct(named.collect())
}

/// The same with unique ids: a later file of a used id gets a number.
fn distinct(mut files: Vec<SourceFile>) -> Vec<SourceFile> {
    let mut taken: HashSet<String> = files.iter().map(|file| file.id.clone()).collect();
    let mut met = HashSet::new();
    for file in &mut files {
        if !met.insert(file.id.clone()) {
            let numbered = (2..).map(|n| format!("{}-{n}", file.id)).find(|id| !taken.contains(id));
            file.id = numbered.expect("numbers have no end");
            taken.insert(file.id.clone());
        }
    }
    files
}

/// A clip's name: letters, digits, `.`, `-`, `_` and the `~` of a part, not beginning with a dot.
fn clean(text: &str) -> String {
    let allowed = |c: char| if c.is_alphanumeric() || ".-_~".contains(c) { c } else { '_' };
    let text: String = text.chars().map(allowed).collect();
    text.trim_start_matches('.').to_string()
}

// Groups and splits.

/// Shares of the frames that are trained on, tested on, and validated on, in the order in which groups are
/// given away.
const SHARES: [(Split, f64); 3] = [(Split::Train, 0.8), (Split::Test, 0.15), (Split::Val, 0.05)];

/// The group of each file: by folder if there are three or more, else by name.
pub fn groups(files: &[SourceFile], by: Option<GroupBy>) -> Vec<String> {
    let of = |by: GroupBy| -> Vec<String> { files.iter().map(|file| group(file, by)).collect() };
    if let Some(by) = by {
        return of(by);
    }
    let folders = of(GroupBy::Folder);
    let distinct: HashSet<&String> = folders.iter().collect();
    if distinct.len() >= SHARES.len() { folders } else { of(GroupBy::Name) }
}

fn group(file: &SourceFile, by: GroupBy) -> String {
    match by {
        GroupBy::Folder => {
            file.name.rsplit_once('/').map_or(String::new(), |(folder, _)| folder.into())
        }
        GroupBy::Name => {
            let bare = file.id.trim_end_matches(|c: char| c.is_ascii_digit());
            let bare = bare.trim_end_matches(|c: char| !c.is_alphanumeric());
            if bare.is_empty() { file.id.clone() } else { bare.to_string() }
        }
        GroupBy::Prefix => file.id.split('_').next().unwrap_or_default().to_string(),
        GroupBy::File => file.id.clone(),
    }
}

/// A split for each group, by its number of frames; `None` with fewer groups than splits.
///
/// Groups are taken in the order of a hash of their names, each for the split that it fills least beyond its
/// share; a split without any takes the smallest group of the training split.
pub fn splits(frames: &BTreeMap<String, usize>) -> Option<HashMap<String, Split>> {
    if frames.len() < SHARES.len() {
        return None;
    }
    let mut order: Vec<(&String, usize)> = frames.iter().map(|(name, n)| (name, *n)).collect();
    order.sort_by_key(|(name, _)| *blake3::hash(name.as_bytes()).as_bytes());
    let mut filled = [0usize; 3];
    let mut of: HashMap<String, Split> = HashMap::new();
    for (name, n) in order {
        let fill = |i: usize| (filled[i] + n) as f64 / SHARES[i].1;
        let i = (0..3).min_by(|a, b| fill(*a).total_cmp(&fill(*b))).unwrap_or(0);
        filled[i] += n;
        of.insert(name.clone(), SHARES[i].0);
    }
    for (split, _) in &SHARES[1..] {
        if !of.values().any(|own| own == split) {
            let train = frames.iter().filter(|(name, _)| of[*name] == Split::Train);
            let smallest = train.min_by_key(|(_, n)| **n).map(|(name, _)| name.clone());
            smallest.and_then(|name| of.insert(name, *split));
        }
    }
    Some(of)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(name: &str) -> SourceFile {
        let id = name.rsplit('/').next().unwrap().to_string();
        SourceFile { path: name.into(), name: name.to_string(), stem: None, id }
    }

    #[test]
    fn groups_follow_folders_names_or_prefixes() {
        let files = ["01/a_01", "01/a_02", "02/b_x_003", "03/14"].map(file);
        assert_eq!(groups(&files, None), ["01", "01", "02", "03"]);
        assert_eq!(groups(&files, Some(GroupBy::Name)), ["a", "a", "b_x", "14"]);
        assert_eq!(groups(&files, Some(GroupBy::Prefix)), ["a", "a", "b", "14"]);
        assert_eq!(groups(&files[..2], None), ["a", "a"]);
    }

    #[test]
    fn splits_have_their_shares_and_none_is_empty() {
        let frames =
            |n: usize| (0..n).map(|i| (format!("g{i}"), 100 + i)).collect::<BTreeMap<_, _>>();
        for n in [3, 4, 7, 20, 400] {
            let splits = splits(&frames(n)).unwrap();
            let count = |split| splits.values().filter(|own| **own == split).count();
            let [train, val, test] = Split::ALL.map(count);
            assert!(train > 0 && val > 0 && test > 0 && train + val + test == n, "{n}");
            let frames = frames(n);
            let share = |split| {
                let own = frames.iter().filter(|(name, _)| splits[*name] == split);
                own.map(|(_, n)| *n as f64).sum::<f64>() / frames.values().sum::<usize>() as f64
            };
            if n == 400 {
                let [train, val, _] = Split::ALL.map(share);
                assert!(
                    (0.78..0.82).contains(&train) && (0.04..0.06).contains(&val),
                    "{train} {val}"
                );
            }
        }
        assert_eq!(splits(&frames(2)), None);
    }
}
