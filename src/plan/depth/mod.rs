//! How deep one surface gets into another on the way of a part: an upper bound, by branch and bound
//! over surface and way.
//!
//! A piece of surface on a stretch of the way lies in the hull of a few points ([`super::course`]).
//! If all of these are within some distance of one convex region that the other surface does not
//! enter ([`FreeRegion`]), so is the whole piece all the way, and it gets no deeper than that: what
//! slides along a face, in a hole or in a groove is settled at once, and remembered by its place, for
//! what comes by later. What lies in the other surface with granted overlap, maybe nearer to one face
//! of it here and to another there, is bounded by the triangles about it
//! ([`Surface::hull_depth`]). Other pieces are split, in space or in time, whichever is longer; but on a line
//! in space first, down to triangles: the prism that one of them passes is convex, however long.
//! Pieces of the smallest size are measured; their size is added. Of a long piece only what is within the box of
//! the other surface is asked about: a region need not hold what is outside by far ([`slab`]).
//!
//! Where threads with granted overlap cross each other, and in sight of holes, this may take too long: a
//! count ends it, or that hardly anything was settled by then ([`Found::open`]).
//!
//! So for closed surfaces the answer is a bound for all points and all times, not for samples (but
//! for [`FreeRegion`]'s rounding). Of surfaces with holes that holds where the winding number cannot
//! come near one half in a region ([`Rim`](crate::geometry::Rim)); in sight of holes a region may be partly
//! inside, and only small pieces are settled, by their corners.

mod settle;
mod slab;
mod walk;

use nalgebra::Point3;

use crate::geometry::{PatchTree, Surface};
use crate::termination::{Interrupt, Termination};

use super::course::{Interval, View};
use walk::Search;

/// How finely depth is told, in the planning frame.
#[derive(Debug, Clone, Copy)]
pub(super) struct Precision {
    /// Depth beyond what is granted that is not looked into.
    pub(super) spare: f64,
    /// Depth beyond what is granted from which on points are recorded, but not looked for any
    /// closer.
    pub(super) deep: f64,
    /// Depth is told to a tenth, and as closely as this.
    pub(super) margin: f64,
    /// Pieces of a smaller radius are not split.
    pub(super) finest: f64,
    /// The same once something deep was found.
    pub(super) coarse: f64,
}

/// One surface that is measured against another.
pub(super) struct Question<'a> {
    /// The surface whose points are asked for, and its triangles' tree.
    pub(super) surface: &'a Surface,
    pub(super) tree: &'a PatchTree,
    /// The surface into which they may get.
    pub(super) measured: &'a Surface,
    /// The depth that counts as none.
    pub(super) granted: f64,
    pub(super) precision: Precision,
}

/// What was found.
#[derive(Debug, Clone, Default)]
pub(super) struct Found {
    /// No point gets deeper than this beyond what is granted.
    pub(super) bound: f64,
    /// The largest depth that was measured beyond what is granted.
    pub(super) depth: f64,
    /// Points (frame of the surface asked about) that were measured deeper than
    /// [`Precision::deep`], or of which no less can be told: a good path has none, of a bad one these
    /// are the first found.
    pub(super) deep: Vec<(Point3<f64>, f64)>,
    /// Stretches of the way on which the search was given up: the bound is none there.
    pub(super) open: Vec<Interval>,
    /// How much was looked at: pieces (more for each where signs depend on many edges of holes), and regions that
    /// were looked for.
    pub(super) effort: usize,
}

/// After so many deep points, a path is bad enough.
const ENOUGH: usize = 400;
/// Depths are told to this share.
const NEARLY: f64 = 0.1;

impl Precision {
    /// How closely some depth is told.
    fn margin_of(&self, depth: f64) -> f64 {
        (NEARLY * depth).min(self.margin)
    }
}

impl Found {
    /// Adds what was found elsewhere.
    pub(super) fn add(&mut self, other: Self) {
        self.bound = self.bound.max(other.bound);
        self.depth = self.depth.max(other.depth);
        self.deep.extend(other.deep);
        self.open.extend(other.open);
        self.effort += other.effort;
    }

    /// Whether so much is deep that more would not change the answer.
    pub(super) fn is_enough(&self) -> bool {
        self.deep.len() >= ENOUGH
    }
}

impl Question<'_> {
    /// Looks for the deepest points on a stretch of the way, with no more than some effort.
    ///
    /// # Errors
    /// The termination condition became true.
    pub(super) fn answer(
        &self,
        view: View<'_>,
        interval: Interval,
        most_effort: usize,
        termination: &Termination,
    ) -> Result<Found, Interrupt> {
        let mut search = Search::new(self, view, most_effort, termination);
        search.all(interval)?;
        Ok(search.found)
    }
}
