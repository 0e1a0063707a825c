//! [`Buffer`]: memory reused from step to step; flex's tensors and their elements.
//!
//! Fresh memory costs a page fault and the clearing of a page for every four kilobytes, which in a training step takes as
//! long as many of its kernels. So memory freed by a step is kept here, by thread and size, for the next one.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::mem::MaybeUninit;
use std::ops::{Deref, DerefMut, Range};

use burn::tensor::{DType, TensorData};
use burn_flex::FlexTensor;
use burn_std::{AccessError, AccessPolicy, AllocationController, AllocationProperty, Bytes};

/// Vectors of one length.
#[derive(Default)]
struct Shelf {
    free: Vec<Vec<f32>>,
    /// Vectors that were taken from here or made, and have not come back: as many may come, since those that
    /// another thread has made would pile up.
    lent: usize,
}

/// Shelves by their length.
type Shelves = BTreeMap<usize, Shelf>;

thread_local! {
    static SHELVES: RefCell<Shelves> = const { RefCell::new(Shelves::new()) };
}

/// Lengths are rounded up to one of so many steps between powers of two, so that batches of
/// nearly one size share their memory.
const STEPS: usize = 8;

/// Below this length the allocator is as good.
const LEAST: usize = 1024;

/// The first `len` elements of a vector that goes back when it is dropped.
#[derive(Debug, Default)]
pub struct Buffer {
    values: Vec<f32>,
    len: usize,
}

impl Buffer {
    /// `len` elements, of any values.
    pub fn new(len: usize) -> Self {
        let whole = rounded(len);
        Self { values: SHELVES.with_borrow_mut(|shelves| take(shelves, whole)), len }
    }

    /// `len` zeros.
    pub fn zeros(len: usize) -> Self {
        let mut buffer = Self::new(len);
        buffer.fill(0.0);
        buffer
    }

    /// A copy.
    pub fn from_slice(values: &[f32]) -> Self {
        let mut buffer = Self::new(values.len());
        buffer.copy_from_slice(values);
        buffer
    }

    /// A tensor of these elements, whose memory goes back when its last user drops it.
    pub fn into_tensor<const D: usize>(self, shape: [usize; D]) -> FlexTensor {
        let len = self.len * size_of::<f32>();
        // SAFETY: so many bytes are initialized.
        let bytes = unsafe { Bytes::from_controller(Box::new(self), len) };
        FlexTensor::from_data(TensorData::from_bytes(bytes, shape, DType::F32))
    }
}

/// The memory of a tensor.
impl AllocationController for Buffer {
    fn alloc_align(&self) -> usize {
        align_of::<f32>()
    }

    fn property(&self) -> AllocationProperty {
        AllocationProperty::Other
    }

    unsafe fn memory_mut(
        &mut self,
        _: AccessPolicy,
    ) -> Result<&mut [MaybeUninit<u8>], AccessError> {
        let bytes: &mut [u8] = bytemuck::cast_slice_mut(self);
        // SAFETY: the caller writes only initialized bytes.
        Ok(unsafe { &mut *(std::ptr::from_mut(bytes) as *mut [MaybeUninit<u8>]) })
    }

    fn memory(&self, _: AccessPolicy) -> Result<&[MaybeUninit<u8>], AccessError> {
        let bytes: &[u8] = bytemuck::cast_slice(self);
        // SAFETY: initialized bytes are bytes that may be.
        Ok(unsafe { &*(std::ptr::from_ref(bytes) as *const [MaybeUninit<u8>]) })
    }
}

/// A vector of `whole` to twice as many elements. Where there is none, a smaller one goes for good:
/// it will not do for the next batch like this one either, and so the vectors grow and not their
/// number.
fn take(shelves: &mut Shelves, whole: usize) -> Vec<f32> {
    let found = shelves.range_mut(whole..=2 * whole).find_map(|(_, shelf)| {
        let values = shelf.free.pop()?;
        shelf.lent += 1;
        Some(values)
    });
    found.unwrap_or_else(|| {
        shelves.range_mut(whole / 2..whole).rev().find_map(|(_, shelf)| shelf.free.pop());
        shelves.entry(whole).or_default().lent += 1;
        vec![0.0; whole]
    })
}

/// The length that memory for `len` elements has.
fn rounded(len: usize) -> usize {
    if len < LEAST {
        return len;
    }
    len.next_multiple_of((len.next_power_of_two() / 2 / STEPS).max(1))
}

impl Drop for Buffer {
    fn drop(&mut self) {
        let values = std::mem::take(&mut self.values);
        let whole = values.len();
        if whole < LEAST {
            return;
        }
        // At the end of a thread there is nowhere to put it.
        let _ = SHELVES.try_with(|shelves| {
            let mut shelves = shelves.borrow_mut();
            if let Some(shelf) = shelves.get_mut(&whole).filter(|shelf| shelf.lent > 0) {
                shelf.lent -= 1;
                shelf.free.push(values);
            }
        });
    }
}

impl Clone for Buffer {
    fn clone(&self) -> Self {
        Self::from_slice(self)
    }
}

