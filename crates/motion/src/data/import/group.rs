//! Groups that no split parts, and the splits.

use std::collections::{BTreeMap, HashMap, HashSet};

use super::listing::SourceFile;
use super::options::GroupBy;
use crate::data::Split;

/// Shares of the frames that are trained on, tested on, and validated on, in the order in which groups are
/// given away.
const SHARES: [(Split, f64); 3] = [(Split::Train, 0.8), (Split::Test, 0.15), (Split::Val, 0.05)];

/// The group of each file; folders where there are three or more, or else names.
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
