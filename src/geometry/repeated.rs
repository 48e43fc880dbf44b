//! Parts that are given twice: the same body in the same place under two names, and a whole beside its own bodies, as
//! exports from CAD have them.
//!
//! Such parts have surfaces that coincide, so neither has a surface inside the other, and neither can leave. The meshes
//! may differ, so solids are compared by signed distances, at points spread over one surface, just below these, and
//! deep inside.
//!
//! - A part *lies in* another if no point of its surface is outside the other, and what is just below its surface or
//!   deep inside it is inside the other, too. A peg in a hole has surface on the other's surface, but below that the
//!   other is not.
//! - Two parts are *copies* if each lies in the other, with all of its surface on the other's.
//! - A part is a *whole* if the parts that lie in it have its surface; or if one that lies in it has nearly all of its
//!   own surface on that of the whole, so that it is one of its bodies.
//!
//! Known misses: parts that were tessellated so coarsely that their copies differ by more than the tolerance, and
//! features that differ between the points.

use std::collections::HashSet;
use std::sync::{Arc, OnceLock};

use nalgebra::Point3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::inner_points::SurfacePoint;
use super::{Bounds, Pose, Shape, Surface};
use crate::budgets::{NAMED_BODIES, REPEATED_DEEP_POINTS, REPEATED_POINTS};
use crate::termination::{Interrupt, Termination};
use crate::tolerances::{
    BELOW_SURFACE, BODY_SURFACE, DEEP_SHARE, REPEATED_SIZE, REPEATED_WALL, ROUNDED, WHOLE_SURFACE,
};

/// Parts that are given twice. Parts are named by their places.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub enum Repetition {
    /// These, ascending, are the same body in the same place.
    Copies(Vec<usize>),
    /// A part that holds others as its own bodies.
    Whole {
        /// The part.
        part: usize,
        /// The others, ascending.
        bodies: Vec<usize>,
        /// Whether they make up all of it.
        is_all: bool,
    },
}

impl Repetition {
    /// The parts in it.
    pub fn parts(&self) -> impl Iterator<Item = usize> + '_ {
        let (part, others) = match self {
            Self::Copies(parts) => (None, parts),
            Self::Whole { part, bodies, .. } => (Some(*part), bodies),
        };
        part.into_iter().chain(others.iter().copied())
    }

    /// What is left of it without some parts, if anything is.
    #[must_use]
    pub fn without(&self, is_gone: impl Fn(usize) -> bool) -> Option<Self> {
        let rest = |parts: &[usize]| parts.iter().copied().filter(|p| !is_gone(*p)).collect::<Vec<_>>();
        match self {
            Self::Copies(parts) => Some(rest(parts)).filter(|rest| rest.len() > 1).map(Self::Copies),
            Self::Whole { part, .. } if is_gone(*part) => None,
            Self::Whole { part, bodies, is_all } => Some(rest(bodies))
                .filter(|rest| !rest.is_empty())
                .map(|bodies| Self::Whole { part: *part, bodies, is_all: *is_all }),
        }
    }

    /// What the user should know and do.
    #[must_use]
    pub fn message<'n>(&self, name: impl Fn(usize) -> &'n str) -> String {
        let names = |parts: &[usize]| listed(&parts.iter().map(|p| name(*p)).collect::<Vec<_>>());
        match self {
            Self::Copies(parts) => {
                let rest = parts.get(1..).unwrap_or_default();
                let mut options: Vec<_> =
                    rest.iter().take(NAMED_BODIES).map(|p| format!("--removed {}", name(*p))).collect();
                if rest.len() > NAMED_BODIES {
                    options.push("…".to_owned());
                }
                let which = if rest.len() == 1 { "one" } else { "all but one" };
                format!(
                    "{} are the same body in the same place: leave {which} of them out ({})",
                    names(parts),
                    options.join(" ")
                )
            }
            Self::Whole { part, bodies, is_all: true } => format!(
                "{whole} holds {}: it seems to be the whole assembly beside its bodies; leave it out (--removed {whole})",
                names(bodies),
                whole = name(*part)
            ),
            Self::Whole { part, bodies, is_all: false } => {
                let (whole, bodies) = (name(*part), names(bodies));
                format!("{whole} holds {bodies} with the same surface: leave out {whole} or what it holds")
            }
        }
    }
}

