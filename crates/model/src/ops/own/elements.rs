//! The elements of flex's tensors.

use burn::tensor::{DType, TensorData};
use burn_flex::FlexTensor;

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
