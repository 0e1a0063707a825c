//! [`FileError`]: what hinders the use of a file, as a type from where it arises.

use std::error::Error;
use std::io;
use std::path::{Path, PathBuf};

use crate::failure::FailureKind;

/// What hinders the use of a file.
#[derive(Debug, thiserror::Error)]
pub enum FileError {
    /// The system refuses to write it.
    #[error("cannot write {}: {source}", path.display())]
    Write { path: PathBuf, source: io::Error },
    /// The system refuses to read it: this says nothing about the file, unless it is gone.
    #[error("cannot read {}: {source}", path.display())]
    Read { path: PathBuf, source: io::Error },
    /// It was read, and is not what was written there.
    #[error("{} is damaged ({reason}); {advice}", path.display())]
    Damaged { path: PathBuf, reason: String, advice: &'static str },
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

    /// A file that is not what was written there.
    pub fn damaged(path: &Path, reason: impl ToString) -> Self {
        let advice = "remove it to have it made again";
        Self::Damaged { path: path.to_path_buf(), reason: reason.to_string(), advice }
    }

    /// The same for a damaged file that is mended in another way.
    pub fn with_advice(self, advice: &'static str) -> Self {
        match self {
            Self::Damaged { path, reason, .. } => Self::Damaged { path, reason, advice },
            other => other,
        }
    }

    /// The file.
    pub fn path(&self) -> &Path {
        match self {
            Self::Write { path, .. } | Self::Read { path, .. } | Self::Damaged { path, .. } => path,
        }
    }

    /// Whether the reason lies in the file: it is there and wrong, or gone. What the system refuses
    /// (memory, rights, a disk that fails) says nothing about it.
    pub fn is_damage(&self) -> bool {
        match self {
            Self::Damaged { .. } => true,
            // Where the system gave no number, what was read could not be mapped.
            Self::Read { source, .. } => {
                source.kind() == io::ErrorKind::NotFound || source.raw_os_error().is_none()
            }
            Self::Write { .. } => false,
        }
    }

    /// The failure of a job that ends with it.
    pub fn failure_kind(&self) -> FailureKind {
        match self {
            Self::Damaged { .. } => FailureKind::Damaged,
            Self::Write { source, .. } => match source.raw_os_error() {
                // EPERM, EACCES.
                Some(1 | 13) => FailureKind::ReadOnly,
                _ => FailureKind::of_io(source).unwrap_or(FailureKind::Other),
            },
            Self::Read { source, .. } => {
                FailureKind::of_io(source).unwrap_or(if self.is_damage() {
                    FailureKind::Damaged
                } else {
                    FailureKind::Other
                })
            }
        }
    }

    /// The file error among an error and what caused it.
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
            FileError::Damaged { .. } => io::ErrorKind::InvalidData,
        };
        io::Error::new(kind, error)
    }
}

/// The kind of failure that an error of files or of the system means, through whatever wraps it;
/// `None` where no such error is among its causes.
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
}
