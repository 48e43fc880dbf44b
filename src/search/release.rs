//! What stays as long as others leave, and when it may leave all the same: parts that are to be kept, and the base.
//!
//! Where nothing else leaves any more, first a base leaves that was chosen here, then what is to be kept, and last a base
//! that the request gave. After each removal all of it stays again.

use super::disassembly::Disassembly;
use super::problem::Problem;

/// Which parts may leave beside those that are asked for; each with those before it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
pub enum Release {
    /// No others.
    #[default]
    Nothing,
    /// A base that was chosen.
    ChosenBase,
    /// Parts that are to be kept.
    Kept,
    /// A base that the request gave.
    GivenBase,
}

impl Problem<'_> {
    /// From when on a part may leave.
    pub(super) fn release_of(&self, part: usize) -> Release {
        match (self.base.parts.contains(&part), &self.base.reason) {
            (true, None) => Release::GivenBase,
            _ if self.keep.contains(&part) => Release::Kept,
            (true, Some(_)) => Release::ChosenBase,
            (false, _) => Release::Nothing,
        }
    }

    /// What this search may release at most.
    pub(super) fn last_release(&self) -> Release {
        if self.keep.is_empty() || self.releases_kept { Release::GivenBase } else { Release::ChosenBase }
    }
}

impl Disassembly<'_, '_> {
    /// Lets the next of the parts leave that stay so far, up to some; false if there are none.
    pub(super) fn release(&mut self, most: Release) -> bool {
        let Self { problem, everything, .. } = self;
        let most = most.min(problem.last_release());
        let all = everything.standing().iter().map(|&part| problem.release_of(part));
        let Some(next) = all.filter(|&r| problem.released < r && r <= most).min() else { return false };
        problem.released = next;
        true
    }

    /// Lets the base leave where none of the parts stands that are to be kept longer than it.
    pub(super) fn release_base(&mut self) -> bool {
        let stands = self.everything.standing().iter().any(|part| self.problem.keep.contains(part));
        self.release(if stands { Release::ChosenBase } else { Release::GivenBase })
    }
}
