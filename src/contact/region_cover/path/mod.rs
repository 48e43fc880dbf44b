//! How deep one surface gets into another along a path: an upper bound, by branch and bound over surface and time.
//!
//! A piece of surface on a stretch of the path lies in the hull of a few points (`contact/course`). If these points
//! are within some distance of one convex region that the other surface does not enter ([`FreeRegion`]), so is the
//! whole piece on the whole stretch, and it gets no deeper than that distance. What slides along a face, in a hole or
//! in a groove is bounded at once, and the region is kept for later pieces at the same place. A piece that lies in
//! the other surface by an allowed penetration, nearer to one face here and to another there, is bounded by the
//! triangles around it ([`Surface::hull_depth`]). Other pieces are split, in space or in time, whichever is longer;
//! on a straight path first in space, down to triangles, as the prism that a triangle sweeps is convex. The smallest
//! pieces are measured, and their size is added. Of a long piece only the part within the other surface's box is
//! considered, as a region need not hold what is far outside ([`clip`]).
//!
//! Where threads with an allowed penetration cross, and near holes, this may take too long: a budget ends it, or the
//! observation that hardly anything is bounded yet ([`PathDepth::open`]).
//!
//! For closed surfaces the answer is a bound for all points and all times (up to the rounding of [`FreeRegion`]), and
//! no sample. For surfaces with holes it is one where the winding number in a region cannot come near one half
//! ([`Rim`](crate::geometry::Rim)). Near holes a region may be partly inside, and only small pieces are bounded, by
//! their corners.

mod bound;
mod clip;
mod walk;

use std::collections::HashMap;

use nalgebra::{Point3, Vector3};

use crate::budgets::{
    DEEP_POINTS, LONG_STEPS_PER_POLL, PATH_EFFORT, PATH_EFFORT_IN_DOUBT, RIM_EDGES_PER_EFFORT,
};
use crate::geometry::{FreeRegion, Surface};
use crate::termination::{Interrupt, Poll, Termination};
use crate::tolerances::DEPTH_SHARE;

use super::super::course::{Course, CourseView, Interval};
use super::super::pair_path::PairPath;
use super::pieces::CoveredSurface;

/// How precisely depth is computed, in the planning frame.
#[derive(Debug, Clone, Copy)]
pub(crate) struct DepthPrecision {
    /// Depth beyond the allowed penetration that is ignored.
    pub(crate) ignored: f64,
    /// Depth beyond the allowed penetration from which on points are recorded, without more precision.
    pub(crate) deep: f64,
    /// Depth is computed to a tenth, and no less precisely than this.
    pub(crate) margin: f64,
    /// Pieces of a smaller radius are not split.
    pub(crate) finest: f64,
    /// The same after something deep was found.
    pub(crate) coarse: f64,
}

/// How deep does a part get along a path past a standing one?
pub(crate) struct PathQuestion<'a> {
    pub(crate) pair_path: &'a PairPath<'a>,
    pub(crate) course: &'a Course,
    pub(crate) precision: DepthPrecision,
    pub(crate) termination: &'a Termination,
}

impl PathQuestion<'_> {
    /// How deep the moving part gets into the standing one, and the other way round.
    pub(crate) fn depth(&self) -> Result<[PathDepth; 2], Interrupt> {
        self.depth_within(PATH_EFFORT)
    }

    /// The same with no more than some effort on each surface.
    pub(crate) fn depth_within(&self, effort: usize) -> Result<[PathDepth; 2], Interrupt> {
        let [moving, standing] = self.pair_path.surfaces();
        let side = |on_moving| {
            let measured = if on_moving { standing } else { moving };
            let most_effort =
                if measured.rim().is_some() { effort.min(PATH_EFFORT_IN_DOUBT) } else { effort };
            self.depth_of_side(on_moving, Interval::WHOLE, most_effort)
        };
        let (one, other) = rayon::join(|| side(true), || side(false));
        Ok([one?, other?])
    }

    /// How deep the moving part gets into the standing one on a stretch of the path, or the other way round, with no
    /// more than some effort.
    pub(crate) fn depth_of_side(
        &self,
        on_moving: bool,
        interval: Interval,
        most_effort: usize,
    ) -> Result<PathDepth, Interrupt> {
        let Self { pair_path, course, precision, termination } = *self;
        let [moving, standing] = pair_path.shapes;
        let (looked_at, measured) = if on_moving { (moving, standing) } else { (standing, moving) };
        if !measured.surface.has_inside_for(&looked_at.surface) {
            return Ok(PathDepth::default());
        }
        let question = SideQuestion {
            covered: CoveredSurface { surface: &looked_at.surface, tree: looked_at.patches(termination)? },
            measured: &measured.surface,
            allowed: pair_path.allowed,
            precision,
        };
        let view = CourseView::new(course, on_moving, precision.finest / 16.0);
        question.answer(view, interval, most_effort, termination)
    }
}

