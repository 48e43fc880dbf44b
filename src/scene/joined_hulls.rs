//! Hulls of two hulls, remembered by their points: planning a slightly changed assembly joins the same ones again.
//! The larger ones are in a store as well, if there is one.

use std::collections::HashSet;
use std::sync::{Arc, Mutex, PoisonError};

use nalgebra::Point3;

use crate::budgets::{FEWEST_STORED_POINTS, REMEMBERED_HULL_POINTS};
use crate::geometry::hull_vertices;
use crate::lru::Lru;

/// Where hulls are found that were joined before this process began.
pub trait HullStore: std::fmt::Debug + Send + Sync {
    /// The vertices of the hull of points with a hash, if they are there.
    fn hull(&self, points: &[u8; 32]) -> Option<Vec<Point3<f64>>>;
    /// The hulls used last before this process began, with the hashes of their points, with at most `most` vertices
    /// in all; the last one used comes last. This does not count as use.
    fn recent_hulls(&self, most: usize) -> Vec<([u8; 32], Vec<Point3<f64>>)>;
    /// Notes that a hull was used.
    fn hull_used(&self, points: &[u8; 32]);
    /// Remembers them.
    fn remember_hull(&self, points: &[u8; 32], vertices: &[Point3<f64>]);
}

/// What is remembered. The result is a function of the points alone, so it may be shared by all scenes.
#[derive(Debug, Default)]
pub struct JoinedHulls {
    held: Mutex<JoinedHull>,
    store: Option<Arc<dyn HullStore>>,
}

#[derive(Debug, Default)]
struct JoinedHull {
    joined: Lru<[u8; 32], [Point3<f64>]>,
    points: usize,
    /// Hulls that were read ahead and not used yet.
    unused: HashSet<[u8; 32]>,
}

impl JoinedHulls {
    /// Nothing yet but what is in a store.
    #[must_use]
    pub fn stored(store: Arc<dyn HullStore>) -> Self {
        Self { held: Mutex::default(), store: Some(store) }
    }

    /// Reads the hulls used last from the store at once: one by one they take longer.
    pub fn recall_recent(&self) {
        let store = self.store.as_ref();
        let recent = store.map_or_else(Vec::new, |store| store.recent_hulls(REMEMBERED_HULL_POINTS / 2));
        for (key, joined) in recent {
            let mut held = self.held();
            if held.joined.peek(&key).is_none() {
                held.keep(key, joined.into());
                held.unused.insert(key);
            }
        }
    }

    /// Vertices of the convex hull of the points of two hulls.
    pub(super) fn of(&self, a: &Arc<[Point3<f64>]>, b: &Arc<[Point3<f64>]>) -> Arc<[Point3<f64>]> {
        if a.is_empty() || b.is_empty() {
            return Arc::clone(if a.is_empty() { b } else { a });
        }
        let key = key(a, b);
        // No other thread waits while the store notes the use.
        let known = self.held().known(&key);
        if let Some((known, is_first_use)) = known {
            if is_first_use && let Some(store) = &self.store {
                // Otherwise the hulls that every process uses would leave the store first.
                store.hull_used(&key);
            }
            return known;
        }
        let store = self.store.as_ref().filter(|_| a.len() + b.len() >= FEWEST_STORED_POINTS);
        let stored = store.and_then(|store| store.hull(&key));
        let join = || {
            let joined = hull_vertices(&[&**a, &**b].concat());
            if let Some(store) = store {
                store.remember_hull(&key, &joined);
            }
            joined
        };
        let joined: Arc<[Point3<f64>]> = stored.unwrap_or_else(join).into();
        self.held().keep(key, Arc::clone(&joined));
        joined
    }

    /// How many are remembered.
    #[cfg(test)]
    pub(super) fn count(&self) -> usize {
        self.held().joined.iter().count()
    }

