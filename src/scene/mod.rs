//! The scene: bodies at their assembled poses, how deep each pair may overlap, and what follows from where they stand.
//!
//! - [`BroadPhase`]: which bodies' boxes meet a box (parry's bounding-volume hierarchy);
//! - [`CongruentPair`]: two bodies up to a motion of both, so that equal pairs are asked about once;
//! - [`HullTree`]: the convex hull of all bodies that stand, kept up while they leave one by one;
//! - `PartMetric`: distances between poses of a part, and straight ways;
//! - [`exit_direction`]: hull separation, the paper's test for a part that is disassembled.
//!
//! Everything is in the planning frame. The scene knows nothing of contact, simulation and search; what these derive
//! from a scene, they keep in its [`Memo`].

mod broad_phase;
mod congruent_pairs;
mod hull_separation;
mod hull_tree;
mod joined_hulls;
mod memo;
mod own_scale;
mod part_metric;
mod records;

use std::collections::HashMap;
use std::sync::{Arc, OnceLock};

use nalgebra::Point3;

use crate::geometry::{Assembly, Bounds, Closest, Part, Pose, SampleTree, Shape, transformed};
use crate::sdf::Field;
use crate::termination::{Interrupt, Termination};

pub use broad_phase::BroadPhase;
pub use congruent_pairs::{CongruentPair, grouped, rounded, rounded_pose};
pub use hull_separation::{StandingParts, exit_direction};
pub use hull_tree::HullTree;
pub use joined_hulls::{HullStore, JoinedHulls};
pub use memo::Memo;
pub(crate) use own_scale::OwnScale;
pub use own_scale::ScaledShapes;
pub(crate) use part_metric::PartMetric;
pub(crate) use records::{HULL, add_pair, add_samples, add_standing};

/// A part at a pose of its own, wherever it stands in the scene.
#[derive(Debug, Clone, Copy)]
pub struct PosedPart<'a> {
    /// The index of the part.
    pub part: usize,
    /// Maps its shape's frame to the planning frame.
    pub pose: &'a Pose,
}

impl<'a> PosedPart<'a> {
    /// A part at a pose.
    #[must_use]
    pub fn new(part: usize, pose: &'a Pose) -> Self {
        Self { part, pose }
    }
}

/// A part with its field, at its place.
#[derive(Debug, Clone)]
pub struct Body {
    /// The mesh and what derives from it.
    pub shape: Arc<Shape>,
    /// Its distance field.
    pub field: Arc<Field>,
    /// Where it stands.
    pub planning_from_shape: Pose,
    /// Its box there.
    pub bounds: Bounds,
    /// Further points to look for contact at, where verification found some missing.
    pub extra_samples: SampleTree,
    /// The bodies that it stands for where these move as one, ascending; empty for a part.
    pub members: Vec<usize>,
}

impl Body {
    /// The closest surface point to `p` (shape frame) and the signed distance, if nearer than
    /// `reach` or inside. Exact: the field only proposes where to look first.
    #[must_use]
    pub fn closest(&self, p: &Point3<f64>, reach: f64) -> Option<(Closest, f64)> {
        let surface = &self.shape.surface;
        let closest = match self.field.likely_nearest(p) {
            Some(guess) => surface.closest_from(p, guess),
            None => {
                let estimate = self.field.estimate(p);
                if estimate.lower_bound > reach {
                    return None;
                }
                surface.closest(p, if estimate.value < 0.0 { f64::INFINITY } else { reach })?
            }
        };
        Some((closest, surface.signed(p, &closest)))
    }

    /// The same however far, without the field, given any triangle that is likely to be near.
    #[must_use]
    pub fn closest_from(&self, p: &Point3<f64>, guess: u32) -> (Closest, f64) {
        let closest = self.shape.surface.closest_from(p, guess);
        (closest, self.shape.surface.signed(p, &closest))
    }
}

/// For each pair, how deep the two overlap at the assembled pose: that much is allowed.
#[derive(Debug, Clone, Default)]
pub struct AllowedPenetrations {
    /// By the smaller part, then the larger; pairs without an entry may not overlap.
    depth: Arc<HashMap<(usize, usize), f64>>,
}

impl AllowedPenetrations {
    /// No overlap anywhere.
    #[must_use]
    pub fn none() -> Self {
        Self::default()
    }

    /// The depth allowed to a pair.
    #[must_use]
    pub fn of(&self, a: usize, b: usize) -> f64 {
        self.depth.get(&(a.min(b), a.max(b))).copied().unwrap_or(0.0)
    }

    /// Grants a pair some depth.
    pub fn allow(&mut self, a: usize, b: usize, depth: f64) {
        Arc::make_mut(&mut self.depth).insert((a.min(b), a.max(b)), depth);
    }
}

/// All bodies at their assembled poses. Quickly copied: what is in it is shared until it is changed.
#[derive(Debug, Clone)]
pub struct Scene {
    /// One per part, in the assembly's order.
    pub bodies: Arc<Vec<Body>>,
    /// The allowed penetrations of all pairs.
    pub allowed: AllowedPenetrations,
    /// Longest side of the whole, the unit of resolutions: rounded down, so that most edits leave it and
    /// all that was found out with it.
    pub longest_side: f64,
    /// The tree of their boxes.
    pub broad_phase: Arc<BroadPhase>,
    /// What other modules derive from the scene.
    pub memo: Memo,
    /// Hulls joined so far, also in other scenes.
    pub hulls: Arc<JoinedHulls>,
    /// The hull tree of all bodies, once it was needed.
    pub(crate) whole: Arc<OnceLock<HullTree>>,
}

