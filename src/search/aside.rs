//! Parts moved aside: where nothing leaves any more, some are moved and stay there, and others leave.
//!
//! The moves that the search of places proposes are verified one by one, each among all others as they stand then. Moves
//! of the same parts in a row are one path. The search for what remains then begins anew, in a scene in which the parts
//! stand where they were moved to.

use nalgebra::Vector3;

use crate::budgets::PLACES_VERIFIED;
use crate::plan::PlanStatus;
use crate::termination::Interrupt;

use super::contraction::Contraction;
use super::directions::axes_of;
use super::outcome::{Outcome, Removal};
use super::problem::{Observer, Problem, VerifiedPath};
use super::rearrangement::{PlaceSearch, Rearrangement};
use super::request::{ActionSet, Planner};
use super::requirements::{Leaving, places_after};
use super::trace::TraceEvent;

/// The question about what remains after an outcome that is not complete, with some parts moved aside and others out;
/// none where no moves are found after which any leaves.
///
/// # Errors
/// The termination condition became true.
pub(super) fn moved_aside<'a>(
    planner: Planner,
    problem: &Problem<'a>,
    outcome: &Outcome,
    observer: &mut dyn Observer,
) -> Result<Option<Problem<'a>>, Interrupt> {
    let is_over = matches!(outcome.status, PlanStatus::Exhausted | PlanStatus::Infeasible);
    let is_extended = planner == Planner::SbdpStar && problem.actions == ActionSet::Extended;
    // Of two parts, one moves aside only to leave.
    if !is_over || !is_extended || !problem.groups || outcome.remaining.len() < 3 {
        return Ok(None);
    }
    let scene = problem.scene.with_placed(&places_after(&problem.scene, &outcome.removals));
    let base = outcome.base.as_ref().map(|base| base.part);
    let spent = problem.spent + outcome.counters.simulations;
    let (present, earlier) = (outcome.remaining.clone(), outcome.removals.clone());
    let here =
        Problem { scene, present, base, releases_base: true, spent, earlier, ..problem.clone() };
    let mut search =
        PlaceSearch::new(&here, &here.present, axes_of(&here.scene, &here.present, &here.termination)?);
    let mut next = None;
    for _ in 0..PLACES_VERIFIED {
        let Some(found) = search.next_exit()? else { break };
        next = verified(&here, &found)?;
        if next.is_some() {
            break;
        }
    }
    let (places, leaves) = (search.searched(), next.is_some());
    tracing::debug!(places, leaves, "places of all parts searched");
    if observer.traces() {
        observer.traced(TraceEvent::PlacesSearched { places, leaves });
    }
    let Some(next) = next else { return Ok(None) };
    for (i, removal) in next.earlier.iter().enumerate().skip(here.earlier.len()) {
        observer.removal(removal);
        if observer.traces() {
            observer.traced(removal.event(&next.earlier[..i]));
        }
    }
    Ok(Some(Problem { releases_base: false, ..next }))
}

/// Some moves one after the other, if all of them are verified.
fn verified<'a>(problem: &Problem<'a>, found: &Rearrangement) -> Result<Option<Problem<'a>>, Interrupt> {
    let mut here = problem.clone();
    for Moves { parts, legs, is_last } in moves(found) {
        let contraction = Contraction::new(&here, &here.present, &parts)?;
        let way = if is_last {
            contraction.way_out(&legs, &found.action)?
        } else {
            contraction.way(&legs)?
        };
        let Some(VerifiedPath { path, depth }) = way else { return Ok(None) };
        let leaving = Leaving { aside: !is_last, ..contraction.leaving() };
        let removal = leaving.removal(&here.earlier, path, depth)?;
        let mut earlier = here.earlier.clone();
        if is_last {
            here.present.retain(|part| !removal.parts.contains(part));
        } else {
            here.scene = moved(&here, &removal);
        }
        earlier.push(removal);
        here.earlier = earlier;
    }
    Ok(Some(here))
}

/// The scene with the parts of a move at its end.
fn moved(problem: &Problem<'_>, removal: &Removal) -> crate::scene::Scene {
    let motion = removal.motion();
    let place = |&part: &usize| (part, motion * problem.scene.bodies[part].planning_from_shape);
    problem.scene.with_placed(&removal.parts.iter().map(place).collect::<Vec<_>>())
}

/// Moves of the same parts in a row.
struct Moves {
    parts: Vec<usize>,
    legs: Vec<Vector3<f64>>,
    /// Whether they leave then.
    is_last: bool,
}

fn moves(found: &Rearrangement) -> Vec<Moves> {
    let mut moves: Vec<Moves> = Vec::new();
    for shift in &found.shifts {
        match moves.last_mut().filter(|last| last.parts == shift.parts) {
            Some(last) => last.legs.push(shift.along),
            None => {
                moves.push(Moves { parts: shift.parts.clone(), legs: vec![shift.along], is_last: false });
            }
        }
    }
    match moves.last_mut().filter(|last| last.parts == found.leaving) {
        Some(last) => last.is_last = true,
        None => moves.push(Moves { parts: found.leaving.clone(), legs: Vec::new(), is_last: true }),
    }
    moves
}
