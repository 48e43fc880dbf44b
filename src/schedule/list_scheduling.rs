//! List scheduling with arms that move and arms that hold.

use crate::geometry::Bounds;
use crate::termination::Interrupt;

/// A step of a plan, as far as time goes.
#[derive(Debug, Clone, PartialEq)]
pub struct Operation {
    /// The parts that it takes from what stands; none if it takes apart what is out.
    pub parts: Vec<usize>,
    /// The operations that are over before it begins.
    pub requires: Vec<usize>,
    /// How long it takes.
    pub seconds: f64,
    /// What its parts sweep. Operations that sweep the same room are not carried out at once. `None`: nothing near others.
    pub swept: Option<Bounds>,
}

/// What has to be held while some parts stand.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Held {
    /// The number of arms for it.
    pub arms: usize,
    /// The parts that would fall.
    pub falling: Vec<usize>,
}

/// An operation with its time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ScheduledOperation {
    /// Its number.
    pub operation: usize,
    /// Which arm moves the parts, from 0.
    pub arm: usize,
    /// When it begins, in seconds.
    pub begin: f64,
    /// When it is over.
    pub end: f64,
    /// The number of arms that hold other parts from when it begins.
    pub held: usize,
}

/// When everything is done.
#[derive(Debug, Clone, PartialEq)]
pub struct Schedule {
    /// All operations, in the order in which they begin.
    pub operations: Vec<ScheduledOperation>,
    /// Seconds until all are over.
    pub seconds: f64,
    /// The operations of the longest chain, each of which requires the one before: however many arms there are, it takes
    /// as long as these together.
    pub critical: Vec<usize>,
}

/// Why there is no schedule.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum ScheduleError {
    /// There are too few arms for any operation that could be next.
    #[error("too few arms")]
    TooFewArms {
        /// The operation that needs the fewest.
        operation: usize,
        /// How many it needs, one of which moves.
        needed: usize,
    },
    /// Operations require each other, or some that do not exist.
    #[error("operations require each other, or some that do not exist")]
    NoOrder,
    /// The termination condition became true.
    #[error(transparent)]
    Interrupted(#[from] Interrupt),
}

/// An operation that is going on.
struct Running {
    operation: usize,
    arm: usize,
    end: f64,
}

/// A schedule for a number of arms, each of which moves the parts of one operation or holds a part. `hold` says what has to
/// be held of parts that stand (ascending); what is being moved does not stand any more.
///
/// Whenever something is over, all begins that can, first what the longest chain waits for. Without anything to hold, and
/// without room that is shared, the time is at most 2 − 1/arms times the shortest (Graham). With parts to hold, a better
/// choice may need fewer arms.
///
/// # Errors
/// See [`ScheduleError`].
pub fn schedule(
    operations: &[Operation],
    arms: usize,
    mut standing: Vec<usize>,
    hold: &mut dyn FnMut(&[usize]) -> Result<Held, Interrupt>,
) -> Result<Schedule, ScheduleError> {
    let chains = chains(operations).ok_or(ScheduleError::NoOrder)?;
    let mut waiting: Vec<usize> = (0..operations.len()).collect();
    waiting.sort_by(|&a, &b| chains[b].total_cmp(&chains[a]));
    let mut is_done = vec![false; operations.len()];
    let mut running: Vec<Running> = Vec::new();
    let mut scheduled = Vec::with_capacity(operations.len());
    let (mut now, mut held) = (0.0, hold(&standing)?);
    while !(waiting.is_empty() && running.is_empty()) {
        let mut least: Option<(usize, usize)> = None;
        let mut place = 0;
        while let Some(&operation) = waiting.get(place) {
            place += 1;
            let Operation { parts, requires, seconds, swept } = &operations[operation];
            let crosses = |other: &Running| match (swept, &operations[other.operation].swept) {
                (Some(one), Some(other)) => one.meets(other),
                _ => false,
            };
            let busy = running.len() + 1;
            let is_ready = requires.iter().all(|&before| is_done[before]);
            if !is_ready || busy > arms || running.iter().any(crosses) {
                continue;
            }
            // Other parts that leave seldom make less fall.
            let relieves = parts.iter().any(|part| held.falling.contains(part));
            if busy + held.arms > arms && !relieves && !running.is_empty() {
                continue;
            }
            let rest: Vec<usize> = standing.iter().copied().filter(|part| !parts.contains(part)).collect();
            let after = hold(&rest)?;
            let needed = busy + after.arms;
            if needed > arms {
                least = least.filter(|(_, fewest)| *fewest <= needed).or(Some((operation, needed)));
                continue;
            }
            let arm = (0..arms).find(|arm| running.iter().all(|other| other.arm != *arm)).unwrap_or(0);
            let end = now + seconds;
            scheduled.push(ScheduledOperation { operation, arm, begin: now, end, held: after.arms });
            running.push(Running { operation, arm, end });
            (standing, held) = (rest, after);
            waiting.remove(place - 1);
            // What was passed over may find its part among those that fall now.
            place = 0;
        }
        let first = (0..running.len()).min_by(|&a, &b| running[a].end.total_cmp(&running[b].end));
        let Some(first) = first else {
            let (operation, needed) = least.ok_or(ScheduleError::NoOrder)?;
            return Err(ScheduleError::TooFewArms { operation, needed });
        };
        let over = running.remove(first);
        now = over.end;
        is_done[over.operation] = true;
    }
    Ok(Schedule { operations: scheduled, seconds: now, critical: critical(operations, &chains) })
}

/// By operation, how long it and the longest chain that waits for it take; `None` if they have no order.
fn chains(operations: &[Operation]) -> Option<Vec<f64>> {
    let mut followers = vec![Vec::new(); operations.len()];
    for (i, operation) in operations.iter().enumerate() {
        for &before in &operation.requires {
            followers.get_mut(before)?.push(i);
        }
    }
    let mut left: Vec<usize> = followers.iter().map(Vec::len).collect();
    let mut last: Vec<usize> = (0..operations.len()).filter(|&i| left[i] == 0).collect();
    let mut chains: Vec<f64> = operations.iter().map(|operation| operation.seconds).collect();
    let mut next = 0;
    while let Some(&i) = last.get(next) {
        next += 1;
        let longest = followers[i].iter().map(|&follower| chains[follower]).fold(0.0, f64::max);
        chains[i] += longest;
        for &before in &operations[i].requires {
            left[before] -= 1;
            if left[before] == 0 {
                last.push(before);
            }
        }
    }
    (last.len() == operations.len()).then_some(chains)
}

/// The operations of the longest chain.
fn critical(operations: &[Operation], chains: &[f64]) -> Vec<usize> {
    let longest = |among: &mut dyn Iterator<Item = usize>| {
        among.max_by(|&a, &b| chains[a].total_cmp(&chains[b]).then(b.cmp(&a)))
    };
    let mut chain: Vec<usize> = Vec::new();
    let mut next = longest(&mut (0..operations.len()));
    while let Some(operation) = next {
        chain.push(operation);
        next = longest(&mut (0..operations.len()).filter(|&i| operations[i].requires.contains(&operation)));
    }
    chain
}