/// How deep does one surface get into another?
pub(crate) struct SideQuestion<'a> {
    pub(crate) covered: CoveredSurface<'a>,
    /// The measured surface.
    pub(crate) measured: &'a Surface,
    /// The allowed penetration.
    pub(crate) allowed: f64,
    pub(crate) precision: DepthPrecision,
}

/// The depth along a path.
#[derive(Debug, Clone, Default)]
pub(crate) struct PathDepth {
    /// No point gets deeper than this beyond the allowed penetration.
    pub(crate) bound: f64,
    /// The largest depth beyond the allowed penetration that was measured.
    pub(crate) depth: f64,
    /// Points (in the covered surface's frame) that were measured deeper than [`DepthPrecision::deep`], or could not
    /// be bounded by less. A good path has none; of a bad one, these are the first that were found.
    pub(crate) deep: Vec<(Point3<f64>, f64)>,
    /// Stretches of the path on which the search gave up: the bound does not hold there.
    pub(crate) open: Vec<Interval>,
    /// The effort: pieces (more for each where signs depend on many edges of holes) and regions.
    pub(crate) effort: usize,
}

impl DepthPrecision {
    /// How precisely a depth is computed.
    fn margin_of(&self, depth: f64) -> f64 {
        (DEPTH_SHARE * depth).min(self.margin)
    }
}

impl PathDepth {
    /// Adds the depth of another stretch.
    pub(crate) fn add(&mut self, other: Self) {
        self.bound = self.bound.max(other.bound);
        self.depth = self.depth.max(other.depth);
        self.deep.extend(other.deep);
        self.open.extend(other.open);
        self.effort += other.effort;
    }

    /// Whether more deep points would not change the answer.
    pub(crate) fn is_enough(&self) -> bool {
        self.deep.len() >= DEEP_POINTS
    }
}

/// Where the search for a piece starts: a triangle near it, a region around it.
#[derive(Debug, Clone, Copy)]
struct SearchHint {
    triangle: u32,
    region: Option<u32>,
    /// Whether the piece was split because no region was found.
    is_vain: bool,
}

/// A ball that holds all that a piece sweeps.
#[derive(Debug, Clone, Copy)]
struct SweptBall {
    centre: Point3<f64>,
    radius: f64,
}

/// A grid cell: the binary logarithm of its size, and its indices.
type GridCell = (i32, [i64; 3]);

/// A region, and whether all of it is outside the measured surface; near holes a part of it may be inside.
struct KnownRegion {
    free: FreeRegion,
    is_outside: bool,
}

/// The state of a search: the question, the regions so far, the hull of the current piece, and the answer so far.
struct PathSearch<'a> {
    question: &'a SideQuestion<'a>,
    /// Whether the measured surface has holes, so that the depth changes its sign away from the surface, too.
    has_rim: bool,
    most_effort: usize,
    /// The effort of a piece.
    price: usize,
    /// The share of surface and time that is bounded.
    done: f64,
    view: CourseView<'a>,
    poll: Poll<'a>,
    regions: Vec<KnownRegion>,
    /// Regions in the order in which they held a piece.
    held: Vec<u32>,
    /// The same by the places of the pieces.
    places: HashMap<GridCell, Vec<u32>>,
    /// The corners of the current hull, or those that reach furthest.
    wanted: Vec<Point3<f64>>,
    /// All of its corners, unless they are too many.
    hull: Vec<Point3<f64>>,
    facing: Vector3<f64>,
    found: PathDepth,
    /// The effort after which the first deep point was found.
    first_deep: Option<usize>,
}

impl<'a> PathSearch<'a> {
    fn new(
        question: &'a SideQuestion<'a>,
        view: CourseView<'a>,
        most_effort: usize,
        termination: &'a Termination,
    ) -> Self {
        let rim = question.measured.rim();
        Self {
            question,
            has_rim: rim.is_some(),
            most_effort,
            price: 1 + rim.map_or(0, |rim| rim.edges().len() / RIM_EDGES_PER_EFFORT),
            done: 0.0,
            view,
            poll: Poll::every(LONG_STEPS_PER_POLL, Some(termination)),
            regions: Vec::new(),
            held: Vec::new(),
            places: HashMap::new(),
            wanted: Vec::new(),
            hull: Vec::new(),
            facing: Vector3::zeros(),
            found: PathDepth::default(),
            first_deep: None,
        }
    }
}

impl SideQuestion<'_> {
    /// The depth on a stretch of the path, with no more than some effort.
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
