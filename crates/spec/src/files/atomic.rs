//! Files that are either whole or not there.

use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, Write};
use std::os::unix::fs::FileTypeExt;
use std::path::{Path, PathBuf};

use super::{FileError, digest};

/// How the name of a file that is not whole yet begins.
pub const PARTIAL: &str = ".partial-";

/// Removes partial files of killed processes from `folder`; no process may be writing there.
pub fn remove_partial(folder: &Path) -> Result<(), FileError> {
    if !folder.exists() {
        return Ok(());
    }
    let listed = fs::read_dir(folder).map_err(FileError::read(folder))?;
    for entry in listed {
        let entry = entry.map_err(FileError::read(folder))?;
        if entry.file_name().to_string_lossy().starts_with(PARTIAL) {
            fs::remove_file(entry.path()).map_err(FileError::write(&entry.path()))?;
        }
    }
    Ok(())
}

/// Removes a file, if it exists.
pub fn remove(path: &Path) -> Result<(), FileError> {
    match fs::remove_file(path) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(FileError::write(path)(error)),
        _ => Ok(()),
    }
}

/// Writes `path` atomically: a temporary file next to it is flushed to disk, then renamed.
///
/// A missing parent folder is made. Readers see the old file or the new one, never a part; a full disk keeps the old
/// one. A link is followed, a device or a pipe is written through, and a read-only file is left unchanged.
///
/// # Errors
/// [`FileError::Write`].
pub fn write_whole(
    path: &Path,
    fill: impl FnOnce(&mut BufWriter<&File>) -> io::Result<()>,
) -> Result<(), FileError> {
    write(path, fill, File::sync_all).map_err(FileError::write(path))
}

/// The treatment of an existing path.
enum Standing {
    /// This file is replaced, or made: the one that a link leads to.
    Replaced(PathBuf),
    /// A device or a pipe, which is written through.
    Through(File),
}

impl Standing {
    fn at(path: &Path) -> io::Result<Self> {
        let about = match fs::metadata(path) {
            Ok(about) => about,
            Err(error) if error.kind() == io::ErrorKind::NotFound => {
                return Ok(Self::Replaced(path.to_path_buf()));
            }
            Err(error) => return Err(error),
        };
        let kind = about.file_type();
        if kind.is_file() {
            let refused = io::ErrorKind::PermissionDenied;
            return match about.permissions().readonly() {
                true => Err(io::Error::new(refused, "the file there is read-only")),
                false => Ok(Self::Replaced(fs::canonicalize(path)?)),
            };
        }
        if kind.is_char_device() || kind.is_block_device() || kind.is_fifo() {
            return OpenOptions::new().write(true).open(path).map(Self::Through);
        }
        let what = if kind.is_dir() { "a folder" } else { "no file" };
        Err(io::Error::other(format!("what stands there is {what}")))
    }
}

/// Writes `path` as `flush` says: see [`write_whole`].
fn write(
    path: &Path,
    fill: impl FnOnce(&mut BufWriter<&File>) -> io::Result<()>,
    flush: impl FnOnce(&File) -> io::Result<()>,
) -> io::Result<()> {
    let path = &match Standing::at(path)? {
        Standing::Replaced(path) => path,
        Standing::Through(file) => return filled(&file, fill),
    };
    let folder = path.parent().unwrap_or(Path::new("."));
    fs::create_dir_all(folder)?;
    let temporary = tempfile::Builder::new().prefix(PARTIAL).tempfile_in(folder)?;
    filled(temporary.as_file(), fill)?;
    make_readable(temporary.as_file())?;
    flush(temporary.as_file())?;
    temporary.persist(path)?;
    tracing::debug!(path = %path.display(), "written");
    Ok(())
}

fn filled(
    file: &File,
    fill: impl FnOnce(&mut BufWriter<&File>) -> io::Result<()>,
) -> io::Result<()> {
    let mut writer = BufWriter::new(file);
    fill(&mut writer)?;
    writer.flush()
}

/// [`write_whole`] for bytes at hand.
pub fn write_bytes(path: &Path, bytes: &[u8]) -> Result<(), FileError> {
    write_whole(path, |file| file.write_all(bytes))
}

/// [`write_whole`] for a value as indented JSON with a newline at its end, and with its [digest].
pub fn write_json(path: &Path, value: &impl serde::Serialize) -> Result<(), FileError> {
    write_bytes(path, &with_digest(value).map_err(FileError::write(path))?)
}