impl Scene {
    /// An assembly with the fields of its shapes, no penetration allowed.
    #[must_use]
    pub fn assembled(assembly: &Assembly, fields: &[Arc<Field>]) -> Self {
        let body = |part: &Part| Body {
            shape: Arc::clone(&assembly.shapes[part.shape]),
            field: Arc::clone(&fields[part.shape]),
            planning_from_shape: part.planning_from_shape,
            bounds: part.bounds,
            extra_samples: SampleTree::default(),
            members: Vec::new(),
        };
        Self::of(assembly.parts.iter().map(body).collect(), resolution(assembly))
    }

    /// Some bodies, no penetration allowed, and the resolution of a scene with a longest side.
    #[must_use]
    pub(crate) fn of(bodies: Vec<Body>, longest_side: f64) -> Self {
        let boxes: Vec<Bounds> = bodies.iter().map(|b| b.bounds).collect();
        Self {
            bodies: Arc::new(bodies),
            allowed: AllowedPenetrations::none(),
            longest_side,
            broad_phase: Arc::new(BroadPhase::new(&boxes)),
            memo: Memo::default(),
            hulls: Arc::default(),
            whole: Arc::default(),
        }
    }

    /// The scene with one more body, the last: some parts as one rigid body. The parts are still there. The body may
    /// overlap another part as deep as any of its parts may.
    ///
    /// # Errors
    /// The termination condition became true.
    pub(crate) fn with_joined(&self, parts: &[usize], termination: &Termination) -> Result<Self, Interrupt> {
        let placed = parts.iter().map(|&part| {
            let Body { shape, planning_from_shape, .. } = &self.bodies[part];
            (&**shape, planning_from_shape)
        });
        let (shape, planning_from_shape) = Shape::joined(&placed.collect::<Vec<_>>(), termination)?;
        let mut bodies = self.bodies.to_vec();
        let joined = bodies.len();
        bodies.push(Body {
            field: Arc::new(Field::of(&shape.surface)),
            shape: Arc::new(shape),
            planning_from_shape,
            bounds: parts.iter().fold(Bounds::EMPTY, |all, &part| all.union(&self.bodies[part].bounds)),
            extra_samples: SampleTree::default(),
            members: parts.to_vec(),
        });
        let mut scene = Self::of(bodies, self.longest_side);
        (scene.hulls, scene.allowed) = (Arc::clone(&self.hulls), self.allowed.clone());
        for other in 0..joined {
            let most = parts.iter().map(|&part| self.allowed.of(part, other)).fold(0.0, f64::max);
            if most > 0.0 {
                scene.allowed.allow(joined, other, most);
            }
        }
        Ok(scene)
    }

    /// The scene with some parts at other poses of their shapes.
    pub(crate) fn with_placed(&self, places: &[(usize, Pose)]) -> Self {
        if places.is_empty() {
            return self.clone();
        }
        let mut bodies = self.bodies.to_vec();
        for (part, pose) in places {
            let Body { shape, planning_from_shape, bounds, .. } = &mut bodies[*part];
            *planning_from_shape = *pose;
            *bounds = Bounds::of(&transformed(&shape.hull, pose));
        }
        let mut scene = Self::of(bodies, self.longest_side);
        (scene.hulls, scene.allowed) = (Arc::clone(&self.hulls), self.allowed.clone());
        scene
    }

    /// The parts that a body stands for.
    pub(crate) fn members<'s>(&'s self, body: &'s usize) -> &'s [usize] {
        let members = &self.bodies[*body].members;
        if members.is_empty() { std::slice::from_ref(body) } else { members }
    }

    /// The middle of a part's box at the assembled pose, in its shape's frame: the point that moves
    /// on a line between the waypoints of a plan.
    #[must_use]
    pub fn centre_in_shape(&self, part: usize) -> Point3<f64> {
        let body = &self.bodies[part];
        body.planning_from_shape.inverse_transform_point(&body.bounds.centre())
    }

    /// How far a part reaches from that point.
    #[must_use]
    pub fn reach(&self, part: usize) -> f64 {
        let centre = self.centre_in_shape(part);
        let hull = &self.bodies[part].shape.hull;
        hull.iter().map(|p| (p - centre).norm_squared()).fold(0.0, f64::max).sqrt()
    }

    /// A box that holds a part all along a path (poses of its shape): where it turns, a ball about that
    /// point.
    #[must_use]
    pub fn swept_bounds(&self, part: usize, path: &[Pose]) -> Bounds {
        let (shape, centre) = (&self.bodies[part].shape, self.centre_in_shape(part));
        let turns = path.iter().any(|p| p.rotation != path[0].rotation);
        let radius = if turns { self.reach(part) } else { 0.0 };
        let held = path.iter().map(|pose| {
            if turns {
                Bounds::of([&(pose * centre)]).grown(radius)
            } else {
                shape.bounds().transformed(pose)
            }
        });
        held.fold(Bounds::EMPTY, |all, b| all.union(&b))
    }
}

/// The longest side of an assembly, rounded down by less than a sixteenth.
#[must_use]
pub fn resolution(assembly: &Assembly) -> f64 {
    rounded_down(assembly.longest_side())
}

/// The longest side of a scene, rounded down by less than a sixteenth.
pub(crate) fn rounded_down(longest: f64) -> f64 {
    let step = longest.log2().floor().exp2() / 16.0;
    (longest / step).floor() * step
}
