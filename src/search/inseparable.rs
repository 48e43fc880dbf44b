//! Pairs of parts that are proved never to come apart one at a time.
//!
//! A proof is about two parts alone. If no motion of one takes it away from the other, no motion of the other does
//! either, since only their relative motion counts, and further parts are only in the way. So both stay, whatever
//! else is removed, and a request that wants one of them out has no plan.

use crate::termination::Interrupt;

use super::enclosed::first_enclosed;
use super::linked::Links;
use super::outcome::{Inseparable, SeparationProof};
use super::problem::Problem;

/// The first pair of parts that remain (ascending) which never comes apart, and of which one is wanted. `links` are
/// those among parts that include all that remain, if they are known.
///
/// # Errors
/// The termination condition became true.
pub(super) fn first_inseparable(
    problem: &Problem<'_>,
    remaining: &[usize],
    links: Option<Links>,
) -> Result<Option<Inseparable>, Interrupt> {
    let wanted = problem.wanted(remaining);
    let links = match links {
        Some(links) => links,
        None => Links::among(&problem.scene, remaining, &problem.termination)?,
    };
    let linked = |&part: &usize| {
        let holder = links.holder(part, remaining)?;
        Some(Inseparable { parts: [part, holder], proof: SeparationProof::Linked })
    };
    match wanted.iter().find_map(linked) {
        Some(found) => Ok(Some(found)),
        None => first_enclosed(problem, remaining, |part| wanted.binary_search(&part).is_ok()),
    }
}
