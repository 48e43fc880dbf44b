//! Hulls of two hulls, by the points of these: a function of them alone.

use nalgebra::Point3;

use super::records::HullRecord;
use super::{Cache, Digest, Key, Kind, format};
use crate::scene::HullStore;

impl HullStore for Cache {
    fn hull(&self, points: &[u8; 32]) -> Option<Vec<Point3<f64>>> {
        let HullRecord { vertices, .. } = self.get(&key(points))?;
        Some(vertices.into_iter().map(Point3::from).collect())
    }

    fn recent_hulls(&self, most: usize) -> Vec<([u8; 32], Vec<Point3<f64>>)> {
        let read = |(listed, payload): (Key, Vec<u8>)| {
            let HullRecord { points, vertices } = format::decode(&payload)?;
            // Another build's hulls lie under other keys.
            let vertices = || vertices.into_iter().map(Point3::from).collect();
            (key(&points) == listed).then(|| (points, vertices()))
        };
        let bytes = most * size_of::<Point3<f64>>();
        self.recent(Kind::Hull, most, bytes as u64).into_iter().filter_map(read).collect()
    }

    fn hull_used(&self, points: &[u8; 32]) {
        self.touch(key(points));
    }

    fn remember_hull(&self, points: &[u8; 32], vertices: &[Point3<f64>]) {
        if self.is_on_disk() {
            let vertices = vertices.iter().map(|v| v.coords.into()).collect();
            self.put(key(points), &HullRecord { points: *points, vertices });
        }
    }
}

fn key(points: &[u8; 32]) -> Key {
    Digest::new().hash(points).key(Kind::Hull)
}

#[cfg(test)]
mod tests {
    use super::super::CacheSettings;
    use super::*;
    use crate::fixtures::spread;

    #[test]
    fn the_hulls_used_last_are_told_with_their_points() {
        let folder = tempfile::tempdir().unwrap();
        let settings = CacheSettings { folder: Some(folder.path().to_owned()), ..CacheSettings::default() };
        let cache = Cache::open(&settings).unwrap();
        let hull = |n: u8| -> Vec<_> { spread([0.0; 3], [f64::from(n); 3], 20).collect() };
        for n in 1..4 {
            cache.remember_hull(&[n; 32], &hull(n));
            cache.flush();
        }
        // As another build would have remembered it: it is not of the points of its key.
        cache.put(key(&[9; 32]), &HullRecord { points: [4; 32], vertices: vec![[0.0; 3]; 4] });
        drop(cache);
        let cache = Cache::open(&settings).unwrap();
        assert_eq!(cache.recent_hulls(1000), [1, 2, 3].map(|n| ([n; 32], hull(n))));
        assert_eq!(cache.recent_hulls(40), [([3; 32], hull(3))], "points are counted");
        assert_eq!(cache.hull(&[1; 32]), Some(hull(1)));
        cache.hull_used(&[2; 32]);
        cache.flush();
        drop(cache);
        let cache = Cache::open(&settings).unwrap();
        let recent = cache.recent_hulls(1000).into_iter().map(|(points, _)| points[0]);
        assert_eq!(recent.collect::<Vec<_>>()[0], 3, "the others were used later");
        assert!(Cache::in_memory(1 << 20).recent_hulls(9).is_empty());
    }
}
