//! A bound for the log of a job whose program may say whatever it likes.

use std::fs::{self, OpenOptions};
use std::io::{self, Seek, SeekFrom, Write};
use std::path::Path;

/// Bytes of a log at most; then its middle is cut out.
const MOST: usize = 16 << 20;
/// Bytes that a cut leaves of its beginning, and of its end.
const KEPT: usize = 4 << 20;
/// What stands in the place of the middle, before the number of bytes.
const LEFT_OUT: &[u8] = b"\n[isoflop left out ";
const BYTES: &str = " bytes here]\n";

/// Cuts the middle out of the log of a job's folder, if it is too long. The program appends to it by itself, so that
/// what it says survives its worker.
pub fn bound(place: &Path) {
    let path = place.join("log.txt");
    if fs::metadata(&path).is_ok_and(|file| file.len() as usize > MOST) {
        // Looked at again soon: a log that cannot be cut stops no work.
        let _ = cut(&path, KEPT);
    }
}

/// Cuts the middle out of a file that is appended to; its new length.
fn cut(path: &Path, kept: usize) -> io::Result<usize> {
    let bytes = fs::read(path)?;
    if bytes.len() <= 3 * kept {
        return Ok(bytes.len());
    }
    let (head, left_out, tail) = parts(&bytes, kept);
    let mut file = OpenOptions::new().read(true).append(true).open(path)?;
    let mark = format!("{}{left_out}{BYTES}", String::from_utf8_lossy(LEFT_OUT));
    // What was said since it was read; what is said between here and the cut goes with the middle.
    let mut since = Vec::new();
    file.seek(SeekFrom::Start(bytes.len() as u64))?;
    io::copy(&mut file, &mut since)?;
    file.set_len(head.len() as u64)?;
    let rest = [mark.as_bytes(), tail, &since].concat();
    (&file).write_all(&rest)?;
    Ok(head.len() + rest.len())
}

/// The head and the tail that a cut leaves, and between them the number of bytes left out, those of earlier cuts
/// included.
fn parts(bytes: &[u8], kept: usize) -> (&[u8], usize, &[u8]) {
    let (_, tail) = bytes.split_at(bytes.len() - kept);
    let end_of_line = |bytes: &[u8]| bytes.iter().position(|byte| *byte == b'\n');
    let tail = &tail[end_of_line(tail).map_or(0, |end| end + 1)..];
    let (head, said, before) = earlier(&bytes[..bytes.len() - kept]).unwrap_or((kept, 0, 0));
    (&bytes[..head], before + bytes.len() - tail.len() - head - said, tail)
}

/// Where an earlier cut stands, the length of its sentence, and the bytes that it left out.
fn earlier(bytes: &[u8]) -> Option<(usize, usize, usize)> {
    let at = bytes.windows(LEFT_OUT.len()).position(|window| window == LEFT_OUT)?;
    let rest = &bytes[at + LEFT_OUT.len()..];
    let digits = rest.iter().take_while(|byte| byte.is_ascii_digit()).count();
    let n = std::str::from_utf8(&rest[..digits]).ok()?.parse().ok()?;
    Some((at, LEFT_OUT.len() + digits + BYTES.len(), n))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cut_keeps_the_head_and_the_tail_and_counts_what_all_cuts_left_out() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("log.txt");
        let line = |i: usize| format!("line {i:05}\n");
        let mut said = 0;
        let mut say = |lines: usize| {
            let more: String = (said..said + lines).map(line).collect();
            said += lines;
            let mut file = OpenOptions::new().create(true).append(true).open(&path).unwrap();
            file.write_all(more.as_bytes()).unwrap();
        };
        for (lines, left_out) in [(100, 0), (400, 5500 - 770 - 770), (200, 7700 - 770 - 770)] {
            say(lines);
            let length = cut(&path, if lines == 100 { 1100 } else { 775 }).unwrap();
            let text = fs::read_to_string(&path).unwrap();
            assert_eq!(length, text.len());
            assert!(text.starts_with(&line(0)), "{text}");
            assert_eq!(text.contains("left out"), left_out > 0);
            assert_eq!(text.matches("left out").count(), usize::from(left_out > 0));
            if let Some(n) = earlier(text.as_bytes()).map(|(.., n)| n) {
                assert!(n.abs_diff(left_out) <= 11, "{n} and not {left_out}");
            }
        }
        let text = fs::read_to_string(&path).unwrap();
        assert!(text.ends_with(&line(699)) && text.len() < 1700, "{text}");
    }
}