/// [`write_json`] without a digest, for a file that other programs read or change.
pub fn write_plain_json(path: &Path, value: &impl serde::Serialize) -> Result<(), FileError> {
    write_bytes(path, json(value).map_err(FileError::write(path))?.as_bytes())
}

/// [`write_whole`] for values as JSON, a line each; the first line has the [digest] of all.
pub fn write_json_lines(path: &Path, values: &[impl serde::Serialize]) -> Result<(), FileError> {
    let line = |(at, value)| {
        let line = serde_json::to_string(value)?;
        Ok(if at == 0 { digest::within_json(&line) } else { line } + "\n")
    };
    let lines: io::Result<String> = values.iter().enumerate().map(line).collect();
    let lines = lines.map_err(FileError::write(path))?;
    write_bytes(path, &digest::fill(lines.into_bytes()))
}

/// [`write_whole`] for a text of YAML with its [digest].
pub fn write_yaml(path: &Path, text: &str) -> Result<(), FileError> {
    write_bytes(path, &digest::fill(digest::below_yaml(text).into_bytes()))
}

/// [`write_json`] for one of very many files that can be made again: a killed process leaves it whole
/// or not there, but it is not flushed, and a power cut may leave it empty.
pub fn write_json_unflushed(path: &Path, value: &impl serde::Serialize) -> Result<(), FileError> {
    let failed = FileError::write(path);
    let bytes = with_digest(value).map_err(&failed)?;
    write(path, |file| file.write_all(&bytes), |_| Ok(())).map_err(failed)
}

/// The bytes that [`write_json`] writes.
pub fn with_digest(value: &impl serde::Serialize) -> io::Result<Vec<u8>> {
    Ok(digest::fill(digest::within_json(&json(value)?).into_bytes()))
}

/// A value as indented JSON with a newline at its end.
pub fn json(value: &impl serde::Serialize) -> io::Result<String> {
    let mut text = serde_json::to_string_pretty(value)?;
    text.push('\n');
    Ok(text)
}

/// Temporary files are private; results are for everybody that the umask lets in.
fn make_readable(file: &File) -> io::Result<()> {
    use std::os::unix::fs::PermissionsExt;
    file.set_permissions(fs::Permissions::from_mode(0o644))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failed_write_leaves_the_old_file_and_no_other() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("record.json");
        write_bytes(&path, b"old").unwrap();
        let failed = write_whole(&path, |file| {
            file.write_all(b"half of the new")?;
            Err(io::Error::other("the disk is full"))
        });
        assert!(failed.is_err());
        assert_eq!(fs::read(&path).unwrap(), b"old");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn a_link_is_followed_a_pipe_written_through_and_a_read_only_file_left() {
        use std::os::unix::fs::{PermissionsExt, symlink};
        let folder = tempfile::tempdir().unwrap();
        let [file, link, pipe] = ["a.json", "link", "pipe"].map(|name| folder.path().join(name));
        write_bytes(&file, b"old").unwrap();
        symlink(&file, &link).unwrap();
        write_bytes(&link, b"new").unwrap();
        assert_eq!(fs::read(&file).unwrap(), b"new");
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        write_bytes(Path::new("/dev/null"), b"gone").unwrap();
        assert!(fs::metadata("/dev/null").unwrap().file_type().is_char_device());
        assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
        let reader = std::thread::spawn({
            let pipe = pipe.clone();
            move || fs::read(pipe).unwrap()
        });
        write_bytes(&pipe, b"through").unwrap();
        assert_eq!(reader.join().unwrap(), b"through");
        fs::set_permissions(&file, fs::Permissions::from_mode(0o444)).unwrap();
        let error = write_bytes(&link, b"third").unwrap_err().to_string();
        assert!(error.contains("read-only"), "{error}");
        assert_eq!(fs::read(&file).unwrap(), b"new");
        let error = write_bytes(folder.path(), b"").unwrap_err().to_string();
        assert!(error.contains("a folder"), "{error}");
    }

    #[test]
    fn leftovers_of_a_killed_process_are_removed_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("record.json");
        write_bytes(&path, b"whole").unwrap();
        fs::write(folder.path().join(".partial-x1y2z3"), b"hal").unwrap();
        remove_partial(folder.path()).unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"whole");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
        remove_partial(&folder.path().join("missing")).unwrap();
    }

    #[test]
    fn missing_folders_are_made() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("runs/a/record.json");
        write_json(&path, &[1, 2]).unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "[\n  1,\n  2\n]\n");
    }
}