    /// A holder that panicked cannot have left more than the sum wrong.
    fn held(&self) -> std::sync::MutexGuard<'_, JoinedHull> {
        self.held.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl JoinedHull {
    /// What is remembered of some points, and whether that was read ahead and is asked for the first time.
    fn known(&mut self, key: &[u8; 32]) -> Option<(Arc<[Point3<f64>]>, bool)> {
        Some((self.joined.get(key)?, self.unused.remove(key)))
    }

    fn keep(&mut self, key: [u8; 32], joined: Arc<[Point3<f64>]>) {
        self.points += joined.len();
        self.points -= self.joined.insert(key, joined).map_or(0, |before| before.len());
        let Self { joined, points, unused } = self;
        if *points > REMEMBERED_HULL_POINTS {
            joined.evict(|key, gone| {
                unused.remove(&key);
                *points -= gone.len();
                *points > REMEMBERED_HULL_POINTS / 2
            });
        }
    }
}

fn key(a: &[Point3<f64>], b: &[Point3<f64>]) -> [u8; 32] {
    let mut hasher = blake3::Hasher::new();
    for points in [a, b] {
        hasher.update(&(points.len() as u64).to_le_bytes());
        // In one piece: that is several times as fast as point by point.
        let coordinates: Vec<[f64; 3]> = points.iter().map(|p| p.coords.into()).collect();
        hasher.update(bytemuck::cast_slice(&coordinates));
    }
    hasher.finalize().into()
}

#[cfg(test)]
mod tests {
    use std::collections::HashMap;

    use super::*;
    use crate::fixtures::spread;

    #[test]
    fn what_is_remembered_is_what_would_be_joined_and_not_too_much() {
        let hulls = JoinedHulls::default();
        let cloud = |at: f64| -> Arc<[Point3<f64>]> { spread([at; 3], [at + 1.0; 3], 40).collect() };
        for at in 0..4000 {
            let (a, b) = (cloud(f64::from(at)), cloud(f64::from(at) + 0.5));
            let joined = hulls.of(&a, &b);
            assert!(Arc::ptr_eq(&joined, &hulls.of(&a, &b)), "it is remembered");
            assert_eq!(*joined, *hull_vertices(&[&*a, &*b].concat()));
        }
        let held = hulls.held();
        assert!((1..=REMEMBERED_HULL_POINTS).contains(&held.points));
        assert_eq!(held.points, held.joined.iter().map(|(_, h)| h.len()).sum::<usize>());
    }

    #[test]
    fn what_a_store_has_is_not_joined_again() {
        #[derive(Debug, Default)]
        struct Stored(Mutex<HashMap<[u8; 32], Vec<Point3<f64>>>>, Mutex<Vec<[u8; 32]>>);
        impl HullStore for Stored {
            fn hull(&self, points: &[u8; 32]) -> Option<Vec<Point3<f64>>> {
                self.0.lock().unwrap().get(points).cloned()
            }
            fn recent_hulls(&self, _: usize) -> Vec<([u8; 32], Vec<Point3<f64>>)> {
                self.0.lock().unwrap().iter().map(|(key, hull)| (*key, hull.clone())).collect()
            }
            fn hull_used(&self, points: &[u8; 32]) {
                self.1.lock().unwrap().push(*points);
            }
            fn remember_hull(&self, points: &[u8; 32], vertices: &[Point3<f64>]) {
                self.0.lock().unwrap().insert(*points, vertices.to_vec());
            }
        }
        let cloud = |count: usize| -> Arc<[Point3<f64>]> { spread([0.0; 3], [1.0; 3], count).collect() };
        let (large, small) = (cloud(FEWEST_STORED_POINTS), cloud(9));
        let store = Arc::new(Stored::default());
        let first = JoinedHulls::stored(store.clone());
        let joined = first.of(&large, &small);
        first.of(&cloud(4), &cloud(5));
        assert_eq!(store.0.lock().unwrap().len(), 1, "few points are joined as quickly");
        assert_eq!(*JoinedHulls::stored(store.clone()).of(&large, &small), *joined);
        assert_eq!(store.0.lock().unwrap().len(), 1, "it was found");
        store.0.lock().unwrap().values_mut().for_each(|hull| hull.truncate(4));
        let told = JoinedHulls::stored(store.clone()).of(&large, &small);
        assert_eq!(*told, joined[..4], "nothing was joined");
        let recalled = JoinedHulls::stored(store.clone());
        recalled.recall_recent();
        store.0.lock().unwrap().clear();
        assert!(store.1.lock().unwrap().is_empty());
        for _ in 0..2 {
            assert_eq!(*recalled.of(&large, &small), joined[..4], "it was read ahead");
        }
        assert_eq!(*store.1.lock().unwrap(), [key(&large, &small)], "its first use is noted");
    }

    #[test]
    fn nothing_and_a_hull_are_that_hull() {
        let (hulls, none) = (JoinedHulls::default(), Arc::default());
        let some: Arc<[Point3<f64>]> = spread([0.0; 3], [1.0; 3], 9).collect();
        assert!(Arc::ptr_eq(&hulls.of(&some, &none), &some) && Arc::ptr_eq(&hulls.of(&none, &some), &some));
    }
}
