//! A search over the places of one part that needs no contact: the last resort for translations.
//!
//! Motions of the transition function end in contact. A part that has to stop half-way along a corridor, a slot or a
//! rail to leave sideways has nothing to stop it there. But what it may do from a place changes only at critical
//! places, where a [critical coordinate](critical_coordinates) of the part passes one of the others: between them, the
//! places make cells, and one place stands for each cell (exact cell decomposition: J.-C. Latombe, "Robot Motion
//! Planning", 1991, chapter 5). A critical place is a cell of its own where the part fits in without play: there several
//! critical coordinates fall together. So is one where the centres of round edges fall together: a round window is as
//! narrow as its play there.
//!
//! Cells are found from some poses of the part, those that the fewest short moves lead to first, and of these breadth
//! first: in a corridor with play, most cells differ by where in the play the part is, and few lead on. Along each axis
//! the part is cast as far as it goes in both senses, and the cells that it passes are new ones. For solids whose faces
//! are along and across the axes this finds every way by translations along the axes; for others it finds windows whose
//! rims have their extreme points inside the cells. Rotations stay as the starts have them: those of states, or those of
//! [turns in place](super::critical_turns).

use std::cmp::Reverse;
use std::collections::binary_heap::PeekMut;
use std::collections::{BTreeSet, BinaryHeap, HashSet};

use nalgebra::{Translation3, UnitQuaternion};
use rayon::prelude::*;

use crate::geometry::Pose;
use crate::scene::{Scene, StandingParts};
use crate::simulation::{Action, Axis, FreeTravel, SweepQuestion, free_travel};
use crate::termination::{Interrupt, Termination};
use crate::tolerances::{ROUNDED, SAME_CELL, SHORT_MOVE};

use super::critical_places::{AxisCoordinates, CriticalCoordinates, stops};

/// Cells whose neighbours are searched in parallel, enough for 64 threads. An exit ends the search only after its batch:
/// half of it idles threads, double casts more in vain.
const CELLS_AT_ONCE: usize = 64;

/// A place of the part that stands for a cell.
#[derive(Clone, Copy)]
struct Cell {
    pose: Pose,
    /// From where it was reached; none for a start.
    parent: Option<usize>,
    /// The number of the start that it was reached from.
    start: usize,
    /// The axis along which it was reached, and along which it has no new neighbours.
    axis: Option<usize>,
    /// The index of its rotation.
    rotation: usize,
    /// The number of short moves on the way to it.
    short_moves: u32,
}

/// A place from which the part leaves along a line.
pub(super) struct CellExit {
    /// The number of the start from which the way begins, as it was given.
    pub(super) start: usize,
    /// The poses from there to the place.
    pub(super) way: Vec<Pose>,
    /// The push with which the part leaves.
    pub(super) action: Action,
}

/// The search of one part.
pub(super) struct CellDecomposition<'a> {
    scene: &'a Scene,
    standing: &'a StandingParts,
    part: usize,
    /// The axes along which the part is moved, in both senses.
    axes: Vec<Axis>,
    coordinates: &'a mut CriticalCoordinates,
    /// Per axis: the coordinates of the standing parts; none until they are needed.
    still: Vec<Option<AxisCoordinates>>,
    /// The rotations of the starts.
    rotations: Vec<Rotation>,
    cells: Vec<Cell>,
    known: HashSet<(usize, [i64; 3])>,
    /// The cells whose neighbours are not known, by their short moves and number.
    open: BinaryHeap<Reverse<(u32, usize)>>,
    /// Moves below this length are short.
    short: f64,
    exits: Vec<CellExit>,
    /// The parts that stopped a cast.
    met: BTreeSet<usize>,
    /// The number of edges that were cast, and how many may be.
    edges: usize,
    most_edges: usize,
}

/// A rotation of the part.
struct Rotation {
    rotation: UnitQuaternion<f64>,
    /// Per axis: the part's coordinates without translation; none until they are needed.
    mine: Vec<Option<AxisCoordinates>>,
}

impl<'a> CellDecomposition<'a> {
    /// The search from some poses of a part, each with a number.
    pub(super) fn new(
        scene: &'a Scene,
        standing: &'a StandingParts,
        part: usize,
        axes: &[Axis],
        coordinates: &'a mut CriticalCoordinates,
        most_edges: usize,
        starts: impl IntoIterator<Item = (usize, Pose)>,
    ) -> Self {
        let mut search = Self {
            scene,
            standing,
            part,
            axes: axes.to_vec(),
            coordinates,
            still: vec![None; axes.len()],
            rotations: Vec::new(),
            cells: Vec::new(),
            known: HashSet::new(),
            open: BinaryHeap::new(),
            short: SHORT_MOVE * scene.bodies[part].shape.bounds().extents().min(),
            exits: Vec::new(),
            met: BTreeSet::new(),
            edges: 0,
            most_edges,
        };
        for (start, pose) in starts {
            let rotation = search.rotation(&pose);
            search.add(Cell { pose, parent: None, start, axis: None, rotation, short_moves: 0 });
        }
        search
    }

