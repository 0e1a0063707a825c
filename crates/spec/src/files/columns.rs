//! Columns of numbers in a safetensors file: a small one is read, a large one mapped, so that many processes share it.

use std::collections::HashMap;
use std::fs::{self, File};
use std::io::{self, Write};
use std::marker::PhantomData;
use std::ops::{Deref, Range};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use bytemuck::Pod;
use memmap2::Mmap;
use safetensors::tensor::{Dtype, Metadata, SafeTensors, TensorInfo, TensorView, serialize};

use super::atomic::write_whole;
use super::{FileError, read_regular};

/// A number that a column can hold.
pub trait Number: Pod {
    const DTYPE: Dtype;
}

impl Number for u32 {
    const DTYPE: Dtype = Dtype::U32;
}

impl Number for u64 {
    const DTYPE: Dtype = Dtype::U64;
}

impl Number for f32 {
    const DTYPE: Dtype = Dtype::F32;
}

/// A column to be written.
pub struct NewColumn<'a> {
    name: String,
    dtype: Dtype,
    len: usize,
    bytes: &'a [u8],
}

impl<'a> NewColumn<'a> {
    /// A column of these values.
    pub fn new<T: Number>(name: impl Into<String>, values: &'a [T]) -> Self {
        let bytes = bytemuck::cast_slice(values);
        Self { name: name.into(), dtype: T::DTYPE, len: values.len(), bytes }
    }
}

/// The column that holds the digest of all others.
const DIGEST: &str = "digest";

/// The digest of the names and bytes of columns, in the order of names.
fn digest<'a>(columns: impl Iterator<Item = (&'a str, &'a [u8])>) -> [u8; 32] {
    let mut columns: Vec<(&str, &[u8])> = columns.filter(|(name, _)| *name != DIGEST).collect();
    columns.sort_unstable_by_key(|(name, _)| *name);
    let mut hasher = blake3::Hasher::new();
    for (name, bytes) in columns {
        hasher.update(name.as_bytes()).update(&(bytes.len() as u64).to_le_bytes()).update(bytes);
    }
    hasher.finalize().into()
}

/// Writes columns, their digest and a text entry as one file, whole, by rename. Several entries would lie in the file in a
/// random order, so that equal content would not be equal bytes.
pub fn write(
    path: &Path,
    columns: &[NewColumn],
    note: Option<(&str, String)>,
) -> Result<(), FileError> {
    let digest = digest(columns.iter().map(|column| (column.name.as_str(), column.bytes)));
    let digest = NewColumn { name: DIGEST.into(), dtype: Dtype::U32, len: 8, bytes: &digest };
    let views = columns.iter().chain([&digest]).map(|column| {
        let view = TensorView::new(column.dtype, vec![column.len], column.bytes);
        (column.name.clone(), view.expect("shape and length agree"))
    });
    let note = note.map(|(name, text)| HashMap::from([(name.to_string(), text)]));
    let bytes =
        serialize(views, note).map_err(|error| FileError::write(path)(io::Error::other(error)))?;
    write_whole(path, |file| file.write_all(&bytes))
}

/// Bytes of a file that is read, at most: few beside those of any process, which shares none of them. What happens
/// to the file later changes no number of it.
const READ: u64 = 4 << 20;

/// The bytes of a file.
#[derive(Debug)]
pub enum Bytes {
    Read(Vec<u8>),
    /// With the file, which tells how long it still is.
    Mapped(Mmap, File),
}

impl Deref for Bytes {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        match self {
            Self::Read(bytes) => bytes,
            Self::Mapped(map, _) => map,
        }
    }
}

/// A file of columns.
#[derive(Debug)]
pub struct ColumnFile {
    path: PathBuf,
    bytes: Arc<Bytes>,
    metadata: Metadata,
    /// The offset of the columns' bytes.
    start: usize,
}

impl ColumnFile {
    /// Reads or maps a file.
    ///
    /// # Errors
    /// [`FileError::Read`] and [`FileError::Damaged`].
    pub fn open(path: &Path) -> Result<Self, FileError> {
        let length = fs::metadata(path).map_err(FileError::read(path))?.len();
        if length > READ { Self::map(path) } else { Self::of(path, Bytes::Read(Self::read(path)?)) }
    }

    fn read(path: &Path) -> Result<Vec<u8>, FileError> {
        read_regular(path, READ).map_err(FileError::read(path))
    }

