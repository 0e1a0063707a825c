//! The own operations on flex's tensors, without gradients.

use std::sync::Arc;

use burn::backend::Flex;
use burn::tensor::{DType, TensorData};
use burn_flex::FlexTensor;

use super::attention::Heads;
use super::{OwnOps, attention, cross_entropy, rms_norm, rows, swiglu};
use crate::ops::{Rope, SequenceLayout};

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
pub fn dims(x: &FlexTensor) -> (usize, usize) {
    let shape = x.layout().shape();
    (shape[0], shape[1])
}

/// Mean cross-entropy from the rows' losses, in nats.
pub fn mean(losses: &[f64]) -> FlexTensor {
    tensor(vec![(losses.iter().sum::<f64>() / losses.len() as f64) as f32], [1])
}

impl OwnOps for Flex {
    fn own_rms_norm(x_nd: FlexTensor, gamma_d: FlexTensor, epsilon: f32) -> FlexTensor {
        let (x, gamma) = (contiguous(x_nd), contiguous(gamma_d));
        let (n, d) = dims(&x);
        tensor(rms_norm::forward(elements(&x), elements(&gamma), epsilon).0, [n, d])
    }

    fn own_attention(
        qkv_n3d: FlexTensor,
        n_head: usize,
        layout: Arc<SequenceLayout>,
        rope: Arc<Rope>,
    ) -> FlexTensor {
        let qkv = contiguous(qkv_n3d);
        let (n, columns) = dims(&qkv);
        let heads = Heads { layout: &layout, rope: &rope, n_head };
        tensor(attention::forward(elements(&qkv), heads, false).0, [n, columns / 3])
    }

    fn own_swiglu(gate_up_n2f: FlexTensor) -> FlexTensor {
        let gate_up = contiguous(gate_up_n2f);
        let (n, columns) = dims(&gate_up);
        tensor(swiglu::forward(elements(&gate_up), columns / 2), [n, columns / 2])
    }

    fn own_cross_entropy(logits_nv: FlexTensor, targets: Arc<[u32]>) -> FlexTensor {
        let logits = contiguous(logits_nv);
        let normalisers = cross_entropy::log_normalisers(elements(&logits), dims(&logits).1);
        mean(&cross_entropy::losses(elements(&logits), &targets, &normalisers))
    }

    fn own_select_rows(x_md: FlexTensor, rows: Arc<[u32]>) -> FlexTensor {
        let x = contiguous(x_md);
        let d = dims(&x).1;
        tensor(rows::forward(elements(&x), &rows, d), [rows.len(), d])
    }
}
