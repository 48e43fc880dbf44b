//! Hulls of two hulls, by the hash of the points of these: a function of them alone.

use nalgebra::Point3;
use serde::{Deserialize, Serialize};

use crate::cache::{Cache, Digest, RecordKey, RecordKind, Storage, Validity};
use crate::scene::HullStore;

/// The hull of two hulls.
pub(crate) static HULL: RecordKind =
    RecordKind::of::<HullRecord>(12, "hull", Storage::Disk, Validity::Sources(env!("SBDP_SOURCES_SCENE")));

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct HullRecord {
    /// The hash of the points. Only where it leads to the record's key is the record this build's.
    points: [u8; 32],
    /// Of the convex hull.
    vertices: Vec<Point3<f64>>,
}

impl HullStore for Cache {
    fn hull(&self, points: &[u8; 32]) -> Option<Vec<Point3<f64>>> {
        self.get(&key(points)).map(|HullRecord { vertices, .. }| vertices)
    }

    fn recent_hulls(&self, most: usize) -> Vec<([u8; 32], Vec<Point3<f64>>)> {
        let ours = |(listed, HullRecord { points, vertices }): (RecordKey, HullRecord)| {
            (key(&points) == listed).then_some((points, vertices))
        };
        let bytes = most * size_of::<Point3<f64>>();
        self.recent(&HULL, most, bytes as u64).into_iter().filter_map(ours).collect()
    }

    fn hull_used(&self, points: &[u8; 32]) {
        self.touch(key(points));
    }

    fn remember_hull(&self, points: &[u8; 32], vertices: &[Point3<f64>]) {
        if self.is_on_disk() {
            self.put(key(points), &HullRecord { points: *points, vertices: vertices.to_vec() });
        }
    }
}

fn key(points: &[u8; 32]) -> RecordKey {
    Digest::new().hash(points).key(&HULL)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cache::CacheSettings;
    use crate::fixtures::spread;

    #[test]
    fn the_hulls_used_last_are_found_with_their_points() {
        let folder = tempfile::tempdir().unwrap();
        let settings = CacheSettings { folder: Some(folder.path().to_owned()), ..CacheSettings::default() };
        let open = || Cache::open(&settings, &[&HULL]).unwrap();
        let cache = open();
        let hull = |n: u8| -> Vec<_> { spread([0.0; 3], [f64::from(n); 3], 20).collect() };
        for n in 1..4 {
            cache.remember_hull(&[n; 32], &hull(n));
            cache.flush();
        }
        // As another build would have remembered it: it is not of the points of its key.
        cache.put(key(&[9; 32]), &HullRecord { points: [4; 32], vertices: vec![Point3::origin(); 4] });
        drop(cache);
        let cache = open();
        assert_eq!(cache.recent_hulls(1000), [1, 2, 3].map(|n| ([n; 32], hull(n))));
        assert_eq!(cache.recent_hulls(40), [([3; 32], hull(3))], "points are counted");
        assert_eq!(cache.hull(&[1; 32]), Some(hull(1)));
        cache.hull_used(&[2; 32]);
        cache.flush();
        drop(cache);
        let cache = open();
        let recent = cache.recent_hulls(1000).into_iter().map(|(points, _)| points[0]);
        assert_eq!(recent.collect::<Vec<_>>()[0], 3, "the others were used later");
        assert!(Cache::in_memory(1 << 20, &[&HULL]).recent_hulls(9).is_empty());
    }
}