    /// Maps a file, whatever its size.
    fn map(path: &Path) -> Result<Self, FileError> {
        let file = File::open(path).map_err(FileError::read(path))?;
        // SAFETY: isoflop puts files of columns in place by rename and never writes them again. Where another
        // program does, `unchanged` finds the change before a number of it counts, and a read beyond a new end
        // ends the process, which `machine::tell_of_cut_files` tells of.
        let map = unsafe { Mmap::map(&file) }.map_err(FileError::read(path))?;
        Self::of(path, Bytes::Mapped(map, file))
    }

    fn of(path: &Path, bytes: Bytes) -> Result<Self, FileError> {
        let (header, metadata) =
            SafeTensors::read_metadata(&bytes).map_err(|error| FileError::damaged(path, error))?;
        let start = size_of::<u64>() + header;
        Ok(Self { path: path.to_path_buf(), bytes: Arc::new(bytes), metadata, start })
    }

    /// Checks that the columns match the digest; a file without a digest is not ours.
    ///
    /// # Errors
    /// [`FileError::Damaged`].
    pub fn verified(self) -> Result<Self, FileError> {
        match self.is_as_written() {
            true => Ok(self),
            false => Err(self.damaged("its bytes are not those that were written")),
        }
    }

    /// Whether nobody has changed the file since it was [verified](Self::verified), as far as that matters here.
    ///
    /// # Errors
    /// [`FileError::Changed`].
    pub fn unchanged(&self) -> Result<(), FileError> {
        let Bytes::Mapped(map, file) = &*self.bytes else { return Ok(()) };
        let length = file.metadata().map_err(FileError::read(&self.path))?.len();
        if length == map.len() as u64 && self.is_as_written() {
            return Ok(());
        }
        Err(FileError::Changed { path: self.path.clone() })
    }

    fn is_as_written(&self) -> bool {
        let tensors = self.metadata.tensors();
        let bytes = |info: &TensorInfo| {
            let (from, to) = info.data_offsets;
            &self.bytes[self.start + from..self.start + to]
        };
        let found = || digest(tensors.iter().map(|(name, info)| (name.as_str(), bytes(info))));
        tensors.get(DIGEST).is_none_or(|told| bytes(told) == found())
    }

    /// All bytes of the file.
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// A text entry.
    pub fn note(&self, name: &str) -> Option<&str> {
        self.metadata.metadata().as_ref()?.get(name).map(String::as_str)
    }

    /// A text entry as a number.
    ///
    /// # Errors
    /// [`FileError::Damaged`] if it is missing or no number.
    pub fn number(&self, name: &str) -> Result<usize, FileError> {
        let number = self.note(name).and_then(|text| text.parse().ok());
        number.ok_or_else(|| self.damaged(format!("its note `{name}` is missing")))
    }

    /// Whether the file has a column of this name.
    pub fn has(&self, name: &str) -> bool {
        self.metadata.info(name).is_some()
    }

    /// A column of the file.
    ///
    /// # Errors
    /// [`FileError::Damaged`] if it is missing or of another type.
    pub fn column<T: Number>(&self, name: &str) -> Result<Column<T>, FileError> {
        let info = self.metadata.info(name).filter(|info| info.dtype == T::DTYPE);
        let info = info.ok_or_else(|| self.lacks(name))?;
        let (from, to) = info.data_offsets;
        Ok(Column::new(&self.bytes, self.start + from..self.start + to))
    }

    /// The shape of a column: one number for a list, two for a matrix.
    ///
    /// # Errors
    /// [`FileError::Damaged`] if it is missing.
    pub fn shape(&self, name: &str) -> Result<&[usize], FileError> {
        self.metadata.info(name).map(|info| &info.shape[..]).ok_or_else(|| self.lacks(name))
    }

    fn lacks(&self, name: &str) -> FileError {
        self.damaged(format!("its column `{name}` is missing"))
    }

    /// The error of a damaged file.
    pub fn damaged(&self, reason: impl ToString) -> FileError {
        FileError::damaged(&self.path, reason)
    }
}

/// Numbers in a file, or a copy of them where the file does not align them.
#[derive(Debug)]
pub enum Column<T> {
    Shared { file: Arc<Bytes>, place: Range<usize>, numbers: PhantomData<T> },
    Copied(Vec<T>),
}

