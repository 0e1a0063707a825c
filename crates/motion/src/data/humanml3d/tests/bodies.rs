//! What is told of an opened data set whose files can be read and may be wrong.

use super::*;
use crate::data::DataFacts;
use crate::motion::Pose;
use crate::motion::fixtures::procedural;

#[test]
fn an_opened_set_of_joints_names_the_clip_that_lies_and_the_one_that_is_trained_on() {
    let data = DataSet::sound();
    fs::remove_dir_all(data.path().join("new_joint_vecs")).expect("it is there");
    fs::create_dir(data.path().join("new_joints")).expect("a writable folder");
    for seed in 0..5 {
        let poses = procedural(if seed == 4 { 0 } else { seed });
        let z_up = |[x, y, z]: [f32; 3]| if seed == 1 { [x, -z, y] } else { [x, y, z] };
        let poses: Vec<Pose> = poses.iter().take(81).map(|pose| pose.map(z_up)).collect();
        let values = poses.as_flattened().as_flattened();
        let name = format!("new_joints/00000{seed}.npy");
        data.write(&name, npy_bytes(&[poses.len(), 22, 3], values));
    }
    let set = open(&data, &options(false, BrokenFiles::Refuse));
    let [lies, leak] = set.remarks() else { panic!("{:?}", set.remarks()) };
    assert!(lies.starts_with("000001: the body lies "), "{lies}");
    assert!(leak.starts_with("000000 (train) and 000004 (test): motion that is trained"), "{leak}");
    assert_eq!(DataFacts::of(&set).warnings, set.remarks());
}
