//! Parts moved aside: where nothing leaves any more, some are moved and stay there, and others leave.
//!
//! The moves that the search of places proposes are verified one by one, each among all others as they stand then. Moves
//! of the same parts in a row are one path. The search for what remains then begins anew, in a scene in which the parts
//! stand where they were moved to.

use std::time::Instant;

use nalgebra::Vector3;

use crate::budgets::PLACES_VERIFIED;
use crate::plan::PlanStatus;
use crate::termination::Interrupt;

use super::contraction::Contraction;
use super::directions::axes_of;
use super::outcome::Outcome;
use super::problem::{Observer, Problem, VerifiedPath};
use super::rearrangement::{PlaceSearch, Rearrangement};
use super::release::Release;
use super::request::{ActionSet, Planner};
use super::requirements::{Leaving, places_after};
use super::trace::TraceEvent;

/// The question about what remains after an outcome that is not complete, with some parts moved aside and others out;
/// none where no moves are found after which any leaves. The time that this takes is added to the outcome's.
///
/// # Errors
/// The termination condition became true.
pub(super) fn moved_aside<'a>(
    planner: Planner,
    problem: &Problem<'a>,
    outcome: &mut Outcome,
    observer: &mut dyn Observer,
) -> Result<Option<Problem<'a>>, Interrupt> {
    let is_over = matches!(outcome.status, PlanStatus::Exhausted | PlanStatus::Infeasible);
    let is_extended = planner == Planner::SbdpStar && problem.actions == ActionSet::Extended;
    // Of two parts, one moves aside only to leave.
    if !is_over || !is_extended || outcome.remaining.len() < 3 {
        return Ok(None);
    }
    let here = Problem { released: problem.last_release(), ..problem.after(outcome) };
    let mut search =
        PlaceSearch::new(&here, &here.present, axes_of(&here.scene, &here.present, &here.termination)?);
    let mut next = None;
    for _ in 0..PLACES_VERIFIED {
        let started = Instant::now();
        let found = search.next_exit()?;
        outcome.counters.simulation += started.elapsed();
        let Some(found) = found else { break };
        let started = Instant::now();
        next = verified(&here, &found)?;
        outcome.counters.verification += started.elapsed();
        here.termination.leave_out(started.elapsed());
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
            observer.traced(TraceEvent::of(removal, &next.earlier[..i]));
        }
    }
    Ok(Some(Problem { released: Release::Nothing, ..next }))
}

/// Some moves one after the other, if all of them are verified.
fn verified<'a>(problem: &Problem<'a>, found: &Rearrangement) -> Result<Option<Problem<'a>>, Interrupt> {
    let mut here = problem.clone();
    for Moves { parts, legs, is_last } in moves(found) {
        let contraction = Contraction::new(&here, &here.present, &parts)?;
        let way =
            if is_last { contraction.way_out(&legs, &found.action)? } else { contraction.way(&legs)? };
        let Some(VerifiedPath { path, depth }) = way else { return Ok(None) };
        let leaving = Leaving { aside: !is_last, ..contraction.leaving() };
        let removal = leaving.removal(&here.earlier, path, depth)?;
        here.scene = here.scene.with_placed(&places_after(&here.scene, std::slice::from_ref(&removal)));
        here.present.retain(|part| !is_last || !removal.parts.contains(part));
        here.earlier.push(removal);
    }
    Ok(Some(here))
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

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::super::tests::{Recorder, problem};
    use super::super::{TraceEvent, search};
    use super::*;
    use crate::fixtures::{cells, cuboid, moved as placed, scene};
    use crate::geometry::{Pose, SourceMesh};

    /// A box (part 0) with a closed channel along x, in which a slider (part 1) goes to and fro but does not leave. Under
    /// the slider, in a blind hole, is a pin (part 2), which leaves through a hole in the roof that is too narrow for the
    /// slider.
    fn covered_pin() -> Vec<SourceMesh> {
        let housing = cells(
            [&[0.0, 1.0, 1.4, 2.4, 7.0, 8.0], &[0.0, 1.0, 1.5, 2.5, 3.0, 4.0], &[0.0, 0.5, 1.0, 2.0, 3.0]],
            |[x, y, z]| {
                let is_channel = (1..=3).contains(&x) && (1..=3).contains(&y) && z == 2;
                let is_hole = x == 2 && y == 2 && (z == 1 || z == 3);
                !is_channel && !is_hole
            },
        );
        let slider = cuboid([1.05, 1.05, 1.05], [3.0, 2.95, 1.95]);
        let pin = cuboid([1.5, 1.6, 0.55], [2.3, 2.4, 0.95]);
        vec![housing, slider, pin]
    }

    fn planned(parts: Vec<SourceMesh>, targets: Option<Vec<usize>>) -> (Outcome, Vec<TraceEvent>) {
        let (scene, verifier) = scene(parts);
        let mut recorder = Recorder::default();
        let problem =
            Problem { actions: ActionSet::Extended, sweeps: true, targets, ..problem(scene, &verifier) };
        (search(Planner::SbdpStar, problem, &mut recorder), recorder.0)
    }

    #[test]
    fn a_pin_leaves_after_what_covers_it_was_moved_aside() {
        for turn in [Vector3::zeros(), Vector3::new(0.3, -0.5, 0.2)] {
            let pose = Pose::rotation(turn);
            let parts = covered_pin().into_iter().map(|mesh| placed(mesh, &pose)).collect();
            let (outcome, events) = planned(parts, Some(vec![2]));
            assert_eq!(outcome.status, PlanStatus::Complete, "{:?}", outcome.reason);
            let [aside, out] = &outcome.removals[..] else { panic!("{:?}", outcome.removals) };
            assert_eq!((&aside.parts[..], aside.aside, aside.of, aside.wave), (&[1][..], true, None, 0));
            let along = pose.inverse() * aside.motion().translation.vector;
            assert!(along.x > 1.2 && along.yz().norm() < 1e-6, "{along}");
            assert_eq!(
                (&out.parts[..], out.aside, &out.requires[..], out.wave),
                (&[2][..], false, &[0][..], 1)
            );
            assert_eq!(outcome.remaining, [0, 1]);
            assert!(events.iter().any(|e| matches!(e, TraceEvent::PlacesSearched { leaves: true, .. })));
        }
    }

    #[test]
    fn what_only_moves_aside_does_not_come_off() {
        let (outcome, _) = planned(covered_pin(), None);
        assert!(matches!(outcome.status, PlanStatus::Exhausted | PlanStatus::Infeasible));
        assert_eq!((outcome.remaining, outcome.removals.len()), (vec![0, 1], 2));
    }

    #[test]
    fn a_path_requires_what_was_moved_out_of_its_way_and_nothing_else() {
        // Beside the channel, a second pin in a hole of its own: it leaves at once.
        let mut parts = covered_pin();
        let post = cuboid([3.5, 1.6, 3.0], [4.5, 2.4, 3.5]);
        parts.push(post);
        let (outcome, _) = planned(parts, None);
        let of = |part: usize| {
            outcome.removals.iter().find(|r| r.parts == [part] && !r.aside).map(|r| r.requires.clone())
        };
        assert_eq!(of(3), Some(vec![]), "{:?}", outcome.removals);
        let aside = outcome.removals.iter().position(|r| r.aside);
        assert_eq!(of(2), aside.map(|i| vec![i]));
    }
}