impl<T: Pod> Column<T> {
    fn new(file: &Arc<Bytes>, place: Range<usize>) -> Self {
        match bytemuck::try_cast_slice::<u8, T>(&file[place.clone()]) {
            Ok(_) => Column::Shared { file: file.clone(), place, numbers: PhantomData },
            Err(_) => Column::Copied(bytemuck::pod_collect_to_vec(&file[place])),
        }
    }

    /// The numbers.
    pub fn values(&self) -> &[T] {
        match self {
            Column::Shared { file, place, .. } => bytemuck::cast_slice(&file[place.clone()]),
            Column::Copied(values) => values,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bit_that_turned_over_is_found() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("codes.safetensors");
        let columns = [NewColumn::new("b", &[1u32, 2, 3]), NewColumn::new("a", &[0.5f32])];
        write(&path, &columns, None).unwrap();
        let file = ColumnFile::open(&path).unwrap().verified().unwrap();
        assert_eq!(file.column::<u32>("b").unwrap().values(), [1, 2, 3]);
        let mut bytes = fs::read(&path).unwrap();
        let last = bytes.len() - 1;
        bytes[last] ^= 4;
        fs::remove_file(&path).unwrap();
        fs::write(&path, bytes).unwrap();
        let error = ColumnFile::open(&path).unwrap().verified().unwrap_err().to_string();
        assert!(error.contains("not those that were written"), "{error}");
    }

    /// A file of one column of 4096 ones.
    fn ones(folder: &tempfile::TempDir) -> PathBuf {
        let path = folder.path().join("codes.safetensors");
        write(&path, &[NewColumn::new("a", &[1u32; 4096])], None).unwrap();
        path
    }

    #[test]
    fn a_file_that_was_read_keeps_its_numbers_whatever_becomes_of_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = ones(&folder);
        let file = ColumnFile::open(&path).unwrap().verified().unwrap();
        File::options().write(true).open(&path).unwrap().set_len(9).unwrap();
        assert_eq!(file.column::<u32>("a").unwrap().values(), [1; 4096]);
        file.unchanged().unwrap();
        assert!(ColumnFile::open(&path).unwrap_err().is_damage());
    }

    #[test]
    fn a_change_of_a_mapped_file_is_found() {
        use std::os::unix::fs::FileExt;
        for cut in [false, true] {
            let folder = tempfile::tempdir().unwrap();
            let path = ones(&folder);
            let file = ColumnFile::map(&path).unwrap().verified().unwrap();
            file.unchanged().unwrap();
            let other = File::options().write(true).open(&path).unwrap();
            let changed = if cut { other.set_len(9) } else { other.write_all_at(&[2], 5000) };
            changed.unwrap();
            let error = file.unchanged().unwrap_err();
            assert!(error.to_string().contains("changed while it was used"), "{error}");
            assert_eq!(error.failure_kind(), crate::failure::FailureKind::FilesChanged);
        }
    }

    /// The child of this test cuts a file that it has mapped, and reads on.
    #[test]
    fn a_process_whose_mapped_file_is_cut_says_so_and_ends() {
        use std::os::unix::process::ExitStatusExt;
        const CUT: &str = "ISOFLOP_TEST_CUT";
        if let Some(path) = std::env::var_os(CUT) {
            crate::machine::tell_of_cut_files();
            let column = ColumnFile::map(path.as_ref()).unwrap().column::<u32>("a").unwrap();
            File::options().write(true).open(&path).unwrap().set_len(9).unwrap();
            panic!("{} was read", column.values().iter().sum::<u32>());
        }
        let folder = tempfile::tempdir().unwrap();
        let name = "files::columns::tests::a_process_whose_mapped_file_is_cut_says_so_and_ends";
        let mut child = std::process::Command::new(std::env::current_exe().unwrap());
        let child = child.args(["--exact", name, "--nocapture"]).env(CUT, ones(&folder));
        let output = child.output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(said.contains("was cut short while it was read"), "{said}");
        assert_eq!(output.status.signal(), Some(nix::sys::signal::Signal::SIGBUS as i32), "{said}");
    }

    #[test]
    fn numbers_out_of_line_are_copied() {
        let bytes = Arc::new(Bytes::Read(vec![9, 1, 0, 0, 0, 2, 0, 0, 0]));
        let column = Column::<u32>::new(&bytes, 1..9);
        assert!(matches!(column, Column::Copied(_)));
        assert_eq!(column.values(), [1, 2]);
    }
}
