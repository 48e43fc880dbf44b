//! Actions: unit forces, torques, and forces with torques about the same axis.

use nalgebra::{Unit, Vector3};

/// A world axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Axis {
    /// The x axis.
    X,
    /// The y axis.
    Y,
    /// The z axis.
    Z,
}

impl Axis {
    const ALL: [Self; 3] = [Self::X, Self::Y, Self::Z];

    fn unit(self) -> Unit<Vector3<f64>> {
        match self {
            Self::X => Vector3::x_axis(),
            Self::Y => Vector3::y_axis(),
            Self::Z => Vector3::z_axis(),
        }
    }

    fn letter(self) -> char {
        match self {
            Self::X => 'x',
            Self::Y => 'y',
            Self::Z => 'z',
        }
    }
}

/// What is done to a part. A positive sign means along (or counter-clockwise about) the axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
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
        Axis::ALL.into_iter().flat_map(|a| [Self::Push(a, true), Self::Push(a, false)]).collect()
    }

    /// The paper's actions with rotational freedom: six torques, then six forces.
    #[must_use]
    pub fn rotations() -> Vec<Self> {
        let turns = Axis::ALL.into_iter().flat_map(|a| [Self::Turn(a, true), Self::Turn(a, false)]);
        let drags = Axis::ALL.into_iter().flat_map(|a| [Self::Drag(a, true), Self::Drag(a, false)]);
        turns.chain(drags).collect()
    }

    /// The twelve wrenches that pull while turning.
    #[must_use]
    pub fn screws() -> Vec<Self> {
        let signs = [(true, true), (true, false), (false, true), (false, false)];
        Axis::ALL.into_iter().flat_map(|a| signs.map(|(f, t)| Self::Screw(a, f, t))).collect()
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
            Self::Push(a, p) => write!(f, "{}{}", s(p), a.letter()),
            Self::Drag(a, p) => write!(f, "{}{}~", s(p), a.letter()),
            Self::Turn(a, p) => write!(f, "{}r{}", s(p), a.letter()),
            Self::Screw(a, p, t) => write!(f, "{}{}{}r{}", s(p), a.letter(), s(t), a.letter()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn actions_are_named_after_what_they_do() {
        let names = |a: Vec<Action>| a.iter().map(ToString::to_string).collect::<Vec<_>>();
        assert_eq!(names(Action::translations()), ["+x", "-x", "+y", "-y", "+z", "-z"]);
        assert_eq!(
            names(Action::rotations()),
            ["+rx", "-rx", "+ry", "-ry", "+rz", "-rz", "+x~", "-x~", "+y~", "-y~", "+z~", "-z~"]
        );
        let screws = names(Action::screws());
        assert_eq!((screws.len(), screws[9].as_str()), (12, "+z-rz"));
    }
}
