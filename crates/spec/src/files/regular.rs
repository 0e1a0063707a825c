//! Files of others, read whole: regular ones of a bounded size, since a device or a pipe may have no end.

use std::fs::{self, File};
use std::io::{self, Read};
use std::path::Path;

/// Bytes of a text that ought to be small: a sweep file, a list of clips, captions, a map.
pub const SMALL: u64 = 64 << 20;
/// Bytes of a motion or of a result.
pub const LARGE: u64 = 2 << 30;

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
    File::open(path)?.take(most + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > most { Err(too_large()) } else { Ok(bytes) }
}

/// The text of a regular file that ought to be small.
///
/// # Errors
/// Those of [`read_regular`]; it is not UTF-8.
pub fn read_text(path: &Path) -> io::Result<String> {
    String::from_utf8(read_regular(path, SMALL)?)
        .map_err(|_| io::Error::new(io::ErrorKind::InvalidData, "it is not UTF-8"))
}

#[cfg(test)]
mod tests {
    use super::*;

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
}
