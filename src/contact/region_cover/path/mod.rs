//! How deep one surface gets into another on the way of a part: an upper bound, by branch and bound
//! over surface and way.
//!
//! A piece of surface on a stretch of the way lies in the hull of a few points (`contact/course`).
//! If all of these are within some distance of one convex region that the other surface does not
//! enter ([`FreeRegion`]), so is the whole piece all the way, and it gets no deeper than that: what
//! slides along a face, in a hole or in a groove is settled at once, and remembered by its place, for
//! what comes by later. What lies in the other surface with allowed penetration, maybe nearer to one face
//! of it here and to another there, is bounded by the triangles about it
//! ([`Surface::hull_depth`]). Other pieces are split, in space or in time, whichever is longer; but on a line
//! in space first, down to triangles: the prism that one of them passes is convex, however long.
//! Pieces of the smallest size are measured; their size is added. Of a long piece only what is within the box of
//! the other surface is asked about: a region need not hold what is outside by far ([`clip`]).
//!
//! Where threads with allowed penetration cross each other, and in sight of holes, this may take too long: a
//! count ends it, or that hardly anything was settled by then ([`PathDepth::open`]).
//!
//! So for closed surfaces the answer is a bound for all points and all times, not for samples (but
//! for [`FreeRegion`]'s rounding). Of surfaces with holes that holds where the winding number cannot
//! come near one half in a region ([`Rim`](crate::geometry::Rim)); in sight of holes a region may be partly
//! inside, and only small pieces are settled, by their corners.

mod bound;
mod clip;
mod walk;

use std::collections::HashMap;

use nalgebra::{Point3, Vector3};

use crate::budgets::{DEEP_POINTS, PATH_EFFORT, PATH_EFFORT_IN_DOUBT, RIM_EDGES_PER_EFFORT};
use crate::geometry::{FreeRegion, PatchTree, Surface};
use crate::termination::{Interrupt, Termination};
use crate::tolerances::DEPTH_SHARE;

use super::super::course::{Course, CourseView, Interval};
use super::super::pair_path::PairPath;

/// How finely depth is told, in the planning frame.
#[derive(Debug, Clone, Copy)]
pub(crate) struct DepthPrecision {
    /// Depth beyond what is allowed that is not looked into.
    pub(crate) ignored: f64,
    /// Depth beyond what is allowed from which on points are recorded, but not looked for any
    /// closer.
    pub(crate) deep: f64,
    /// Depth is told to a tenth, and as closely as this.
    pub(crate) margin: f64,
    /// Pieces of a smaller radius are not split.
    pub(crate) finest: f64,
    /// The same once something deep was found.
    pub(crate) coarse: f64,
}

/// The way of a part past one that stands.
pub(crate) struct PathQuestion<'a> {
    pub(crate) passing: &'a PairPath<'a>,
    pub(crate) course: &'a Course,
    pub(crate) precision: DepthPrecision,
    pub(crate) termination: &'a Termination,
}

impl PathQuestion<'_> {
    /// How deep the moving part gets into the standing one, and the other way round.
    pub(crate) fn depth(&self) -> Result<[PathDepth; 2], Interrupt> {
        let [moving, standing] = self.passing.surfaces();
        let side = |on_moving| {
            let measured = if on_moving { standing } else { moving };
            let most_effort = if measured.rim().is_some() { PATH_EFFORT_IN_DOUBT } else { PATH_EFFORT };
            self.depth_of_side(on_moving, Interval::WHOLE, most_effort)
        };
        let (one, other) = rayon::join(|| side(true), || side(false));
        Ok([one?, other?])
    }

    /// How deep the moving part gets into the standing one on a stretch of the way, or the other way
    /// round, looked at with no more than some effort.
    pub(crate) fn depth_of_side(
        &self,
        on_moving: bool,
        interval: Interval,
        most_effort: usize,
    ) -> Result<PathDepth, Interrupt> {
        let Self { passing, course, precision, termination } = *self;
        let [moving, standing] = passing.shapes;
        let (looked_at, measured) = if on_moving { (moving, standing) } else { (standing, moving) };
        let question = SideQuestion {
            surface: &looked_at.surface,
            tree: looked_at.patches(termination)?,
            measured: &measured.surface,
            allowed: passing.allowed,
            precision,
        };
        let view = CourseView::new(course, on_moving, precision.finest / 16.0);
        question.answer(view, interval, most_effort, termination)
    }
}

/// One surface that is measured against another.
pub(crate) struct SideQuestion<'a> {
    /// The surface whose points are asked for, and its triangles' tree.
    pub(crate) surface: &'a Surface,
    pub(crate) tree: &'a PatchTree,
    /// The surface into which they may get.
    pub(crate) measured: &'a Surface,
    /// The depth that counts as none.
    pub(crate) allowed: f64,
    pub(crate) precision: DepthPrecision,
}

