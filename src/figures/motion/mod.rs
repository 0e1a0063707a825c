//! Writes motions as arrays, BVH, GLB, animated SVG, and a sheet of many.
//!
//! `features → joints (recovery) → BVH and GLB (own inverse kinematics), SVG (camera, ground, body)`.
//!
//! | layer | files |
//! | --- | --- |
//! | scene | `room` (camera and ground), `body` |
//! | pages | `animation` (SVG), `sheet` (PNG), `caption` |
//!
//! The same motion gives the same bytes. `docs/motion-files.md` describes the files.

mod animation;
mod marks;
mod room;
mod sheet;

use std::path::{Path, PathBuf};

use thiserror::Error;

pub use room::not_drawn;

use super::formats::DrawError;
use crate::data::write_npy;
use crate::files::{FileError, atomic};
use crate::motion::bvh::{Deviation, FitBvhError, fit_bvh};
use crate::motion::{N_FEATURES, N_JOINTS, Pose, recover_joints};

/// A motion as a model makes it.
#[derive(Clone, Copy, Debug)]
pub struct CaptionedMotion<'a> {
    /// Row-major `[T, 263]`, not normalised.
    pub features: &'a [f32],
    /// Frames per second.
    pub fps: f32,
    pub caption: &'a str,
}

/// The files of a motion.
#[derive(Clone, Debug, PartialEq)]
pub struct WrittenMotion {
    /// `[T, 22, 3]`, metres, y up.
    pub joints: PathBuf,
    /// `[T, 263]`, as given.
    pub features: PathBuf,
    pub bvh: PathBuf,
    pub glb: PathBuf,
    pub svg: PathBuf,
    /// Distance of the BVH's rigid body from the joints.
    pub deviation: Deviation,
}

/// Why a motion cannot be written.
#[derive(Debug, Error)]
pub enum MotionFileError {
    #[error(transparent)]
    File(#[from] FileError),
    #[error("{found} numbers are no rows of {N_FEATURES} features; give whole frames")]
    Features { found: usize },
    #[error("feature {column} of frame {frame} is not finite; the motion cannot be shown")]
    NotFinite { frame: usize, column: usize },
    #[error(transparent)]
    Motion(#[from] FitBvhError),
    #[error("a sheet without motions is empty; give at least one")]
    NoMotions,
    #[error("cannot draw {}: {error}", path.display())]
    Draw { path: PathBuf, error: DrawError },
}

/// Writes `<stem>.joints.npy`, `<stem>.features.npy`, `<stem>.bvh`, `<stem>.glb` and `<stem>.svg` into `folder`.
///
/// The folder is made if it is missing; each file is renamed into place. Nothing is written for a refused motion.
///
/// # Errors
/// [`MotionFileError`]: the features are no motion, or a file cannot be written.
pub fn write_motion(
    folder: &Path,
    stem: &str,
    motion: &CaptionedMotion,
) -> Result<WrittenMotion, MotionFileError> {
    let file = |ending: &str| folder.join(format!("{stem}.{ending}"));
    let endings = ["joints.npy", "features.npy", "bvh", "glb", "svg"];
    let [joints, features, bvh, glb, svg] = endings.map(file);
    let poses = motion.poses()?;
    let fitted = fit_bvh(&poses, motion.fps)?;
    let page = animation::svg(&poses, motion.fps, motion.caption);
    let n_frames = poses.len();
    write_npy(&joints, &[n_frames, N_JOINTS, 3], poses.as_flattened().as_flattened())?;
    write_npy(&features, &[n_frames, N_FEATURES], motion.features)?;
    atomic::write_bytes(&bvh, fitted.bvh.to_string().as_bytes())?;
    atomic::write_bytes(&glb, &fitted.bvh.to_glb())?;
    atomic::write_bytes(&svg, page.as_bytes())?;
    Ok(WrittenMotion { joints, features, bvh, glb, svg, deviation: fitted.deviation })
}

/// Writes a PNG with a row for each motion: its caption, and eight poses at equal intervals.
///
/// All bodies are seen by one camera and drawn to one scale, each with its root in the middle.
///
/// # Errors
/// [`MotionFileError`]: there is no motion, one is invalid, or the file cannot be written.
pub fn write_sheet<'a>(
    path: &Path,
    motions: &[CaptionedMotion<'a>],
) -> Result<(), MotionFileError> {
    if motions.is_empty() {
        return Err(MotionFileError::NoMotions);
    }
    let row = |motion: &CaptionedMotion<'a>| -> Result<sheet::Row<'a>, MotionFileError> {
        Ok(sheet::Row { poses: motion.poses()?, fps: motion.fps, caption: motion.caption })
    };
    let rows: Vec<sheet::Row> = motions.iter().map(row).collect::<Result<_, _>>()?;
    let failed = |error| MotionFileError::Draw { path: path.to_path_buf(), error };
    Ok(atomic::write_bytes(path, &sheet::png(&rows).map_err(failed)?)?)
}

impl CaptionedMotion<'_> {
    /// The joints, of features that can be shown.
    fn poses(&self) -> Result<Vec<Pose>, MotionFileError> {
        let found = self.features.len();
        if !found.is_multiple_of(N_FEATURES) {
            return Err(MotionFileError::Features { found });
        }
        if found == 0 {
            return Err(FitBvhError::NoFrames.into());
        }
        if !(self.fps.is_finite() && self.fps > 0.0) {
            return Err(FitBvhError::Fps { fps: self.fps }.into());
        }
        if let Some(at) = self.features.iter().position(|value| !value.is_finite()) {
            let (frame, column) = (at / N_FEATURES, at % N_FEATURES);
            return Err(MotionFileError::NotFinite { frame, column });
        }
        Ok(recover_joints(self.features))
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::SeedableRng;

    use super::*;
    use crate::data::parse_npy;
    use crate::motion::build_features;
    use crate::motion::bvh::Bvh;
    use crate::motion::synth::{FPS, Script};

    /// Features and caption of a procedural clip.
    fn clip(seed: u64) -> (Vec<f32>, String) {
        let script = Script::sample(&mut ChaCha8Rng::seed_from_u64(seed));
        (build_features(&script.poses()), script.captions().swap_remove(0))
    }

    fn motion<'a>((features, caption): &'a (Vec<f32>, String)) -> CaptionedMotion<'a> {
        CaptionedMotion { features, fps: FPS, caption }
    }