/// Names in a row, the first few of many.
fn listed(names: &[&str]) -> String {
    match names {
        [] => String::new(),
        [one] => (*one).to_owned(),
        [first @ .., last] if names.len() <= NAMED_BODIES => format!("{} and {last}", first.join(", ")),
        _ => {
            format!("{} and {} others", names[..NAMED_BODIES].join(", "), names.len() - NAMED_BODIES)
        }
    }
}

/// What is known of an assembly before a change.
pub(super) struct KnownRepetitions<'a> {
    /// Its parts that are given twice.
    pub(super) found: &'a [Repetition],
    /// The parts that the change is about. All others are not compared again.
    pub(super) changed: &'a HashSet<usize>,
}

impl KnownRepetitions<'_> {
    /// Whether two parts that did not change are copies.
    fn are_copies(&self, a: usize, b: usize) -> bool {
        let has_both = |r: &Repetition| match r {
            Repetition::Copies(parts) => parts.contains(&a) && parts.contains(&b),
            Repetition::Whole { .. } => false,
        };
        self.found.iter().any(has_both)
    }

    /// What a part holds, if neither it nor anything in it has changed.
    fn held_by(&self, whole: usize, inner: &[usize]) -> Option<Option<HeldBodies>> {
        let is_changed = |part: &usize| self.changed.contains(part);
        if is_changed(&whole) || inner.iter().any(is_changed) {
            return None;
        }
        let of_whole = |r: &&Repetition| matches!(r, Repetition::Whole { part, .. } if *part == whole);
        match self.found.iter().find(of_whole) {
            Some(Repetition::Whole { bodies, is_all, .. }) if !bodies.iter().any(is_changed) => {
                let parts = inner.iter().copied().filter(|part| bodies.contains(part)).collect();
                Some(Some(HeldBodies { parts, is_all: *is_all }))
            }
            Some(_) => None,
            None => Some(None),
        }
    }
}

/// What a part holds as its own bodies.
struct HeldBodies {
    parts: Vec<usize>,
    is_all: bool,
}

/// A part's shape, where that stands in the planning frame, and the part's box there.
pub(super) type PlacedShape = (usize, Pose, Bounds);

/// The parts of an assembly that are given twice, if something is known of it, without comparing all again.
///
/// # Errors
/// The termination condition became true.
pub(super) fn repetitions(
    places: impl Iterator<Item = PlacedShape>,
    shapes: &[Arc<Shape>],
    known: Option<&KnownRepetitions<'_>>,
    termination: &Termination,
) -> Result<Vec<Repetition>, Interrupt> {
    let solids: Vec<Solid<'_>> = shapes.iter().map(|shape| Solid::new(shape)).collect();
    let bodies: Vec<_> = places
        .map(|(shape, planning_from_shape, bounds)| BodyShape {
            solid: &solids[shape],
            planning_from_shape,
            bounds,
        })
        .collect();
    let nested = nested_boxes(&bodies);
    let copies = copies(&bodies, &nested, known, termination)?;
    // Of copies the first stands for all.
    let is_first = |part: usize| copies[part][0] == part;
    let whole = |whole: usize| -> Result<Option<HeldBodies>, Interrupt> {
        let inner: Vec<usize> = nested[whole].iter().copied().filter(|b| is_first(*b)).collect();
        if !is_first(whole) || inner.is_empty() {
            return Ok(None);
        }
        match known.and_then(|known| known.held_by(whole, &inner)) {
            Some(held) => Ok(held),
            None => held_by(&bodies, whole, &inner, termination),
        }
    };
    let wholes = (0..bodies.len()).into_par_iter().map(whole).collect::<Result<Vec<_>, _>>()?;
    let mut found: Vec<_> = (0..bodies.len())
        .filter(|p| is_first(*p) && copies[*p].len() > 1)
        .map(|p| Repetition::Copies(copies[p].clone()))
        .collect();
    for (part, whole) in wholes.into_iter().enumerate() {
        let Some(HeldBodies { parts, is_all }) = whole else { continue };
        let mut bodies: Vec<usize> = parts.iter().flat_map(|p| copies[*p].iter().copied()).collect();
        bodies.sort_unstable();
        let whole = |part: &usize| Repetition::Whole { part: *part, bodies: bodies.clone(), is_all };
        found.extend(copies[part].iter().map(whole));
    }
    Ok(found)
}