/// What was found.
#[derive(Debug, Clone, Default)]
pub(crate) struct PathDepth {
    /// No point gets deeper than this beyond what is allowed.
    pub(crate) bound: f64,
    /// The largest depth that was measured beyond what is allowed.
    pub(crate) depth: f64,
    /// Points (frame of the surface asked about) that were measured deeper than
    /// [`DepthPrecision::deep`], or of which no less can be told: a good path has none, of a bad one these
    /// are the first found.
    pub(crate) deep: Vec<(Point3<f64>, f64)>,
    /// Stretches of the way on which the search was given up: the bound is none there.
    pub(crate) open: Vec<Interval>,
    /// How much was looked at: pieces (more for each where signs depend on many edges of holes), and regions that
    /// were looked for.
    pub(crate) effort: usize,
}

impl DepthPrecision {
    /// How closely some depth is told.
    fn margin_of(&self, depth: f64) -> f64 {
        (DEPTH_SHARE * depth).min(self.margin)
    }
}

impl PathDepth {
    /// Adds what was found elsewhere.
    pub(crate) fn add(&mut self, other: Self) {
        self.bound = self.bound.max(other.bound);
        self.depth = self.depth.max(other.depth);
        self.deep.extend(other.deep);
        self.open.extend(other.open);
        self.effort += other.effort;
    }

    /// Whether so much is deep that more would not change the answer.
    pub(crate) fn is_enough(&self) -> bool {
        self.deep.len() >= DEEP_POINTS
    }
}

/// Where to begin with a piece: a triangle near it, a region around it.
#[derive(Debug, Clone, Copy)]
struct SearchHint {
    triangle: u32,
    region: Option<u32>,
    /// No region was found for the piece of which this is one half.
    is_vain: bool,
}

/// A ball that holds the hull of what a piece passes.
#[derive(Debug, Clone, Copy)]
struct SweptBall {
    centre: Point3<f64>,
    radius: f64,
}

/// A cell of a grid, by the binary logarithm of its size and its indices.
type GridCell = (i32, [i64; 3]);

/// A region, and whether all of it is outside the surface that is measured: of one with holes, part of it may be
/// inside.
struct KnownRegion {
    free: FreeRegion,
    is_outside: bool,
}

/// The search for the deepest points: the question, the regions found so far, the hull of the piece in question, and
/// the answer so far.
struct PathSearch<'a> {
    asked: &'a SideQuestion<'a>,
    /// Whether the measured surface has holes, so that depth changes its sign off it, too.
    has_rim: bool,
    most_effort: usize,
    /// What a piece costs.
    price: usize,
    /// How much of surface and way was settled, as a share of all.
    done: f64,
    view: CourseView<'a>,
    termination: &'a Termination,
    regions: Vec<KnownRegion>,
    /// Regions in the order in which they held a piece.
    held: Vec<u32>,
    /// The same by the places of the pieces.
    places: HashMap<GridCell, Vec<u32>>,
    /// The corners of the hull in question, or those that say most about where it reaches.
    wanted: Vec<Point3<f64>>,
    /// All of them, unless they are too many.
    hull: Vec<Point3<f64>>,
    facing: Vector3<f64>,
    found: PathDepth,
}

impl<'a> PathSearch<'a> {
    fn new(
        asked: &'a SideQuestion<'a>,
        view: CourseView<'a>,
        most_effort: usize,
        termination: &'a Termination,
    ) -> Self {
        let rim = asked.measured.rim();
        Self {
            asked,
            has_rim: rim.is_some(),
            most_effort,
            price: 1 + rim.map_or(0, |rim| rim.edges().len() / RIM_EDGES_PER_EFFORT),
            done: 0.0,
            view,
            termination,
            regions: Vec::new(),
            held: Vec::new(),
            places: HashMap::new(),
            wanted: Vec::new(),
            hull: Vec::new(),
            facing: Vector3::zeros(),
            found: PathDepth::default(),
        }
    }
}

impl SideQuestion<'_> {
    /// Looks for the deepest points on a stretch of the way, with no more than some effort.
    ///
    /// # Errors
    /// The termination condition became true.
    pub(crate) fn answer(
        &self,
        view: CourseView<'_>,
        interval: Interval,
        most_effort: usize,
        termination: &Termination,
    ) -> Result<PathDepth, Interrupt> {
        let mut search = PathSearch::new(self, view, most_effort, termination);
        search.all(interval)?;
        Ok(search.found)
    }
}
