//! Screw threads: a ridge of trapezoidal section that winds around a cylinder and ends
//! bluntly. The ridge of a nut runs in the gap that the ridge of its bolt leaves, so neither
//! has to run out at an end face.

use std::f64::consts::TAU;

use super::solid::{Point, Solid};

/// Facets of a turn.
pub(super) const TURN: usize = 24;

/// A ridge on a cylinder around the z axis, right-handed, beginning at angle 0.
pub(super) struct Ridge {
    /// Radius of the cylinder.
    pub(super) base: f64,
    /// Radius of the ridge's flat top; less than `base` inside a bore.
    pub(super) crest: f64,
    /// Axial width of the ridge on the cylinder.
    pub(super) base_width: f64,
    /// Axial width of its top.
    pub(super) crest_width: f64,
    /// Rise per turn.
    pub(super) pitch: f64,
    /// Height of the middle of the ridge where it begins.
    pub(super) start: f64,
    /// Whole turns.
    pub(super) turns: usize,
}

impl Ridge {
    /// The corners of the section after `step` facets, from below.
    fn section(&self, step: usize) -> [Point; 4] {
        let angle = TAU * (step % TURN) as f64 / TURN as f64;
        let middle = self.start + self.pitch * step as f64 / TURN as f64;
        let point = |r: f64, dz: f64| [r * angle.cos(), r * angle.sin(), middle + dz];
        let (base, crest) = (self.base_width / 2.0, self.crest_width / 2.0);
        [point(self.base, -base), point(self.crest, -crest), point(self.crest, crest), point(self.base, base)]
    }

    /// The surface of the cylinder with its ridge from `low` to `high`, outside away from the
    /// axis. Open at both ends, in the outlines of `TURN` corners at angle 0.
    pub(super) fn surface(&self, low: f64, high: f64) -> Solid {
        let steps = self.turns * TURN;
        let row = |corner: usize, from: usize, to: usize| -> Vec<Point> {
            (from..=to).map(|s| self.section(s)[corner]).collect()
        };
        let mut solid = Solid::default();
        for corner in 0..3 {
            solid.strip(&row(corner, 0, steps), &row(corner + 1, 0, steps));
        }
        // Between the turns, from the top of one to the bottom of the next.
        solid.strip(&row(3, 0, steps - TURN), &row(0, TURN, steps));
        let [first, last] = [self.section(0), self.section(steps)];
        solid.face(&first, &[]);
        solid.face(&[last[3], last[2], last[1], last[0]], &[]);
        self.close_below(&mut solid, low);
        self.close_above(&mut solid, high);
        solid
    }

    /// The cylinder from `low` to the first turn. At angle 0 the blunt end of the ridge, the
    /// cylinder above it and the second turn begin: the facet before has their corners.
    fn close_below(&self, solid: &mut Solid, low: f64) {
        let foot = |s: usize| with_height(self.section(s)[0], low);
        let bottom: Vec<Point> = (0..TURN).map(foot).collect();
        let first: Vec<Point> = (0..TURN).map(|s| self.section(s)[0]).collect();
        solid.strip(&bottom, &first);
        let apex = self.section(TURN - 1)[0];
        let [start, .., end] = self.section(0);
        let up = [foot(TURN - 1), foot(0), start, end, self.section(TURN)[0]];
        fan(solid, apex, &up);
    }

    /// The cylinder from the last turn to `high`; the same upside down.
    fn close_above(&self, solid: &mut Solid, high: f64) {
        let steps = self.turns * TURN;
        let head = |s: usize| with_height(self.section(s)[3], high);
        let from = steps - TURN + 1;
        let last: Vec<Point> = (from..=steps).map(|s| self.section(s)[3]).collect();
        let top: Vec<Point> = (from..=steps).map(head).collect();
        solid.strip(&last, &top);
        let apex = self.section(from)[3];
        let [start, .., end] = self.section(steps);
        let down = [head(from), head(steps), end, start, self.section(steps - TURN)[3]];
        fan(solid, apex, &down);
    }
}

fn with_height(p: Point, z: f64) -> Point {
    [p[0], p[1], z]
}

fn fan(solid: &mut Solid, apex: Point, around: &[Point]) {
    for pair in around.windows(2) {
        solid.triangle([apex, pair[0], pair[1]]);
    }
}
