//! Files: written whole, by rename, with a digest; of columns; read as JSON or line by line; set aside where they are
//! damaged; TensorBoard's events.
//!
//! # Example
//!
//! ```
//! use isoflop_spec::files::{atomic, read_if_there};
//!
//! let folder = tempfile::tempdir()?;
//! let path = folder.path().join("budget.json");
//! assert_eq!(read_if_there::<f64>(&path)?, None);
//! atomic::write_json(&path, &1e18)?; // renamed into place
//! assert_eq!(read_if_there(&path)?, Some(1e18));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod atomic;
pub mod columns;
pub mod digest;
pub mod lines;
pub mod tensorboard;

use std::error::Error;
use std::fs::{self, File};
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;

use crate::failure::FailureKind;

// [`FileError`]: why a file cannot be used.

/// Why a file cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum FileError {
    /// The system refuses to write it.
    #[error("cannot write {}: {source}", path.display())]
    Write { path: PathBuf, source: io::Error },
    /// The system refuses to read it: this says nothing about the file, unless it is gone.
    #[error("cannot read {}: {source}", path.display())]
    Read { path: PathBuf, source: io::Error },
    /// It can be read, but is damaged.
    #[error("{} is damaged ({reason}); {advice}", path.display())]
    Damaged { path: PathBuf, reason: String, advice: &'static str },
    /// It was what was written there, and another program changed it since.
    #[error("{} changed while it was used, so nothing that followed from it counts", path.display())]
    Changed { path: PathBuf },
}

impl FileError {
    /// A write that the system refused.
    pub fn write(path: &Path) -> impl Fn(io::Error) -> Self {
        move |source| Self::Write { path: path.to_path_buf(), source }
    }

    /// A read that the system refused.
    pub fn read(path: &Path) -> impl Fn(io::Error) -> Self {
        move |source| Self::Read { path: path.to_path_buf(), source }
    }

    /// The error of a damaged file.
    pub fn damaged(path: &Path, reason: impl ToString) -> Self {
        let advice = mended_by(path);
        Self::Damaged { path: path.to_path_buf(), reason: reason.to_string(), advice }
    }

    /// The same for a damaged file with another remedy.
    pub fn with_advice(self, advice: &'static str) -> Self {
        match self {
            Self::Damaged { path, reason, .. } => Self::Damaged { path, reason, advice },
            other => other,
        }
    }

    /// The file.
    pub fn path(&self) -> &Path {
        match self {
            Self::Write { path, .. }
            | Self::Read { path, .. }
            | Self::Damaged { path, .. }
            | Self::Changed { path } => path,
        }
    }

    /// Whether the cause is the file itself: damaged or gone. Refusals of the system (memory, rights, a failing disk) are
    /// not.
    pub fn is_damage(&self) -> bool {
        match self {
            Self::Damaged { .. } => true,
            // Without an error number of the system, mapping failed.
            Self::Read { source, .. } => {
                source.kind() == io::ErrorKind::NotFound || source.raw_os_error().is_none()
            }
            Self::Write { .. } | Self::Changed { .. } => false,
        }
    }

    /// The failure of a job that ends with it.
    pub fn failure_kind(&self) -> FailureKind {
        match self {
            Self::Damaged { .. } => FailureKind::Damaged,
            Self::Changed { .. } => FailureKind::FilesChanged,
            Self::Write { source, .. } => match source.raw_os_error() {
                // EPERM, EACCES.
                Some(1 | 13) => FailureKind::ReadOnly,
                _ => FailureKind::of_io(source).unwrap_or(FailureKind::Other),
            },
            Self::Read { source, .. } => FailureKind::of_io(source).unwrap_or_else(|| {
                if self.is_damage() { FailureKind::Damaged } else { FailureKind::Other }
            }),
        }
    }

