//! The Delaunay triangulation of points in the plane.

use crate::laws::published::tao::error::FrontierError;
use spade::{DelaunayTriangulation, Point2, Triangulation};
use std::collections::HashMap;

/// How far outside a triangle a point still counts as on its border, in barycentric coordinates.
const BORDER: f64 = 100.0 * f64::EPSILON;

/// Points and the triangles between them.
pub(super) struct Mesh {
    pub points: Vec<[f64; 2]>,
    /// Counter-clockwise indices.
    triangles: Vec<[usize; 3]>,
    /// The third corner of the triangle that runs through an edge from its first end to its second.
    opposite: HashMap<[usize; 2], usize>,
}

/// Where a point is: the corners of its triangle and its weight for each.
pub(super) struct Place {
    pub corners: [usize; 3],
    pub weights: [f64; 3],
}

impl Mesh {
    /// The Delaunay triangulation, by exact predicates, of the points in the units they come in;
    /// other units give other triangles.
    pub fn new(points: Vec<[f64; 2]>) -> Result<Self, FrontierError> {
        let vertices = points.iter().map(|[x, y]| Point2::new(*x, *y)).collect();
        let delaunay = DelaunayTriangulation::<Point2<f64>>::bulk_load_stable(vertices)
            .map_err(|error| FrontierError::NotAGrid(error.to_string()))?;
        let triangles: Vec<[usize; 3]> =
            delaunay.inner_faces().map(|face| face.vertices().map(|v| v.fix().index())).collect();
        let edges = |t: &[usize; 3]| [0, 1, 2].map(|k| ([t[k], t[(k + 1) % 3]], t[(k + 2) % 3]));
        let opposite = triangles.iter().flat_map(edges).collect();
        Ok(Self { points, triangles, opposite })
    }

    /// The third corner of the triangle to the left of the way from `from` to `to`; none outside.
    pub fn left_of(&self, from: usize, to: usize) -> Option<usize> {
        self.opposite.get(&[from, to]).copied()
    }

    /// For each point the others that it shares an edge with, ascending.
    pub fn neighbours(&self) -> Vec<Vec<usize>> {
        let mut neighbours = vec![Vec::new(); self.points.len()];
        for [from, to] in self.opposite.keys() {
            neighbours[*from].push(*to);
            neighbours[*to].push(*from);
        }
        neighbours.iter_mut().for_each(|of| {
            of.sort_unstable();
            of.dedup();
        });
        neighbours
    }

    /// The triangle that a point lies in; none outside all.
    pub fn locate(&self, point: [f64; 2]) -> Option<Place> {
        let places =
            self.triangles.iter().map(|t| Place { corners: *t, weights: self.weights(*t, point) });
        let depth = |place: &Place| place.weights.into_iter().fold(f64::MAX, f64::min);
        places.filter(|p| depth(p) >= -BORDER).max_by(|a, b| depth(a).total_cmp(&depth(b)))
    }

    /// Barycentric coordinates: the share of the triangle's area across from each corner.
    pub fn weights(&self, corners: [usize; 3], point: [f64; 2]) -> [f64; 3] {
        let [a, b, c] = corners.map(|corner| difference(self.points[corner], point));
        let areas = [cross(b, c), cross(c, a), cross(a, b)];
        let whole = cross(difference(b, a), difference(c, a));
        areas.map(|area| area / whole)
    }
}

pub(super) fn difference(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] - b[0], a[1] - b[1]]
}

fn cross(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Whether the circle through the corners holds the point, by a determinant.
    fn circle_holds(mesh: &Mesh, corners: [usize; 3], point: [f64; 2]) -> bool {
        let [a, b, c] = corners.map(|corner| difference(mesh.points[corner], point));
        let square = |v: [f64; 2]| v[0] * v[0] + v[1] * v[1];
        let determinant =
            square(a) * cross(b, c) + square(b) * cross(c, a) + square(c) * cross(a, b);
        determinant > 1e-9
    }

    proptest! {
        #[test]
        fn no_circle_around_a_triangle_holds_another_point(
            points in proptest::collection::vec([0.0..1.0f64, 0.0..1.0f64], 4..40),
        ) {
            let mesh = Mesh::new(points).unwrap();
            for corners in &mesh.triangles {
                for point in &mesh.points {
                    prop_assert!(!circle_holds(&mesh, *corners, *point));
                }
            }
        }
    }

    #[test]
    fn a_point_is_the_weighted_mean_of_its_corners() {
        let points = vec![[0.0, 0.0], [1e9, 1e6], [0.0, 1e11], [1e9, 3e11], [4e8, 2e10]];
        let mesh = Mesh::new(points).unwrap();
        let place = mesh.locate([3e8, 4e10]).unwrap();
        let mean = |axis: usize| -> f64 {
            (0..3).map(|k| place.weights[k] * mesh.points[place.corners[k]][axis]).sum()
        };
        assert!((mean(0) / 3e8 - 1.0).abs() < 1e-12);
        assert!((mean(1) / 4e10 - 1.0).abs() < 1e-12);
        assert!(mesh.locate([-1.0, 4e10]).is_none());
    }

    #[test]
    fn a_square_with_a_middle_has_eight_edges() {
        let points = vec![[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0], [1.0, 1.0]];
        let mesh = Mesh::new(points).unwrap();
        assert_eq!(mesh.neighbours()[0], [1, 3, 4]);
        assert_eq!(mesh.neighbours()[4], [0, 1, 2, 3]);
        assert_eq!((mesh.left_of(0, 1), mesh.left_of(1, 0)), (Some(4), None));
    }
}
