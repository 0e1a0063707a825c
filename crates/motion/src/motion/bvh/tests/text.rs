//! Text into hierarchies and back.

use super::*;

const SAMPLE: &str = "HIERARCHY
ROOT Hips {
  OFFSET 1 2 3
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT Left Leg
  {
    CHANNELS 1 xrotation
    OFFSET 0 -10 0
    End Site
    {
      OFFSET 0 -5 0
    }
  }
  JOINT tail
  {
    OFFSET 0 0 -4
    CHANNELS 2 Yposition Xrotation
  }
}
MOTION
Frames:\t2
Frame Time: .05
0 0 0  0 0 0  0  0 0
1 20 3  0 0 90  90  7 0
";

fn error(text: &str) -> String {
    Bvh::parse(text).expect_err("a broken file").to_string()
}

fn assert_close(a: [f64; 3], b: [f64; 3]) {
    assert!((0..3).all(|c| (a[c] - b[c]).abs() < 1e-9), "{a:?} is not {b:?}");
}

#[test]
fn channels_of_any_kind_place_the_joints() {
    let bvh = Bvh::parse(SAMPLE).unwrap();
    assert_eq!((bvh.n_channels(), bvh.frame_time_s), (9, 0.05));
    assert_eq!(bvh.joints[1].name, "Left Leg");
    assert_eq!(bvh.joints[1].end_sites, [[0.0, -5.0, 0.0]]);
    let [first, second] = &bvh.positions()[..] else { panic!("two frames") };
    // Position channels replace OFFSET, each its own number.
    assert_eq!(first[..], [[0.0; 3], [0.0, -10.0, 0.0], [0.0, 0.0, -4.0]]);
    assert_close(second[0], [1.0, 20.0, 3.0]);
    assert_close(second[1], [1.0, 10.0, 3.0]);
    // A quarter turn about y takes -z to -x.
    assert_close(second[2], [-3.0, 27.0, 3.0]);
}

#[test]
fn rotations_apply_from_right_to_left() {
    let turned = |order: &str| {
        let text = format!(
            "HIERARCHY\nROOT a\n{{\nCHANNELS 3 {order}\nJOINT b\n{{\nOFFSET 1 0 0\n}}\n}}\n\
             MOTION\nFrames: 1\nFrame Time: 1\n90 90 0\n"
        );
        Bvh::parse(&text).unwrap().positions()[0][1]
    };
    // Y takes x to -z, and Z leaves that; Z takes x to y, and Y leaves that.
    assert_close(turned("Zrotation Yrotation Xrotation"), [0.0, 0.0, -1.0]);
    assert_close(turned("Yrotation Zrotation Xrotation"), [0.0, 1.0, 0.0]);
}

#[test]
fn what_is_written_reads_as_the_same() {
    let sample = Bvh::parse(SAMPLE).unwrap();
    assert_eq!(Bvh::parse(&sample.to_string()).unwrap(), sample);
    let own = fit_bvh(&procedural(5), 20.0).unwrap().bvh;
    assert_eq!(Bvh::parse(&own.to_string()).unwrap(), own);
    let windows = own.to_string().replace('\n', "\r\n");
    assert_eq!(Bvh::parse(&format!("\u{feff}{windows}\r\n")).unwrap(), own);
}

#[test]
fn several_roots_are_read_and_written() {
    let text = "HIERARCHY\nROOT a\n{\nOFFSET 0 0 0\nCHANNELS 0\n}\nROOT b\n{\nOFFSET 1 0 0\n\
                CHANNELS 1 Yposition\n}\nMOTION\nFrames: 1\nFrame Time: 1\n4\n";
    let bvh = Bvh::parse(text).unwrap();
    assert_eq!(bvh.positions()[0], [[0.0; 3], [1.0, 4.0, 0.0]]);
    assert_eq!(Bvh::parse(&bvh.to_string()).unwrap(), bvh);
}

#[test]
fn every_fault_names_its_line_and_what_is_expected() {
    let broken = |from: &str, to: &str| error(&SAMPLE.replacen(from, to, 1));
    assert_eq!(
        error(""),
        "the file ends at line 0, where the line MOTION is expected: it is cut short"
    );
    assert_eq!(
        error("clip,frames\nMOTION\n"),
        "line 1: HIERARCHY is expected, here is \"clip,frames\""
    );
    assert_eq!(
        error("HIERARCHY\nMOTION\n"),
        "the file ends at line 1, where ROOT is expected: it is cut short"
    );
    assert_eq!(
        broken("xrotation", "rotX"),
        "line 7: a channel such as Xrotation or Yposition is expected, here is \"rotX\""
    );
    assert_eq!(
        broken("OFFSET 0 -10 0", "OFFSET 0 -10"),
        "line 9: a number of the OFFSET is expected, here is \"End\""
    );
    assert_eq!(
        broken("0 0 -4", "0 nan -4"),
        "line 16: a number of the OFFSET is expected, here is \"nan\""
    );
    assert_eq!(
        broken("  }\n}\n", "  }\n"),
        "the file ends at line 18, where } is expected: it is cut short"
    );
    assert_eq!(
        broken("ROOT Hips {", "JOINT Hips {"),
        "line 2: ROOT or MOTION is expected, here is \"JOINT\""
    );
    assert_eq!(
        broken("Frames:\t2", "Frames: two"),
        "line 21: \"Frames:\" and a count is expected, here is \"Frames: two\""
    );
    assert_eq!(
        broken(".05", "0"),
        "line 22: \"Frame Time:\" and seconds above zero is expected, here is \"Frame Time: 0\""
    );
    assert_eq!(
        broken("  7 0\n", "  7\n"),
        "line 24: a frame of this hierarchy has 9 numbers, here are 8"
    );
    assert_eq!(broken("90  7", "9o  7"), "line 24: a number is expected, here is \"9o\"");
    assert_eq!(
        broken("Frames:\t2", "Frames: 3"),
        "line 21 announces 3 frames, 2 follow; correct the number or the frames"
    );
}
