//! Actions: unit forces, torques, and forces with torques about the same axis.

use nalgebra::{Unit, Vector3};

use crate::tolerances::AXIS_SNAP;

/// An axis through space, of the world or of the geometry.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Axis(Unit<Vector3<f64>>);

impl Axis {
    /// The x axis.
    pub const X: Self = Self(Unit::new_unchecked(Vector3::new(1.0, 0.0, 0.0)));
    /// The y axis.
    pub const Y: Self = Self(Unit::new_unchecked(Vector3::new(0.0, 1.0, 0.0)));
    /// The z axis.
    pub const Z: Self = Self(Unit::new_unchecked(Vector3::new(0.0, 0.0, 1.0)));
    /// The paper's axes.
    pub const WORLD: [Self; 3] = [Self::X, Self::Y, Self::Z];

    /// The axis along a direction; exactly that of the world, and its sense, if it is as good as
    /// that.
    #[must_use]
    pub fn along(direction: Unit<Vector3<f64>>) -> Self {
        let alike = |a: &Self| a.0.dot(&direction).abs() > 1.0 - AXIS_SNAP;
        Self::WORLD.into_iter().find(alike).unwrap_or(Self(direction))
    }

    /// Its positive direction.
    #[must_use]
    pub fn unit(self) -> Unit<Vector3<f64>> {
        self.0
    }
}

impl std::fmt::Display for Axis {
    /// `x`, `y`, `z`, or the direction as `[0.31,0.00,0.95]`.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match Self::WORLD.iter().position(|a| a == self) {
            Some(i) => f.write_str(["x", "y", "z"][i]),
            None => write!(f, "[{:.2},{:.2},{:.2}]", self.0.x, self.0.y, self.0.z),
        }
    }
}

/// What is done to a part. A positive sign means along (or counter-clockwise about) the axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Action {
    /// A force; the part does not turn.
    Push(Axis, bool),
    /// A force; contact may turn the part.
    Drag(Axis, bool),
    /// A torque about the centre of mass.
    Turn(Axis, bool),
    /// A force (first sign) and a torque (second sign) along and about one axis.
    Screw(Axis, bool, bool),
}

impl Action {
    /// The paper's six translations.
    #[must_use]
    pub fn translations() -> Vec<Self> {
        Self::translations_along(&Axis::WORLD)
    }

    /// The translations along some axes, both ways each.
    #[must_use]
    pub fn translations_along(axes: &[Axis]) -> Vec<Self> {
        axes.iter().flat_map(|&a| [Self::Push(a, true), Self::Push(a, false)]).collect()
    }

    /// The torques about some axes, then the forces along them, both ways each.
    #[must_use]
    pub fn rotations_about(axes: &[Axis]) -> Vec<Self> {
        let turns = axes.iter().flat_map(|&a| [Self::Turn(a, true), Self::Turn(a, false)]);
        let drags = axes.iter().flat_map(|&a| [Self::Drag(a, true), Self::Drag(a, false)]);
        turns.chain(drags).collect()
    }

    /// The wrenches that pull along some axes while turning about them, all four ways each: first those that
    /// follow a right-hand thread, as most are.
    #[must_use]
    pub fn screws_along(axes: &[Axis]) -> Vec<Self> {
        let signs = [(true, true), (false, false), (true, false), (false, true)];
        axes.iter().flat_map(|&a| signs.map(|(f, t)| Self::Screw(a, f, t))).collect()
    }

    /// Unit force (zero for a pure torque).
    #[must_use]
    pub fn force(self) -> Vector3<f64> {
        match self {
            Self::Push(a, f) | Self::Drag(a, f) | Self::Screw(a, f, _) => a.unit().into_inner() * sign(f),
            Self::Turn(..) => Vector3::zeros(),
        }
    }

    /// Unit torque (zero for a pure force).
    #[must_use]
    pub fn torque(self) -> Vector3<f64> {
        match self {
            Self::Turn(a, t) | Self::Screw(a, _, t) => a.unit().into_inner() * sign(t),
            Self::Push(..) | Self::Drag(..) => Vector3::zeros(),
        }
    }

    /// Whether it is of the same kind as another, with force and torque within an angle, given by its cos, of the
    /// other's.
    #[must_use]
    pub fn is_like(&self, other: &Self, cos: f64) -> bool {
        let alike = |a: Vector3<f64>, b: Vector3<f64>| a == b || a.dot(&b) > cos;
        std::mem::discriminant(self) == std::mem::discriminant(other)
            && alike(self.force(), other.force())
            && alike(self.torque(), other.torque())
    }

    /// Whether the part may turn.
    #[must_use]
    pub fn turns(self) -> bool {
        !matches!(self, Self::Push(..))
    }
}

fn sign(positive: bool) -> f64 {
    if positive { 1.0 } else { -1.0 }
}

impl std::fmt::Display for Action {
    /// `+x`, `+x~` (free to turn), `-rz`, `+z-rz`.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let s = |p: bool| if p { '+' } else { '-' };
        match *self {
            Self::Push(a, p) => write!(f, "{}{}", s(p), a),
            Self::Drag(a, p) => write!(f, "{}{}~", s(p), a),
            Self::Turn(a, p) => write!(f, "{}r{}", s(p), a),
            Self::Screw(a, p, t) => write!(f, "{}{}{}r{}", s(p), a, s(t), a),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_of_the_world_are_recognised() {
        let nearly = Unit::new_normalize(Vector3::new(1e-5, -1.0, 0.0));
        assert_eq!(Axis::along(nearly), Axis::Y);
        let slanted = Axis::along(Unit::new_normalize(Vector3::new(0.6, 0.0, -0.8)));
        assert_eq!(Action::Screw(slanted, true, false).to_string(), "+[0.60,0.00,-0.80]-r[0.60,0.00,-0.80]");
        assert_eq!(Action::Drag(slanted, false).force(), Vector3::new(-0.6, 0.0, 0.8));
    }

    #[test]
    fn likeness_is_of_kind_and_senses_however_the_axis_is_told() {
        let [axis, back] = [1.0, -1.0].map(|s| Axis(Unit::new_normalize(Vector3::new(0.6, 0.01, -0.8) * s)));
        let near = Axis(Unit::new_normalize(Vector3::new(0.6, 0.0, -0.8)));
        let screw = Action::Screw(axis, true, false);
        assert!(screw.is_like(&Action::Screw(back, false, true), 0.9999));
        assert!(screw.is_like(&Action::Screw(near, true, false), 0.9999));
        assert!(!screw.is_like(&Action::Screw(near, true, false), 0.999_99), "half a degree");
        assert!(!screw.is_like(&Action::Screw(axis, true, true), 0.9));
        assert!(!Action::Push(axis, true).is_like(&Action::Drag(axis, true), 0.9), "a drag may turn");
        assert!(Action::Push(axis, true).is_like(&Action::Push(back, false), 0.9));
    }

    #[test]
    fn actions_are_named_after_what_they_do() {
        let names = |a: Vec<Action>| a.iter().map(ToString::to_string).collect::<Vec<_>>();
        assert_eq!(names(Action::translations()), ["+x", "-x", "+y", "-y", "+z", "-z"]);
        assert_eq!(
            names(Action::rotations_about(&Axis::WORLD)),
            ["+rx", "-rx", "+ry", "-ry", "+rz", "-rz", "+x~", "-x~", "+y~", "-y~", "+z~", "-z~"]
        );
        let screws = names(Action::screws_along(&Axis::WORLD));
        assert_eq!((screws.len(), screws[9].as_str()), (12, "-z-rz"));
    }
}