    #[test]
    fn every_file_of_a_motion_says_the_same() {
        let (folder, clip) = (tempfile::tempdir().unwrap(), clip(7));
        let written = write_motion(&folder.path().join("out"), "3", &motion(&clip)).unwrap();
        let n_frames = clip.0.len() / N_FEATURES;
        let joints = parse_npy(&fs::read(&written.joints).unwrap()).unwrap();
        let features = parse_npy(&fs::read(&written.features).unwrap()).unwrap();
        assert_eq!((joints.shape, features.shape), (vec![n_frames, 22, 3], vec![n_frames, 263]));
        assert_eq!(features.values, clip.0);
        let poses = recover_joints(&clip.0);
        assert_eq!(joints.values, poses.as_flattened().as_flattened());
        let bvh = Bvh::parse(&fs::read_to_string(&written.bvh).unwrap()).unwrap();
        assert_eq!((bvh.frames.len(), bvh.frame_time_s), (n_frames, 0.05));
        assert!(written.deviation.largest_mm < 1.0, "{:?}", written.deviation);
        let names = ["3.bvh", "3.features.npy", "3.glb", "3.joints.npy", "3.svg"];
        let mut found: Vec<_> = fs::read_dir(folder.path().join("out"))
            .unwrap()
            .map(|e| e.unwrap().file_name())
            .collect();
        found.sort();
        assert_eq!(found, names);
    }

    #[test]
    fn the_longest_clip_is_a_modest_svg_without_scripts_and_always_the_same() {
        let (features, _) = clip(7);
        let row = &features[..N_FEATURES];
        let (long, caption) = (row.repeat(196), "a <b> & c ".repeat(30));
        let draw = || animation::svg(&recover_joints(&long), 20.0, &caption);
        let svg = draw();
        assert!(svg.len() < 300_000, "{} bytes", svg.len());
        assert_eq!(svg, draw());
        assert!(!svg.contains("<script") && !svg.contains("<b>"));
        assert!(svg.contains("<title>a &lt;b&gt; &amp; c a"));
        // Five limbs, a nose, two coordinates of head and shadow each, and the bar.
        assert_eq!(svg.matches("<animate ").count(), 11);
        // The motion and the pause: 195 and 10 steps of a twentieth of a second.
        assert_eq!(svg.matches("dur=\"10.250s\"").count(), 11);
    }

    /// The numbers of the first value of each animated line lie on the page.
    #[test]
    fn the_whole_motion_stays_on_the_page() {
        for seed in 0..20 {
            let (features, caption) = clip(seed);
            let svg = animation::svg(&recover_joints(&features), 20.0, &caption);
            let (_, view_box) = svg.split_once("viewBox=\"0 0 ").unwrap();
            let size: Vec<f64> =
                view_box.split('"').next().unwrap().split(' ').map(number).collect();
            for line in svg.split("<animate attributeName=\"points\"").skip(1) {
                let values = line.split("values=\"").nth(1).unwrap().split('"').next().unwrap();
                for point in values.split([' ', ';']) {
                    let (x, y) = point.split_once(',').unwrap();
                    assert!((0.0..=size[0]).contains(&number(x)), "{x} in clip {seed}");
                    assert!((0.0..=size[1]).contains(&number(y)), "{y} in clip {seed}");
                }
            }
        }
    }

