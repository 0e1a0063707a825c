//! Which clips of a folder were recorded together: `manifest.csv`, with a column `id` and a column `group`.

use std::collections::HashMap;
use std::io::ErrorKind;
use std::path::Path;

/// The group of each clip that the folder says one of. Groups change no clip and are no part of a digest.
#[derive(Debug, Default, PartialEq)]
pub(super) struct Groups(HashMap<String, String>);

impl Groups {
    /// Of the folder `path`; none without a manifest, or without its column `group`.
    ///
    /// # Errors
    /// A sentence: there is a manifest that cannot be read.
    pub fn read(path: &Path) -> Result<Self, String> {
        match crate::files::read_text(&path.join("manifest.csv")) {
            Err(error) if error.kind() == ErrorKind::NotFound => Ok(Self::default()),
            Err(error) => Err(problem(&error)),
            Ok(text) => Self::parse(&text).map_err(|error| problem(&error)),
        }
    }

    fn parse(text: &str) -> Result<Self, csv::Error> {
        let mut rows = csv::Reader::from_reader(text.as_bytes());
        let place = |name: &str, head: &csv::StringRecord| head.iter().position(|own| own == name);
        let head = rows.headers()?.clone();
        let Some((id, group)) = place("id", &head).zip(place("group", &head)) else {
            return Ok(Self::default());
        };
        let pair = |row: csv::StringRecord| (row[id].to_string(), row[group].to_string());
        Ok(Self(rows.records().map(|row| row.map(pair)).collect::<Result<_, _>>()?))
    }

    /// The group of the clip of a stem; its own where the folder says none. A mirrored clip, `M000012`, is of
    /// the group of the clip that it is the image of.
    pub fn of(&self, stem: &str) -> String {
        let (folder, name) =
            stem.rsplit_once('/').map_or(("", stem), |(folder, name)| (folder, name));
        let twin =
            name.strip_prefix('M').filter(|own| own.starts_with(|c: char| c.is_ascii_digit()));
        let own = match (twin, folder) {
            (Some(own), "") => own.to_string(),
            (Some(own), folder) => format!("{folder}/{own}"),
            (None, _) => stem.to_string(),
        };
        self.0.get(stem).or_else(|| self.0.get(&own)).cloned().unwrap_or(own)
    }
}

fn problem(error: &dyn std::fmt::Display) -> String {
    format!("manifest.csv cannot be read, so each clip counts as recorded by itself: {error}")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(text: &str) -> Groups {
        Groups::parse(text).unwrap()
    }

    #[test]
    fn clips_of_a_manifest_are_of_its_groups() {
        let groups = of("id,label,group\n000001,\"walks, turns\",s1\n000002,runs,s1\n");
        assert_eq!(["000001", "000002", "M000002"].map(|stem| groups.of(stem)), ["s1"; 3]);
        assert_eq!(groups.of("000003"), "000003");
    }

    #[test]
    fn without_groups_a_clip_and_its_image_are_one() {
        let groups = of("id,label\n000001,walks\n");
        assert_eq!(["000007", "M000007"].map(|stem| groups.of(stem)), ["000007"; 2]);
        assert_eq!(["a/M1", "Moon"].map(|stem| groups.of(stem)), ["a/1", "Moon"]);
    }

    #[test]
    fn a_torn_manifest_is_told_and_a_missing_one_is_not() {
        let folder = tempfile::tempdir().unwrap();
        assert_eq!(Groups::read(folder.path()), Ok(Groups::default()));
        std::fs::write(folder.path().join("manifest.csv"), "id,group\n1,a\n2\n").unwrap();
        let problem = Groups::read(folder.path()).unwrap_err();
        assert!(problem.starts_with("manifest.csv cannot be read, so each clip"), "{problem}");
    }
}