/// For each part the others, ascending, whose boxes are within its box.
fn nested_boxes(bodies: &[BodyShape<'_>]) -> Vec<Vec<usize>> {
    let all = bodies.iter().fold(Bounds::EMPTY, |all, body| all.union(&body.bounds));
    let axis = all.extents().imax();
    let mut sorted: Vec<usize> = (0..bodies.len()).collect();
    let begin = |part: usize| bodies[part].bounds.min[axis];
    sorted.sort_by(|&a, &b| begin(a).total_cmp(&begin(b)).then(a.cmp(&b)));
    let slack = bodies.iter().map(|body| body.solid.coarse_tolerance()).fold(0.0, f64::max);
    let within = |outer: usize| {
        let Bounds { min, max } = bodies[outer].bounds;
        let from = sorted.partition_point(|&b| begin(b) < min[axis] - slack);
        let beside = sorted[from..].iter().take_while(|&&b| begin(b) <= max[axis]);
        let is_within = |&&b: &&usize| {
            let (bounds, slack) = (bodies[b].bounds, bodies[b].solid.coarse_tolerance());
            let room = bodies[outer].bounds.grown(slack);
            b != outer && room.contains(&bounds.min) && room.contains(&bounds.max)
        };
        let mut inner: Vec<usize> = beside.filter(is_within).copied().collect();
        inner.sort_unstable();
        inner
    };
    (0..bodies.len()).map(within).collect()
}

/// For each part all that are the same body in the same place, ascending and itself among them. They are compared with
/// the first of each group only.
fn copies(
    bodies: &[BodyShape<'_>],
    nested: &[Vec<usize>],
    known: Option<&KnownRepetitions<'_>>,
    termination: &Termination,
) -> Result<Vec<Vec<usize>>, Interrupt> {
    let are_copies = |a: usize, b: usize| match known {
        Some(known) if !known.changed.contains(&a) && !known.changed.contains(&b) => {
            Ok(known.are_copies(a, b))
        }
        _ => are_copies(&bodies[a], &bodies[b], termination),
    };
    let mut first_of: Vec<usize> = Vec::with_capacity(bodies.len());
    for part in 0..bodies.len() {
        termination.check()?;
        let mut first = part;
        for &other in nested[part].iter().take_while(|other| **other < part) {
            let is_pair = first_of[other] == other && nested[other].binary_search(&part).is_ok();
            if is_pair && are_copies(other, part)? {
                first = other;
                break;
            }
        }
        first_of.push(first);
    }
    let mut members = vec![Vec::new(); bodies.len()];
    first_of.iter().enumerate().for_each(|(part, first)| members[*first].push(part));
    Ok(first_of.iter().map(|first| members[*first].clone()).collect())
}

fn are_copies(a: &BodyShape<'_>, b: &BodyShape<'_>, termination: &Termination) -> Result<bool, Interrupt> {
    if std::ptr::eq(a.solid, b.solid) {
        let tolerance = a.solid.tolerance();
        let moved = |p: &Point3<f64>| (a.planning_from_shape * p - b.planning_from_shape * p).norm();
        if a.solid.shape.hull.iter().all(|p| moved(p) <= tolerance) {
            return Ok(true);
        }
    }
    Ok(a.lies_in(b, termination)? == Some(1.0) && b.lies_in(a, termination)? == Some(1.0))
}

/// Those of the parts in `inner` that a part holds as its own bodies, if any.
fn held_by(
    bodies: &[BodyShape<'_>],
    whole: usize,
    inner: &[usize],
    termination: &Termination,
) -> Result<Option<HeldBodies>, Interrupt> {
    let mut lying = Vec::new();
    for &part in inner {
        termination.check()?;
        if let Some(surface) = bodies[part].lies_in(&bodies[whole], termination)? {
            lying.push((part, surface));
        }
    }
    if lying.len() > 1 {
        let parts: Vec<usize> = lying.iter().map(|(part, _)| *part).collect();
        if bodies[whole].is_surface_of(parts.iter().map(|part| &bodies[*part]), termination)? {
            return Ok(Some(HeldBodies { parts, is_all: true }));
        }
    }
    // A sheet that is drawn as a surface on another part has no inside of its own.
    let is_sheet = |part: usize| bodies[part].solid.surface().rim().is_some();
    lying.retain(|(part, surface)| *surface >= BODY_SURFACE && !is_sheet(*part));
    let parts: Vec<usize> = lying.into_iter().map(|(part, _)| part).collect();
    Ok((!parts.is_empty()).then_some(HeldBodies { parts, is_all: false }))
}

/// A shape, with what the comparison needs of it: derived once, and only where boxes are nested.
struct Solid<'a> {
    shape: &'a Shape,
    tolerance: OnceLock<f64>,
    points: OnceLock<Vec<SurfacePoint>>,
    /// Points deep inside, with their depths.
    deep: OnceLock<Vec<(Point3<f64>, f64)>>,
}

impl<'a> Solid<'a> {
    fn new(shape: &'a Shape) -> Self {
        Self { shape, tolerance: OnceLock::new(), points: OnceLock::new(), deep: OnceLock::new() }
    }

    fn surface(&self) -> &Surface {
        &self.shape.surface
    }

    /// No less than the tolerance, known at once.
    fn coarse_tolerance(&self) -> f64 {
        (REPEATED_SIZE * self.shape.bounds().extents().max()).max(ROUNDED)
    }

    /// How far the surface of a copy may be off.
    fn tolerance(&self) -> f64 {
        let derive = || {
            let wall = self.shape.mass.volume / self.surface().area();
            self.coarse_tolerance().min(REPEATED_WALL * wall).max(ROUNDED)
        };
        *self.tolerance.get_or_init(derive)
    }

    fn points(&self) -> &[SurfacePoint] {
        self.points.get_or_init(|| self.surface().spread_points(REPEATED_POINTS).collect())
    }

    fn deep(&self) -> &[(Point3<f64>, f64)] {
        let derive = || {
            let spread = self.surface().spread_points(REPEATED_DEEP_POINTS);
            let inner = spread.filter_map(|at| self.surface().inner_point(&at));
            let all = self.shape.inner_points().iter().copied().chain(inner);
            all.map(|p| (p, -self.surface().signed_distance(&p))).collect()
        };
        self.deep.get_or_init(derive)
    }
}

/// A solid at its place.
struct BodyShape<'a> {
    solid: &'a Solid<'a>,
    planning_from_shape: Pose,
    bounds: Bounds,
}

impl BodyShape<'_> {
    /// The share of the part's surface that is on the surface of another one in which it lies: 1 only if all of it is.
    /// `None` if it does not lie in that.
    fn lies_in(&self, other: &Self, termination: &Termination) -> Result<Option<f64>, Interrupt> {
        let into = other.planning_from_shape.inverse() * self.planning_from_shape;
        let (own, tolerance) = (self.solid.surface(), self.solid.tolerance());
        let in_other = |p: &Point3<f64>| other.solid.surface().signed_distance(&(into * p));
        let points = self.solid.points();
        let mut on_surface = 0;
        for (p, normal) in points {
            termination.check()?;
            let height = in_other(p);
            let below = p - normal * (BELOW_SURFACE * tolerance);
            if height > tolerance || in_other(&below) > own.signed_distance(&below) + tolerance {
                return Ok(None);
            }
            on_surface += usize::from(height >= -tolerance);
        }
        let mut is_all = on_surface == points.len();
        let vertices = own.vertices();
        for p in vertices.iter().step_by(vertices.len().div_ceil(REPEATED_POINTS).max(1)) {
            termination.check()?;
            let height = in_other(p);
            if height > tolerance {
                return Ok(None);
            }
            is_all &= height >= -tolerance;
        }
        for (p, depth) in self.solid.deep() {
            if in_other(p) > -DEEP_SHARE * depth {
                return Ok(None);
            }
        }
        let share = on_surface as f64 / points.len().max(1) as f64;
        // A single vertex off the surface is a difference.
        let share = if is_all { 1.0 } else { share.min(1.0 - f64::EPSILON) };
        Ok((!points.is_empty()).then_some(share))
    }

    /// Whether nearly all of the surface is on the surfaces of some parts that lie in this one, facing the same way.
    fn is_surface_of<'b>(
        &self,
        parts: impl Iterator<Item = &'b Self> + Clone,
        termination: &Termination,
    ) -> Result<bool, Interrupt>
    where
        Self: 'b,
    {
        let points = self.solid.points();
        let mut found = 0;
        for (p, normal) in points {
            termination.check()?;
            let (p, normal) = (self.planning_from_shape * p, self.planning_from_shape * normal);
            let has = |part: &Self| {
                let tolerance = part.solid.tolerance();
                let height = |p: &Point3<f64>| {
                    let own = part.planning_from_shape.inverse_transform_point(p);
                    part.solid.surface().signed_distance(&own)
                };
                part.bounds.grown(tolerance).contains(&p)
                    && height(&p).abs() <= tolerance
                    && height(&(p - normal * (BELOW_SURFACE * tolerance))) < 0.0
            };
            found += usize::from(parts.clone().any(has));
        }
        Ok(found as f64 >= WHOLE_SURFACE * points.len() as f64)
    }
}

#[cfg(test)]
mod tests;