    fn number(text: &str) -> f64 {
        text.parse().unwrap()
    }

    #[test]
    fn a_motion_that_leaves_the_room_is_told_in_place_of_its_picture() {
        let (folder, mut far) = (tempfile::tempdir().unwrap(), clip(3));
        // The speed of the root.
        far.0[5 * N_FEATURES + 1] = 1e30;
        let written = write_motion(folder.path(), "0", &motion(&far)).unwrap();
        let svg = fs::read_to_string(written.svg).unwrap();
        assert!(svg.contains(" m off the origin") && !svg.contains("<animate"), "{svg}");
        assert!(svg.len() < 4000, "{} bytes", svg.len());
        let sheet = |name: &str, clips: &[&(Vec<f32>, String)]| {
            let motions: Vec<CaptionedMotion> = clips.iter().map(|clip| motion(clip)).collect();
            write_sheet(&folder.path().join(name), &motions).unwrap();
            image::open(folder.path().join(name)).unwrap().to_rgb8()
        };
        let (near, both) = (sheet("near.png", &[&clip(4)]), sheet("both.png", &[&clip(4), &far]));
        let rows = near.rows().zip(both.rows());
        assert!(rows.into_iter().all(|(a, b)| a.eq(b)), "the near one looks as it does alone");
        assert!(sheet("far.png", &[&far]).height() < near.height());
        assert_eq!(
            not_drawn(&[[[f32::NAN; 3]; N_JOINTS]]).unwrap(),
            "in frame 0 a joint is at no finite place"
        );
        assert_eq!(not_drawn(&recover_joints(&clip(4).0)), None);
    }

    #[test]
    fn a_sheet_has_a_row_a_motion() {
        let folder = tempfile::tempdir().unwrap();
        let clips = [clip(1), clip(2), clip(3)];
        let size = |n: usize| {
            let path = folder.path().join("sheet.png");
            let motions: Vec<CaptionedMotion> = clips[..n].iter().map(motion).collect();
            write_sheet(&path, &motions).unwrap();
            let bytes = fs::read(path).unwrap();
            // Width and height follow the signature and the name of the first chunk.
            let at = |i: usize| u32::from_be_bytes(bytes[i..i + 4].try_into().unwrap());
            (at(16), at(20))
        };
        let (one, three) = (size(1), size(3));
        assert_eq!(one.0, three.0);
        assert!(three.1 > 2 * one.1, "{one:?} {three:?}");
    }

    #[test]
    fn what_is_no_motion_is_refused_before_anything_is_written() {
        let (folder, sound) = (tempfile::tempdir().unwrap(), clip(4));
        let with = |features: &[f32], fps: f32| {
            let motion = CaptionedMotion { features, fps, caption: "" };
            let error = write_motion(&folder.path().join("out"), "0", &motion).unwrap_err();
            let sheet = write_sheet(&folder.path().join("out/sheet.png"), &[motion]).unwrap_err();
            assert_eq!(error.to_string(), sheet.to_string());
            error
        };
        let mut broken = sound.0.clone();
        broken[2 * N_FEATURES + 100] = f32::INFINITY;
        let error = with(&broken, 20.0);
        assert!(matches!(error, MotionFileError::NotFinite { frame: 2, column: 100 }));
        assert!(matches!(with(&sound.0[1..], 20.0), MotionFileError::Features { .. }));
        assert!(matches!(with(&[], 20.0), MotionFileError::Motion(FitBvhError::NoFrames)));
        assert!(matches!(with(&sound.0, -1.0), MotionFileError::Motion(FitBvhError::Fps { .. })));
        assert!(matches!(write_sheet(folder.path(), &[]), Err(MotionFileError::NoMotions)));
        assert!(!folder.path().join("out").exists());
    }

    #[test]
    #[ignore = "for the eye: writes motions and sheets to target/gallery"]
    fn gallery() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("target/gallery/motion");
        let of_left =
            |(_, caption): &(_, String)| caption.contains("left") && caption.contains("walk");
        let clips: Vec<_> = (0..5).map(clip).chain((5..).map(clip).find(of_left)).collect();
        for (i, clip) in clips.iter().enumerate() {
            write_motion(&folder, &i.to_string(), &motion(clip)).unwrap();
        }
        let motions: Vec<CaptionedMotion> = clips.iter().map(motion).collect();
        write_sheet(&folder.join("sheet.png"), &motions).unwrap();
        assert!(folder.join("5.svg").exists());
    }
}