    /// The file error in an error's chain of causes.
    pub fn among<'a>(error: &'a (dyn Error + 'static)) -> Option<&'a Self> {
        chain(error).find_map(|cause| {
            let inner = || cause.downcast_ref::<io::Error>()?.get_ref()?.downcast_ref::<Self>();
            cause.downcast_ref::<Self>().or_else(inner)
        })
    }
}

impl From<FileError> for io::Error {
    fn from(error: FileError) -> Self {
        let kind = match &error {
            FileError::Write { source, .. } | FileError::Read { source, .. } => source.kind(),
            FileError::Damaged { .. } | FileError::Changed { .. } => io::ErrorKind::InvalidData,
        };
        io::Error::new(kind, error)
    }
}

/// The kind of failure that an error of files or of the system means, through whatever wraps it;
/// `None` if no such error is among its causes.
pub fn failure_kind(error: &(dyn Error + 'static)) -> Option<FailureKind> {
    let of_file = FileError::among(error).map(FileError::failure_kind);
    of_file.or_else(|| {
        chain(error).find_map(|cause| FailureKind::of_io(cause.downcast_ref::<io::Error>()?))
    })
}

fn chain<'a>(error: &'a (dyn Error + 'static)) -> impl Iterator<Item = &'a (dyn Error + 'static)> {
    let mut next = Some(error);
    std::iter::from_fn(move || {
        let error = next?;
        next = error.source();
        Some(error)
    })
}

// Files of others, read whole: regular ones of a bounded size, since a device or a pipe may have no end.

/// Bytes of a text that ought to be small: a sweep file, a list of clips, captions, a map.
pub const SMALL: u64 = 64 << 20;
/// Bytes of a motion or of a result.
pub const LARGE: u64 = 2 << 30;
/// Bytes of weights, which may be of any size.
pub const ANY: u64 = u64::MAX - 1;

/// The bytes of a regular file of `most` bytes at most; a link is followed.
///
/// # Errors
/// The system's; a folder, a device or a pipe; a larger file.
pub fn read_regular(path: &Path, most: u64) -> io::Result<Vec<u8>> {
    let about = fs::metadata(path)?;
    if !about.is_file() && !about.is_dir() {
        return Err(io::Error::other("it is a device or a pipe, and no regular file"));
    }
    let too_large = || io::Error::other(format!("it holds more than {} MiB", most >> 20));
    if about.len() > most {
        return Err(too_large());
    }
    let mut bytes = Vec::new();
    // ENOMEM.
    let refused = |_| io::Error::from_raw_os_error(12);
    bytes.try_reserve_exact(about.len() as usize).map_err(refused)?;
    File::open(path)?.take(most + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > most { Err(too_large()) } else { Ok(bytes) }
}

/// Reads the text of a regular, small file.
///
/// # Errors
/// Those of [`read_regular`]; it is not UTF-8.
pub fn read_text(path: &Path) -> io::Result<String> {
    String::from_utf8(read_regular(path, SMALL)?)
        .map_err(|_| io::Error::new(io::ErrorKind::InvalidData, "it is not UTF-8"))
}

// Files that may be missing or damaged.

/// Reads a JSON file; a missing one is `None`, a damaged one, or one with the digest of other bytes, an error that names
/// it.
///
/// # Errors
/// [`FileError::Read`] and [`FileError::Damaged`].
pub fn read_if_there<T: DeserializeOwned>(path: &Path) -> Result<Option<T>, FileError> {
    let damaged = |error| FileError::damaged(path, error);
    let bytes = if_there(path, read_regular(path, LARGE))?;
    let bytes = bytes.map(|bytes| as_written(path, bytes)).transpose()?;
    bytes.map(|bytes| serde_json::from_slice(&bytes).map_err(damaged)).transpose()
}

/// The content of a JSON or YAML file without its digest.
///
/// # Errors
/// [`FileError::Damaged`]: the digest is that of other bytes.
pub fn as_written(path: &Path, bytes: Vec<u8>) -> Result<Vec<u8>, FileError> {
    unchanged(path, &bytes)?;
    Ok(digest::without(bytes))
}

/// Refuses a file with the digest of other bytes.
///
/// # Errors
/// [`FileError::Damaged`].
pub fn unchanged(path: &Path, bytes: &[u8]) -> Result<(), FileError> {
    match digest::is_wrong(bytes) {
        true => Err(FileError::damaged(path, digest::CHANGED)),
        false => Ok(()),
    }
}

/// Reads a YAML file that isoflop wrote; a missing one is `None`.
///
/// # Errors
/// [`FileError::Read`]; [`FileError::Damaged`]: it is no text, or its digest is that of other bytes.
pub fn read_yaml_if_there(path: &Path) -> Result<Option<String>, FileError> {
    let Some(bytes) = if_there(path, read_regular(path, SMALL))? else { return Ok(None) };
    let text = String::from_utf8(as_written(path, bytes)?);
    text.map(Some).map_err(|_| FileError::damaged(path, "it is not UTF-8"))
}

/// Reads a text file; a missing one is `None`.
///
/// # Errors
/// [`FileError::Read`].
pub fn read_text_if_there(path: &Path) -> Result<Option<String>, FileError> {
    if_there(path, read_text(path))
}

fn if_there<T>(path: &Path, read: io::Result<T>) -> Result<Option<T>, FileError> {
    match read {
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        read => read.map(Some).map_err(FileError::read(path)),
    }
}

/// How a damaged file is mended.
fn mended_by(path: &Path) -> &'static str {
    match path.file_name().and_then(|name| name.to_str()).unwrap_or_default() {
        "record.json" => "`isoflop run` sets it aside and trains the run again",
        "metrics.json" => "`isoflop run` sets it aside and trains the tokenizer again",
        "failure.json" => "`isoflop run` with --retry-failed tries the job again",
        "gates.json" => "`isoflop run` sets it aside and trains the evaluator again",
        "scores.json" => "`isoflop run` sets it aside and scores the run again",
        "laws.json" => {
            "`isoflop run` writes it again, and so does `isoflop fit` with --save or --out"
        }
        "plan.json" | "spec.json" | "job.json" | "prediction.json" | "sweep.yaml"
        | "runs.parquet" | "scores.parquet" => "`isoflop run` writes it again",
        _ => "remove it to have it made again",
    }
}

/// Moves a file to `damaged-NAME` in the same folder, replacing an older one. Returns the new path, or `None` if the
/// file is gone already.
///
/// # Errors
/// The folder cannot be written to.
pub fn set_aside(path: &Path) -> Result<Option<PathBuf>, FileError> {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let aside = path.with_file_name(format!("damaged-{name}"));
    match fs::rename(path, &aside) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        moved => moved.map_err(FileError::write(&aside)).map(|()| Some(aside)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(code: i32) -> io::Error {
        io::Error::from_raw_os_error(code)
    }

    #[test]
    fn what_the_system_refused_is_told_from_its_number() {
        let write = |code| FileError::write(Path::new("a/b"))(refused(code)).failure_kind();
        assert_eq!([27, 28, 122].map(write), [FailureKind::DiskFull; 3]);
        assert_eq!([1, 13, 30].map(write), [FailureKind::ReadOnly; 3]);
        assert_eq!(write(12), FailureKind::OutOfMemory);
        let read = |code| FileError::read(Path::new("a/b"))(refused(code)).failure_kind();
        assert_eq!([5, 13, 24].map(read), [FailureKind::Other; 3]);
        assert_eq!(read(2), FailureKind::Damaged);
    }

    #[test]
    fn what_cannot_be_read_now_is_not_damaged() {
        let read = |code| FileError::read(Path::new("a"))(refused(code)).is_damage();
        assert!(read(2) && ![5, 12, 13, 24].into_iter().any(read));
        assert!(FileError::damaged(Path::new("a"), "invalid header").is_damage());
    }

    #[test]
    fn a_kind_is_found_through_what_wraps_it() {
        let full = FileError::write(Path::new("a"))(refused(28));
        let wrapped = anyhow::Error::new(io::Error::from(full)).context("writing the table");
        assert_eq!(failure_kind(wrapped.as_ref()), Some(FailureKind::DiskFull));
        let bare = anyhow::Error::new(refused(12)).context("starting a worker");
        assert_eq!(failure_kind(bare.as_ref()), Some(FailureKind::OutOfMemory));
        assert_eq!(failure_kind(anyhow::Error::msg("the loss is NaN").as_ref()), None);
    }

    #[test]
    fn what_has_no_end_is_refused_and_a_link_is_followed() {
        let folder = tempfile::tempdir().unwrap();
        let [text, link, pipe] = ["a.txt", "link", "pipe"].map(|name| folder.path().join(name));
        fs::write(&text, "walks").unwrap();
        std::os::unix::fs::symlink(&text, &link).unwrap();
        assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
        assert_eq!(read_text(&link).unwrap(), "walks");
        for endless in [Path::new("/dev/zero"), &pipe] {
            let error = read_text(endless).unwrap_err().to_string();
            assert!(error.contains("no regular file"), "{error}");
        }
        assert_eq!(
            read_text(&folder.path().join("none")).unwrap_err().kind(),
            io::ErrorKind::NotFound
        );
        assert!(read_regular(&text, 4).unwrap_err().to_string().contains("more than"));
        fs::write(&text, [0xff, 0xfe]).unwrap();
        assert!(read_text(&text).unwrap_err().to_string().contains("UTF-8"));
    }

    #[test]
    fn a_damaged_file_is_kept_beside_and_a_second_look_finds_none() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("record.json");
        fs::write(&path, "{").unwrap();
        let aside = set_aside(&path).unwrap().unwrap();
        assert!(aside.ends_with("damaged-record.json") && aside.exists() && !path.exists());
        assert_eq!(set_aside(&path).unwrap(), None);
    }
}
