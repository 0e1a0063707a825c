use std::collections::HashMap;

use burn::nn::LinearConfig;
use burn::tensor::Device;
use safetensors::tensor::{Dtype, TensorView, serialize};

use super::*;

#[test]
fn weights_survive_a_file_and_fit_only_their_shape() {
    let device = Device::flex();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("w.safetensors");
    let module = LinearConfig::new(3, 5).init(&device);
    let weights = on_host(&of_module(&module));
    assert_eq!(weights["weight"].shape, [3, 5]);
    save(&path, &of_module(&module), HashMap::from([("step".into(), "12".into())])).unwrap();
    let (read, notes) = load(&path).unwrap();
    assert_eq!((read.clone(), notes["step"].as_str()), (weights.clone(), "12"));
    let other = into_module(LinearConfig::new(3, 5).init(&device), read.clone()).unwrap();
    assert_eq!(on_host(&of_module(&other)), weights);
    let error = into_module(LinearConfig::new(3, 4).init(&device), read).unwrap_err();
    assert!(error.to_string().contains("weight"), "{error}");
}

#[test]
fn a_flipped_bit_is_found() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("w.safetensors");
    let tensor = HostTensor { shape: vec![2], values: vec![1.0, 2.0] };
    save(&path, &Sources::from([("gain".into(), Source::Host(tensor))]), HashMap::new()).unwrap();
    let mut bytes = std::fs::read(&path).unwrap();
    *bytes.last_mut().unwrap() ^= 1;
    std::fs::write(&path, bytes).unwrap();
    let error = load(&path).unwrap_err().to_string();
    assert!(error.contains("(its numbers are not"), "{error}");
}

#[test]
fn numbers_of_another_type_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("w.safetensors");
    let view = TensorView::new(Dtype::F64, vec![2], &[0; 16]).unwrap();
    std::fs::write(&path, serialize([("gain", view)], None).unwrap()).unwrap();
    let error = load(&path).unwrap_err().to_string();
    assert!(error.contains("(gain is F64"), "{error}");
}

#[test]
fn an_empty_file_is_damaged_and_not_just_out_of_reach() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("w.safetensors");
    std::fs::write(&path, []).unwrap();
    let error = load(&path).unwrap_err();
    assert!(error.is_damage(), "{error}");
}
