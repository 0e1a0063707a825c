//! [`RemovedEntries`]: entries that were wrong and were taken out, so that the rest could be looked at.

/// Paths of entries that were taken out, as they stand in the file.
///
/// An item that is taken out of a list moves those behind it forward; the file knows nothing of
/// that, so paths of what is left have to be led back.
#[derive(Default)]
pub struct RemovedEntries(Vec<String>);

impl RemovedEntries {
    /// Notes an entry by its path in the file.
    pub fn note(&mut self, path: String) {
        self.0.push(path);
    }

    /// Whether the entry is one of them: that it is missing now is no problem of its own.
    pub fn holds(&self, path: &str) -> bool {
        self.0.iter().any(|taken| taken == path)
    }

    /// Whether the list at `path` has lost items, so that its length says nothing.
    pub fn shortened(&self, path: &str) -> bool {
        !self.items(path).is_empty()
    }

    /// The path in the file of what stands at `path` now.
    pub fn in_the_file(&self, path: &str) -> String {
        let (mut found, mut rest) = (String::new(), path);
        while let Some((before, after)) = rest.split_once('[') {
            found.push_str(before);
            let (index, behind) = after.split_once(']').unwrap_or((after, ""));
            let index = index.parse().map_or(0, |index| self.index(&found, index));
            found.push_str(&format!("[{index}]"));
            rest = behind;
        }
        found + rest
    }

    fn index(&self, list: &str, index: usize) -> usize {
        self.items(list).into_iter().fold(index, |index, gone| index + usize::from(gone <= index))
    }

    /// Indices of the items of a list that are gone, ascending.
    fn items(&self, list: &str) -> Vec<usize> {
        let index = |path: &String| {
            path.strip_prefix(list)?.strip_prefix('[')?.strip_suffix(']')?.parse().ok()
        };
        let mut items: Vec<usize> = self.0.iter().filter_map(index).collect();
        items.sort_unstable();
        items
    }
}

#[cfg(test)]
mod tests {
    use super::RemovedEntries;

    #[test]
    fn paths_lead_back_past_every_item_that_is_gone() {
        let mut removed = RemovedEntries::default();
        for path in
            ["grid.models[3]", "grid.models[0]", "grid.models[1]", "grid.vocab[1].levels[0]"]
        {
            removed.note(path.to_string());
        }
        for (now, file) in [
            ("grid.models[0].n_head", "grid.models[2].n_head"),
            ("grid.models[1]", "grid.models[4]"),
            ("grid.vocab[1].levels[0]", "grid.vocab[1].levels[1]"),
            ("grid.vocab[2].levels[0]", "grid.vocab[2].levels[0]"),
            ("train.lr", "train.lr"),
        ] {
            assert_eq!(removed.in_the_file(now), file);
        }
        assert!(removed.shortened("grid.models") && !removed.shortened("grid.vocab"));
    }
}
