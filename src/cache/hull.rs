//! Hulls of two hulls, by the points of these: a function of them alone.

use nalgebra::Point3;

use super::records::HullRecord;
use super::{Cache, Digest, Key, Kind};
use crate::simulation::HullStore;

impl HullStore for Cache {
    fn hull(&self, points: &[u8; 32]) -> Option<Vec<Point3<f64>>> {
        let HullRecord { vertices } = self.get(&key(points))?;
        Some(vertices.into_iter().map(Point3::from).collect())
    }

    fn remember_hull(&self, points: &[u8; 32], vertices: &[Point3<f64>]) {
        if self.is_on_disk() {
            let vertices = vertices.iter().map(|v| v.coords.into()).collect();
            self.put(key(points), &HullRecord { vertices });
        }
    }
}

fn key(points: &[u8; 32]) -> Key {
    Digest::new().hash(points).key(Kind::Hull)
}