impl Deref for Buffer {
    type Target = [f32];

    fn deref(&self) -> &[f32] {
        &self.values[..self.len]
    }
}

impl DerefMut for Buffer {
    fn deref_mut(&mut self) -> &mut [f32] {
        &mut self.values[..self.len]
    }
}

/// Elements between what a pass over kept values reads and what it prefetches: they have left the cache.
pub const AHEAD: usize = 512;

/// Asks for the line of the cache that `place` lies in, if there is such a place.
#[inline(always)]
pub fn prefetch(place: *const f32) {
    #[cfg(target_arch = "x86_64")]
    // SAFETY: a hint, which reads nothing that the program sees, wherever it points.
    unsafe {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        _mm_prefetch::<_MM_HINT_T0>(place.cast());
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = place;
}

// The elements of flex's tensors.

/// A tensor with its elements in order from the start of its storage, without a copy if it is
/// one already.
pub fn contiguous(x: FlexTensor) -> FlexTensor {
    assert_eq!(x.dtype(), DType::F32, "the own operations compute in f32");
    let whole = x.bytes().len() == x.layout().num_elements() * size_of::<f32>();
    if whole && x.is_contiguous() && x.layout().start_offset() == 0 { x } else { x.to_contiguous() }
}

/// The elements of a contiguous tensor.
pub fn elements(x: &FlexTensor) -> &[f32] {
    x.as_slice().expect("contiguous() has put the elements in order")
}

/// The elements of a contiguous tensor for writing; copied first if another tensor shares them.
pub fn elements_mut(x: &mut FlexTensor) -> &mut [f32] {
    x.storage_mut()
}

/// A tensor of these elements.
pub fn tensor<const D: usize>(elements: Vec<f32>, shape: [usize; D]) -> FlexTensor {
    FlexTensor::from_data(TensorData::new(elements, shape))
}

/// Rows and columns.
pub fn dims(x: &FlexTensor) -> [usize; 2] {
    let shape = x.layout().shape();
    [shape[0], shape[1]]
}

// Rows of a matrix, a few at a time.

/// `0..n` in pieces of `size`.
pub fn chunks(n: usize, size: usize) -> impl Iterator<Item = Range<usize>> {
    (0..n).step_by(size).map(move |first| first..n.min(first + size))
}

/// Rows of a matrix of `columns` columns.
pub fn part<'a>(matrix: &'a [f32], rows: &Range<usize>, columns: usize) -> &'a [f32] {
    &matrix[rows.start * columns..rows.end * columns]
}

/// Rows of a matrix of `columns` columns, for writing.
pub fn part_mut<'a>(matrix: &'a mut [f32], rows: &Range<usize>, columns: usize) -> &'a mut [f32] {
    &mut matrix[rows.start * columns..rows.end * columns]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_comes_back_for_the_next_of_its_size() {
        let first = Buffer::new(5000);
        let place = first.as_ptr();
        drop(first.into_tensor([50, 100]));
        let second = Buffer::new(4990);
        assert_eq!((second.as_ptr(), second.len()), (place, 4990));
        assert_ne!(Buffer::zeros(5000).as_ptr(), place, "one at a time");
    }

    #[test]
    fn batches_of_all_sizes_share_the_memory_of_the_largest() {
        for i in 0..1000 {
            let n = 2000 + i * 7919 % 60_000;
            drop([Buffer::new(n), Buffer::new(n)]);
        }
        assert!(held() < 2 * 2 * 62_000 * 9 / 8, "{} elements lie idle", held());
    }

    /// Elements that nobody uses.
    fn held() -> usize {
        let of = |(length, shelf): (&usize, &Shelf)| length * shelf.free.len();
        SHELVES.with_borrow(|shelves| shelves.iter().map(of).sum())
    }

    #[test]
    fn memory_of_other_threads_does_not_pile_up() {
        drop(Buffer::new(4096));
        for _ in 0..100 {
            let made = std::thread::spawn(|| Buffer::new(4096).into_tensor([64, 64]));
            drop(made.join().expect("a buffer"));
        }
        assert_eq!(held(), 4096);
    }

    #[test]
    fn a_tensor_of_a_buffer_is_one_of_its_elements() {
        let mut buffer = Buffer::new(1500);
        buffer.iter_mut().zip(0..).for_each(|(x, i)| *x = i as f32);
        let first = buffer.into_tensor([3, 500]);
        let mut second = first.clone();
        elements_mut(&mut second)[7] = -1.0;
        assert_eq!((elements(&first)[7], elements(&second)[7]), (7.0, -1.0));
        assert_eq!((elements(&first).len(), elements(&second)[1499]), (1500, 1499.0));
        assert_eq!(second.into_data().try_into_vec::<f32>().expect("floats").len(), 1500);
    }

    #[test]
    fn lengths_are_rounded_by_an_eighth_at_most() {
        for len in (0..200_000).step_by(97) {
            let whole = rounded(len);
            assert!(whole >= len && whole * 8 <= len * 9 + 8, "{len}: {whole}");
            assert_eq!(rounded(whole), whole);
        }
    }
}
