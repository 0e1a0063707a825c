//! The files of a crate as a tree of modules, and which file needs which.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path as FilePath, PathBuf};

use crate::imports::{Path, Said, said};

/// A crate from its root file on.
pub struct Tree {
    pub files: Vec<File>,
    of_module: BTreeMap<Vec<String>, usize>,
}

/// A file that is compiled without tests.
pub struct File {
    /// From the folder of the package.
    pub path: PathBuf,
    /// `laws`, `minima` for `src/laws/minima/mod.rs`.
    pub module: Vec<String>,
    said: Said,
}

/// One file needs another.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Edge {
    pub from: usize,
    pub to: usize,
    pub line: usize,
    /// The path as it is written.
    pub written: String,
}

/// A path from the root of the crate on, in a file.
pub struct Named {
    pub file: usize,
    pub path: Vec<String>,
    pub line: usize,
}

/// The most steps from a name to the file that defines it.
const STEPS: usize = 8;

impl Tree {
    /// Reads `root` and the modules that it declares, and theirs.
    pub fn read(root: &str) -> Self {
        let mut tree = Self { files: Vec::new(), of_module: BTreeMap::new() };
        tree.take(PathBuf::from(root), Vec::new());
        tree
    }

    fn take(&mut self, path: PathBuf, module: Vec<String>) {
        let package = FilePath::new(env!("CARGO_MANIFEST_DIR"));
        let source = fs::read_to_string(package.join(&path))
            .unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        let said = said(&source);
        let folder = match path.file_stem().and_then(|stem| stem.to_str()) {
            Some("mod" | "lib" | "main") => path.parent().expect("a file has a folder").to_owned(),
            _ => path.with_extension(""),
        };
        let children = said.children.clone();
        self.of_module.insert(module.clone(), self.files.len());
        self.files.push(File { path, module: module.clone(), said });
        for child in children {
            let below = [&module[..], std::slice::from_ref(&child)].concat();
            let file = folder.join(format!("{child}.rs"));
            let within = folder.join(&child).join("mod.rs");
            self.take(if package.join(&file).exists() { file } else { within }, below);
        }
    }

    /// Every path that a file imports or names, from the root on.
    pub fn named(&self) -> impl Iterator<Item = Named> {
        self.files.iter().enumerate().flat_map(move |(file, of)| {
            let imported = of.said.imports.iter().map(|import| &import.path);
            imported.chain(&of.said.paths).filter_map(move |path| {
                let line = path.line;
                self.absolute(file, &path.segments).map(|path| Named { file, path, line })
            })
        })
    }

    /// Every need of one file for another.
    ///
    /// A name counts for the file that defines it, also where a module passes it on; a module and
    /// all names of a module count for the module's file. What is passed on and not used by its
    /// own file is no need of that file.
    pub fn edges(&self) -> BTreeSet<Edge> {
        let mut edges = BTreeSet::new();
        for (from, file) in self.files.iter().enumerate() {
            let mut add = |to: Option<usize>, path: &Path| {
                let written = path.segments.join("::");
                let edge = |to| Edge { from, to, line: path.line, written };
                edges.extend(to.filter(|&to| to != from).map(edge));
            };
            let said = &file.said;
            for import in &said.imports {
                let Some(path) = self.absolute(from, &import.path.segments) else { continue };
                if import.name == "*" {
                    let used = said.words.iter().filter_map(|word| self.binds(&path, word, STEPS));
                    used.for_each(|to| add(Some(to), &import.path));
                }
                let used = !import.public || said.words.contains(&import.name);
                add(used.then(|| self.resolve(&path, STEPS)).flatten(), &import.path);
            }
            for path in &said.paths {
                let to = self.absolute(from, &path.segments);
                add(to.and_then(|path| self.resolve(&path, STEPS)), path);
            }
        }
        edges
    }

    /// A path from the root on; `None` if it leads out of the crate or begins at an item.
    fn absolute(&self, file: usize, path: &[String]) -> Option<Vec<String>> {
        let File { module, said, .. } = &self.files[file];
        let (first, rest) = path.split_first()?;
        let above = path.iter().take_while(|word| *word == "super").count();
        let imported = || {
            let mut imports = said.imports.iter();
            let import = imports.find(|import| {
                import.name == *first && import.path.segments.first() != Some(first)
            })?;
            let path = self.absolute(file, &import.path.segments)?;
            self.of_module.contains_key(&path).then(|| [&path[..], rest].concat())
        };
        match first.as_str() {
            "crate" => Some(rest.to_vec()),
            "self" => Some([&module[..], rest].concat()),
            "super" => {
                let module = &module[..module.len().checked_sub(above)?];
                Some([module, &path[above..]].concat())
            }
            name if said.children.contains(name) => Some([&module[..], path].concat()),
            _ => imported(),
        }
    }

    /// The file that defines what an absolute path names.
    fn resolve(&self, path: &[String], steps: usize) -> Option<usize> {
        let known = (0..=path.len()).rev().find(|&n| self.of_module.contains_key(&path[..n]))?;
        let module = &path[..known];
        let found = path.get(known).and_then(|name| self.binds(module, name, steps));
        found.or(self.of_module.get(module).copied())
    }

    /// The file that defines `name` of a module; `None` if the module has no such name.
    fn binds(&self, module: &[String], name: &str, steps: usize) -> Option<usize> {
        let steps = steps.checked_sub(1)?;
        let file = *self.of_module.get(module)?;
        let said = &self.files[file].said;
        if said.items.contains(name) {
            return Some(file);
        }
        let child = [module, &[name.to_string()]].concat();
        if let Some(child) = self.of_module.get(&child) {
            return Some(*child);
        }
        let mut passed = said.imports.iter().filter(|import| import.name == name);
        if let Some(import) = passed.next() {
            let path = self.absolute(file, &import.path.segments)?;
            return self.resolve(&path, steps);
        }
        let all = said.imports.iter().filter(|import| import.name == "*");
        all.filter_map(|import| self.absolute(file, &import.path.segments))
            .find_map(|path| self.binds(&path, name, steps))
    }

    /// `src/laws/fit.rs:12 needs src/text/mod.rs: crate::text::wrap`, a line for each two files.
    pub fn shown<'a>(&self, edges: impl Iterator<Item = &'a Edge>) -> Vec<String> {
        let mut names = BTreeMap::<(usize, usize), Vec<&Edge>>::new();
        edges.for_each(|edge| names.entry((edge.from, edge.to)).or_default().push(edge));
        let path = |file: usize| self.files[file].path.display();
        let line = |((from, to), edges): (&(usize, usize), &Vec<&Edge>)| {
            let first = edges.iter().map(|edge| edge.line).min().unwrap_or_default();
            let written: BTreeSet<&str> = edges.iter().map(|edge| edge.written.as_str()).collect();
            let written = written.into_iter().collect::<Vec<_>>().join(", ");
            format!("{}:{first} needs {}: {written}", path(*from), path(*to))
        };
        names.iter().map(line).collect()
    }
}
