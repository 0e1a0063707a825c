//! How a reconstruction moves beside the truth: steps across the boundaries of codes, jerk, and the root's
//! place, which MPJPE with its aligned pelvis does not see.

use crate::codes::Continuity;
use crate::motion::Pose;
use crate::scores::jerk;

/// Metres that the root travels at least in a clip whose path counts.
const SHORTEST_PATH_M: f64 = 1.0;

/// What a [`Continuity`] needs of one clip; pairs are of the reconstruction and the truth.
#[derive(Clone, Copy, Debug)]
pub struct Course {
    /// Steps of the joints across the boundaries of codes, in metres, summed.
    across: [f64; 2],
    /// Steps inside codes, summed.
    inside: [f64; 2],
    /// Jerk in m/s³, summed over `n_jerks` frames.
    jerk: [f64; 2],
    n_jerks: usize,
    /// Length of the true root's path on the ground.
    path_m: f64,
    /// Distance of the root from the true root on the ground, mean over time.
    root_m: f64,
    /// The same in the last frame.
    root_end_m: f64,
}

impl Course {
    /// That of a reconstruction and the truth at `fps` frames a second; `latents` has the latent of each frame, or its
    /// code where codes have frames of their own.
    pub fn of([made, truth]: [&[Pose]; 2], latents: &[usize], fps: f64) -> Self {
        let both = [made, truth];
        let steps = both.map(|poses| poses.windows(2).map(step_m).collect::<Vec<f64>>());
        // Step i leads from frame i to frame i + 1.
        let sum = |steps: &Vec<f64>, crosses: bool| {
            let pairs = steps.iter().zip(latents.windows(2));
            let chosen = pairs.filter(|(_, pair)| (pair[0] != pair[1]) == crosses);
            chosen.map(|(step, _)| step).sum::<f64>()
        };
        let n_jerks = truth.len().saturating_sub(3);
        let jerks =
            |poses: &[Pose]| if n_jerks > 0 { jerk(poses, fps) * n_jerks as f64 } else { 0.0 };
        let roots = made.iter().zip(truth).map(|(made, truth)| on_ground_m(made, truth));
        let roots: Vec<f64> = roots.collect();
        Self {
            across: steps.each_ref().map(|steps| sum(steps, true)),
            inside: steps.each_ref().map(|steps| sum(steps, false)),
            jerk: both.map(jerks),
            n_jerks,
            path_m: truth.windows(2).map(|pair| on_ground_m(&pair[0], &pair[1])).sum(),
            root_m: roots.iter().sum::<f64>() / roots.len().max(1) as f64,
            root_end_m: roots.last().copied().unwrap_or_default(),
        }
    }

    fn travels(&self) -> bool {
        self.path_m >= SHORTEST_PATH_M
    }
}

/// The continuity of clips together: steps and jerk of all frames, errors of the root as medians over the clips
/// that travel.
pub fn continuity<'a>(courses: impl Iterator<Item = &'a Course> + Clone) -> Continuity {
    let over = |of: fn(&Course) -> [f64; 2]| {
        let [made, truth] =
            [0, 1].map(|i| courses.clone().map(|course| of(course)[i]).sum::<f64>());
        (truth > 0.0).then(|| made / truth)
    };
    let (across, inside) = (over(|course| course.across), over(|course| course.inside));
    let travelling = courses.clone().filter(|course| course.travels());
    let share = |of: fn(&Course) -> f64| {
        median(travelling.clone().map(|course| of(course) / course.path_m).collect())
    };
    let n_jerks: usize = courses.clone().map(|course| course.n_jerks).sum();
    let travelling_clips = travelling.clone().count();
    Continuity {
        boundary_step_ratio: across.zip(inside).map(|(across, inside)| across / inside),
        jerk: courses.clone().map(|course| course.jerk[0]).sum::<f64>() / n_jerks.max(1) as f64,
        jerk_ratio: over(|course| course.jerk),
        root_error: share(|course| course.root_m),
        root_end_error: share(|course| course.root_end_m),
        travelling_clips,
        still_clips: courses.count() - travelling_clips,
    }
}

/// Mean distance that the joints move between two frames, in metres.
fn step_m(pair: &[Pose]) -> f64 {
    let joints = pair[0].iter().zip(&pair[1]);
    let moved = |(a, b): (&[f32; 3], &[f32; 3])| {
        let squares = a.iter().zip(b).map(|(a, b)| f64::from(a - b).powi(2));
        squares.sum::<f64>().sqrt()
    };
    joints.map(moved).sum::<f64>() / pair[0].len() as f64
}

/// Distance of two roots on the ground, in metres.
fn on_ground_m(a: &Pose, b: &Pose) -> f64 {
    f64::from(a[0][0] - b[0][0]).hypot(f64::from(a[0][2] - b[0][2]))
}

fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_unstable_by(f64::total_cmp);
    let middle = values.len() / 2;
    let upper = *values.get(middle)?;
    Some(if values.len().is_multiple_of(2) { 0.5 * (values[middle - 1] + upper) } else { upper })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::N_JOINTS;

    const FPS: f64 = 20.0;

    /// A body whose joints are all at (x, 1, 0) in each frame.
    fn at(places: impl IntoIterator<Item = f64>) -> Vec<Pose> {
        places.into_iter().map(|x| [[x as f32, 1.0, 0.0]; N_JOINTS]).collect()
    }

    /// 10 cm a frame.
    fn walk(n: usize) -> Vec<Pose> {
        at((0..n).map(|t| 0.1 * t as f64))
    }

    fn of(pairs: &[[Vec<Pose>; 2]], frames: usize) -> Continuity {
        let latents: Vec<usize> = (0..64).map(|frame| frame / frames).collect();
        let course = |[made, truth]: &[Vec<Pose>; 2]| Course::of([made, truth], &latents, FPS);
        let courses: Vec<Course> = pairs.iter().map(course).collect();
        continuity(courses.iter())
    }

    fn near(found: Option<f64>, wanted: f64) {
        let found = found.expect("measured");
        assert!((found - wanted).abs() < 1e-4, "{found} for {wanted}");
    }

    #[test]
    fn the_truth_has_ratios_of_one_and_no_error() {
        let bent: Vec<Pose> = at((0..40).map(|t| 0.1 * f64::from(t) + (0.7 * f64::from(t)).sin()));
        let found = of(&[[bent.clone(), bent]], 4);
        near(found.boundary_step_ratio, 1.0);
        near(found.jerk_ratio, 1.0);
        near(found.root_end_error, 0.0);
        assert_eq!((found.travelling_clips, found.still_clips), (1, 0));
    }

    #[test]
    fn a_stutter_of_k_times_the_step_inside_has_ratio_k() {
        // Steps of 5 cm inside codes and of 15 cm across their boundaries, where the truth has 10.
        let step = |t: usize| if t.is_multiple_of(4) { 0.15 } else { 0.05 };
        let stutter = (0..33).scan(0.0, |x, t| {
            *x += if t == 0 { 0.0 } else { step(t) };
            Some(*x)
        });
        let found = of(&[[at(stutter.clone()), walk(33)]], 4);
        near(found.boundary_step_ratio, 3.0);
        assert_eq!(of(&[[at(stutter), walk(33)]], 1).boundary_step_ratio, None);
    }

    #[test]
    fn an_uneven_truth_divides_what_is_made_of_it() {
        // The truth itself moves twice as far across boundaries; half of each step is made.
        let step = |t: usize| if t.is_multiple_of(4) { 0.2 } else { 0.1 };
        let sum = |share: f64| at((0..33).map(|n| share * (1..=n).map(step).sum::<f64>()));
        near(of(&[[sum(0.5), sum(1.0)]], 4).boundary_step_ratio, 1.0);
    }

    #[test]
    fn jerk_is_that_of_the_third_derivative_over_the_truths() {
        // x = c t³ has a jerk of 6 c.
        let cubic = |c: f64| at((0..20).map(|t| c * (f64::from(t) / FPS).powi(3)));
        let found = of(&[[cubic(5.0), cubic(2.0)]], 4);
        assert!((found.jerk - 30.0).abs() < 0.1, "{found:?}");
        assert!((found.jerk_ratio.unwrap() - 2.5).abs() < 0.02, "{found:?}");
        assert_eq!(of(&[[walk(3), walk(3)]], 4).jerk_ratio, None);
    }

    #[test]
    fn a_root_that_is_slower_by_a_share_ends_by_this_share_away() {
        let slow = at((0..41).map(|t| 0.075 * f64::from(t)));
        let found = of(&[[slow, walk(41)]], 4);
        near(found.root_end_error, 0.25);
        near(found.root_error, 0.125);
    }

    #[test]
    fn the_median_is_over_clips_that_travel_and_the_others_are_counted() {
        let shifted = |share: f64| [at((0..41).map(|t| 0.1 * share * f64::from(t))), walk(41)];
        let still = [walk(9), walk(9)];
        let pairs = [shifted(0.9), still.clone(), shifted(0.5), shifted(0.7), still];
        let found = of(&pairs, 4);
        near(found.root_end_error, 0.3);
        near(of(&pairs[..3], 4).root_end_error, 0.3);
        assert_eq!((found.travelling_clips, found.still_clips), (3, 2));
        assert_eq!(of(&pairs[1..2], 4).root_end_error, None);
    }
}
