//! A floor under an assembly.

use nalgebra::{Point3, Unit, Vector3};

use crate::tolerances::{FLOOR_MARGIN, FLOOR_THICKNESS};

use super::{SourceAssembly, SourceMesh, SourcePart};

/// A square plate on which an assembly stands. Lengths are in the input's units and frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Floor {
    /// The direction up.
    pub up: Unit<Vector3<f64>>,
    /// The middle of its upper face.
    pub centre: Point3<f64>,
    /// The side of the square.
    pub side: f64,
}

impl Floor {
    /// The name of its part.
    pub const NAME: &'static str = "floor";

    /// Under the lowest point of all parts. `None` if there are no vertices, or if they are not finite.
    #[must_use]
    pub fn under(assembly: &SourceAssembly, up: [f64; 3]) -> Option<Self> {
        let up = Unit::try_new(Vector3::from(up), 0.0)?;
        let [u, v] = across(&up);
        let vertices =
            || assembly.parts.iter().flat_map(|part| &part.mesh.vertices).map(|v| Vector3::from(*v));
        let range = |axis: &Vector3<f64>| {
            let heights = vertices().map(|p| p.dot(axis));
            heights.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)])
        };
        let [low, high] = range(&up);
        let (along, aside) = (range(&u), range(&v));
        let middle = |[low, high]: [f64; 2]| f64::midpoint(low, high);
        let centre = Point3::from(u * middle(along) + v * middle(aside) + *up * low);
        let longest = (high - low).max(along[1] - along[0]).max(aside[1] - aside[0]);
        let side = longest * (1.0 + 2.0 * FLOOR_MARGIN);
        let is_finite = side.is_finite() && centre.iter().all(|x| x.is_finite());
        is_finite.then_some(Self { up, centre, side })
    }

    /// The plate as a part.
    #[must_use]
    pub fn part(&self) -> SourcePart {
        let [u, v] = across(&self.up);
        let half = self.side / 2.0;
        let down = *self.up * -(self.side * FLOOR_THICKNESS);
        let corner = |i: usize| {
            let sign = |bit: usize| if i >> bit & 1 == 0 { -half } else { half };
            let depth = if i >> 2 & 1 == 0 { down } else { Vector3::zeros() };
            (self.centre + u * sign(0) + v * sign(1) + depth).coords.into()
        };
        let triangles = vec![
            [0, 2, 3],
            [0, 3, 1],
            [4, 5, 7],
            [4, 7, 6],
            [0, 1, 5],
            [0, 5, 4],
            [2, 6, 7],
            [2, 7, 3],
            [0, 4, 6],
            [0, 6, 2],
            [1, 3, 7],
            [1, 7, 5],
        ];
        let mesh = SourceMesh { vertices: (0..8).map(corner).collect(), triangles };
        SourcePart { name: Self::NAME.to_owned(), origin: "--floor".to_owned(), mesh }
    }
}

/// Two unit vectors that are perpendicular to the direction up and to each other: the coordinate axes that are, if it is one.
fn across(up: &Unit<Vector3<f64>>) -> [Vector3<f64>; 2] {
    let axis = Vector3::ith(up.iamin(), 1.0);
    let u = (axis - **up * axis.dot(up)).normalize();
    [u, up.cross(&u)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{cuboid, healed, source};
    use crate::geometry::Bounds;

    #[test]
    fn it_is_a_closed_plate_under_the_lowest_point() {
        let assembly =
            source([cuboid([0.0, 1.0, 2.0], [4.0, 3.0, 9.0]), cuboid([0.0, 1.0, 1.5], [1.0, 2.0, 2.0])]);
        for (up, lowest) in
            [([0.0, 0.0, 2.0], 1.5), ([0.0, 0.0, -1.0], -9.0), ([1.0, 0.0, 0.0], 0.0), ([3.0, 0.0, 4.0], 1.2)]
        {
            let floor = Floor::under(&assembly, up).unwrap();
            let part = floor.part();
            let heights: Vec<f64> =
                part.mesh.vertices.iter().map(|v| Vector3::from(*v).dot(&floor.up)).collect();
            let highest = heights.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            assert!((highest - lowest).abs() < 1e-12, "{up:?}: {highest}");
            let volume = healed(part.mesh.clone()).volume();
            assert!(
                (volume - floor.side.powi(3) * FLOOR_THICKNESS).abs() < 1e-9 * volume,
                "{up:?}: {volume}"
            );
            let points: Vec<Point3<f64>> = part.mesh.vertices.iter().map(|v| Point3::from(*v)).collect();
            let bounds = Bounds::of(&points);
            assert!(bounds.extents().max() < 3.0 * 7.5);
        }
        assert_eq!(Floor::under(&source([]), [0.0, 0.0, 1.0]), None);
        assert_eq!(Floor::under(&assembly, [0.0; 3]), None);
    }
}
