//! What a load came to, per client and in all.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::mix::Kind;

/// How one request ended, and when.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Ending {
    /// With a plan, a handle, or whatever was asked for.
    Answered,
    /// With an error that says why.
    Refused(String),
    /// The client let it go.
    Dropped,
    /// With nothing, or with something that no daemon may answer.
    Lost(String),
}

/// What one client got for its requests of one kind.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct KindTimes {
    sent: u64,
    answered: u64,
    dropped: u64,
    lost: u64,
    /// By the error code's name.
    refused: BTreeMap<String, u64>,
    /// Of those that were answered or refused.
    times_us: Vec<f64>,
}

/// What one client has to tell at its end.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct ClientFigures {
    kinds: BTreeMap<Kind, KindTimes>,
    /// Of each question that was answered with a plan, a hash of that plan.
    plans: BTreeMap<String, String>,
    /// Plans that differed from an earlier answer to the same question.
    differing: u64,
    /// The first few reasons of requests that were lost.
    lost: Vec<String>,
}

/// So many reasons are told.
const REASONS: usize = 10;

impl ClientFigures {
    pub(super) fn add(&mut self, kind: Kind, ending: Ending, took_us: f64) {
        let of = self.kinds.entry(kind).or_default();
        of.sent += 1;
        match ending {
            Ending::Answered => of.answered += 1,
            Ending::Refused(code) => *of.refused.entry(code).or_default() += 1,
            Ending::Dropped => {
                of.dropped += 1;
                return;
            }
            Ending::Lost(reason) => {
                of.lost += 1;
                if self.lost.len() < REASONS {
                    self.lost.push(reason);
                }
                return;
            }
        }
        of.times_us.push(took_us);
    }

    /// A plan that answers a question: always the same one.
    pub(super) fn plan(&mut self, question: String, hash: String) {
        if self.plans.get(&question).is_some_and(|known| *known != hash) {
            self.differing += 1;
        }
        self.plans.insert(question, hash);
    }

    /// How many questions both answered, and how many of these with another plan.
    pub(super) fn compare(&self, other: &Self) -> (u64, u64) {
        let both = self.plans.iter().filter_map(|(question, hash)| Some((hash, other.plans.get(question)?)));
        both.fold((0, 0), |(all, differing), (a, b)| (all + 1, differing + u64::from(a != b)))
    }

    pub(super) fn merge(&mut self, other: Self) {
        for (kind, theirs) in other.kinds {
            let ours = self.kinds.entry(kind).or_default();
            ours.sent += theirs.sent;
            ours.answered += theirs.answered;
            ours.dropped += theirs.dropped;
            ours.lost += theirs.lost;
            for (code, count) in theirs.refused {
                *ours.refused.entry(code).or_default() += count;
            }
            ours.times_us.extend(theirs.times_us);
        }
        self.differing += other.differing;
        other.plans.into_iter().for_each(|(question, hash)| self.plan(question, hash));
        self.lost.extend(other.lost);
        self.lost.truncate(REASONS);
    }
}

/// Requests of one kind.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct KindFigures {
    /// Requests.
    pub sent: u64,
    /// Ended with what was asked for.
    pub answered: u64,
    /// Ended with an error, by its code.
    pub refused: BTreeMap<String, u64>,
    /// Let go by the client itself.
    pub dropped: u64,
    /// Ended with nothing.
    pub lost: u64,
    /// Median of the time to the end, microseconds.
    pub p50_us: f64,
    /// 99th percentile of it.
    pub p99_us: f64,
}

/// What the daemon's process holds.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct ProcessFootprint {
    /// Requests that had ended by then.
    pub requests: u64,
    /// Resident set without what is shared (of which its shared memory is the most).
    pub private_kib: u64,
    /// Resident set.
    pub resident_kib: u64,
    /// Open file descriptors.
    pub descriptors: u64,
}

/// The daemon over a load.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct DaemonFigures {
    /// When two thousand requests had ended (or at the end, if there are fewer).
    pub at_2000: ProcessFootprint,
    /// At the end, all clients still connected.
    pub at_end: ProcessFootprint,
    /// The largest of everything from the two thousandth request on.
    pub largest: ProcessFootprint,
}

/// A load and what came of it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Phase {
    /// Requests of all clients.
    pub sent: u64,
    /// Ended with what was asked for.
    pub answered: u64,
    /// Ended with an error that says why.
    pub refused: u64,
    /// Let go by the client itself.
    pub dropped: u64,
    /// Ended with nothing: there may be none.
    pub lost: u64,
    /// Why, of the first few.
    pub lost_because: Vec<String>,
    /// Plans that differed from another answer to the same question: there may be none.
    pub differing: u64,
    /// Plan requests that the daemon counted meanwhile, and those of disturbers since they began.
    pub plans_received: u64,
    /// From the first request to the last answer.
    pub wall_s: f64,
    /// By kind.
    pub kinds: BTreeMap<Kind, KindFigures>,
    /// What the daemon held.
    pub daemon: DaemonFigures,
}

impl Phase {
    pub(super) fn of(
        figures: ClientFigures,
        plans_received: u64,
        wall_s: f64,
        daemon: DaemonFigures,
    ) -> Self {
        let kinds: BTreeMap<Kind, KindFigures> =
            figures.kinds.into_iter().map(|(kind, times)| (kind, kind_figures(times))).collect();
        let sum = |of: fn(&KindFigures) -> u64| kinds.values().map(of).sum();
        Self {
            sent: sum(|k| k.sent),
            answered: sum(|k| k.answered),
            refused: sum(|k| k.refused.values().sum()),
            dropped: sum(|k| k.dropped),
            lost: sum(|k| k.lost),
            lost_because: figures.lost,
            differing: figures.differing,
            plans_received,
            wall_s,
            daemon,
            kinds,
        }
    }
}

fn kind_figures(mut times: KindTimes) -> KindFigures {
    times.times_us.sort_unstable_by(f64::total_cmp);
    let at = |share: f64| {
        let place = (times.times_us.len() as f64 * share) as usize;
        times.times_us.get(place.min(times.times_us.len().saturating_sub(1))).copied().unwrap_or(0.0)
    };
    KindFigures {
        sent: times.sent,
        answered: times.answered,
        dropped: times.dropped,
        lost: times.lost,
        p50_us: at(0.5),
        p99_us: at(0.99),
        refused: times.refused,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_request_counts_once_and_answers_that_differ_are_seen_across_clients() {
        let mut all = ClientFigures::default();
        for (client, hash) in ["same", "same", "other"].into_iter().enumerate() {
            let mut one = ClientFigures::default();
            one.add(Kind::Repeat, Ending::Answered, 10.0 * client as f64);
            one.add(Kind::Repeat, Ending::Refused("Busy".into()), 1.0);
            one.add(Kind::Drop, Ending::Dropped, 1.0);
            one.add(Kind::Upload, Ending::Lost("no answer".into()), 1.0);
            one.plan("question".into(), hash.into());
            all.merge(one);
        }
        let phase = Phase::of(all, 5, 1.0, DaemonFigures::default());
        assert_eq!((phase.sent, phase.answered, phase.refused), (12, 3, 3));
        assert_eq!((phase.dropped, phase.lost, phase.differing), (3, 3, 1));
        assert_eq!(phase.kinds[&Kind::Repeat].p99_us, 20.0);
        assert_eq!(phase.kinds[&Kind::Repeat].refused["Busy"], 3);
        assert_eq!(phase.kinds[&Kind::Drop].p99_us, 0.0);
    }
}