    /// The next place from which the part leaves along a line; `None` if there is no further cell, or the budget of
    /// edges is used up.
    ///
    /// # Errors
    /// The termination condition became true.
    pub(super) fn next_exit(&mut self, termination: &Termination) -> Result<Option<CellExit>, Interrupt> {
        while self.exits.is_empty() && self.edges < self.most_edges {
            let batch = self.next_batch();
            if batch.is_empty() {
                break;
            }
            let casts: Vec<_> = batch
                .par_iter()
                .map(|&cell| self.casts(&self.cells[cell], termination))
                .collect::<Result<_, Interrupt>>()?;
            for (cell, casts) in batch.into_iter().zip(casts) {
                casts.into_iter().for_each(|cast| self.pass(cell, &cast));
            }
            self.exits.reverse();
        }
        Ok(self.exits.pop())
    }

    /// The next cells, all with as many short moves.
    fn next_batch(&mut self) -> Vec<usize> {
        let mut batch = Vec::new();
        let fewest = self.open.peek().map(|Reverse((short_moves, _))| *short_moves);
        while batch.len() < CELLS_AT_ONCE
            && let Some(next) = self.open.peek_mut()
            && Some(next.0.0) == fewest
        {
            batch.push(PeekMut::pop(next).0.1);
        }
        batch
    }

    /// The number of cells that were reached, and the parts that stopped a cast.
    pub(super) fn ended(self) -> (usize, BTreeSet<usize>) {
        (self.cells.len(), self.met)
    }

    /// How far the part goes from a cell along each axis that may lead to new cells, in both senses.
    fn casts(&self, cell: &Cell, termination: &Termination) -> Result<Vec<AxisCast>, Interrupt> {
        let axes = (0..self.axes.len()).filter(|axis| cell.axis != Some(*axis));
        axes.flat_map(|axis| [true, false].map(|forward| (axis, forward)))
            .map(|(axis, forward)| {
                let direction = Action::Push(self.axes[axis], forward).force();
                let question = SweepQuestion {
                    scene: self.scene,
                    standing_parts: self.standing,
                    part: self.part,
                    start: &cell.pose,
                    direction: &direction,
                };
                Ok(AxisCast { axis, forward, free: free_travel(&question, termination)? })
            })
            .collect()
    }

    /// Adds the cells that a cast passes, or the exit that it leads to.
    fn pass(&mut self, from: usize, cast: &AxisCast) {
        let AxisCast { axis, forward, free: FreeTravel { length, met, edges } } = *cast;
        self.edges += edges;
        let Cell { pose, start, rotation, short_moves, .. } = self.cells[from];
        let Some(met) = met else {
            let action = Action::Push(self.axes[axis], forward);
            self.exits.push(CellExit { start, way: self.way_to(from), action });
            return;
        };
        self.met.insert(met);
        if length < ROUNDED {
            return;
        }
        let direction = self.axes[axis].unit().into_inner();
        let here = direction.dot(&pose.translation.vector);
        let [low, high] = if forward { [here, here + length] } else { [here - length, here] };
        let Self { scene, standing, part, ref axes, .. } = *self;
        let numbered = (axis, axes[axis]);
        let still = self.still[axis]
            .get_or_insert_with(|| self.coordinates.of_all(scene, &standing.standing, numbered));
        let Rotation { rotation: turned, mine } = &mut self.rotations[rotation];
        let turned = Pose::from_parts(Translation3::identity(), *turned);
        let mine = mine[axis].get_or_insert_with(|| self.coordinates.of(scene, part, &turned, numbered.1));
        let [critical, centred] = still.places(mine, [low, high]);
        for place in stops(&critical, &centred, [low, high]) {
            let pose = Translation3::from(direction * (place - here)) * pose;
            let short_moves = short_moves + u32::from((place - here).abs() < self.short);
            self.add(Cell { pose, parent: Some(from), start, axis: Some(axis), rotation, short_moves });
        }
    }

    /// Adds a cell unless it is known.
    fn add(&mut self, cell: Cell) {
        let at = cell.pose.translation.vector / SAME_CELL;
        if self.known.insert((cell.rotation, at.map(|x| x.round() as i64).into())) {
            self.open.push(Reverse((cell.short_moves, self.cells.len())));
            self.cells.push(cell);
        }
    }

    /// The index of a pose's rotation.
    fn rotation(&mut self, pose: &Pose) -> usize {
        let known = self.rotations.iter().position(|r| r.rotation.angle_to(&pose.rotation) < ROUNDED);
        known.unwrap_or_else(|| {
            self.rotations.push(Rotation { rotation: pose.rotation, mine: vec![None; self.axes.len()] });
            self.rotations.len() - 1
        })
    }

    fn way_to(&self, cell: usize) -> Vec<Pose> {
        let mut way = vec![self.cells[cell].pose];
        let mut at = cell;
        while let Some(parent) = self.cells[at].parent {
            way.push(self.cells[parent].pose);
            at = parent;
        }
        way.reverse();
        way
    }
}

/// How far the part goes along an axis.
struct AxisCast {
    axis: usize,
    /// Whether it goes along the axis, and not against it.
    forward: bool,
    free: FreeTravel,
}
