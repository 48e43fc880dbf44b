//! Prepares likely requests while the workers are idle: reads the records that were used last before a restart;
//! computes the fields, overlaps and blocking graphs of new assemblies and of those used last before a restart; then
//! plans the likely next questions about planned assemblies ([`speculation`](super::speculation)). A request
//! interrupts all of it.

use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use rayon::ThreadPoolBuilder;
use serde::Serialize;

use super::planning::{Planning, contained};
use super::speculation::Speculation;
use crate::service::AssemblyId;
use crate::termination::Termination;

/// Nothing is prepared until no request came for this long: clients mostly ask for a plan right after an upload.
const QUIET: Duration = Duration::from_millis(50);
/// At most this many assemblies wait; the oldest are dropped.
const MOST_WAITING: usize = 256;
/// The questions after at most this many plans wait; those after the oldest are dropped.
const MOST_SPECULATIONS: usize = 16;

/// At most this many of the assemblies that were used last before a restart are prepared.
const MOST_RECENT: usize = 8;
/// Unix niceness of the threads that prepare assemblies …
const NICE: i32 = 10;
/// … and of those that plan likely questions.
const NICEST: i32 = 19;

/// Starts the thread that prepares what waits.
///
/// # Errors
/// The system has no thread for it.
pub(super) fn start<P: Planning>(prefetch: &Arc<Prefetch>, service: &Arc<P>) -> std::io::Result<()> {
    let (prefetch, service) = (Arc::clone(prefetch), Arc::clone(service));
    let prepare = move || {
        // Speculation leaves half of the processors to other programs: a thread that shares a core with them slows
        // them down, whatever its niceness.
        let all = thread::available_parallelism().map_or(1, usize::from);
        let pools = [(all, NICE), (all.div_ceil(2), NICEST)].map(|(threads, niceness)| {
            let pool = ThreadPoolBuilder::new().num_threads(threads);
            pool.start_handler(move |_| yield_to_others(niceness)).build()
        });
        let [Ok(for_assemblies), Ok(for_questions)] = pools else {
            tracing::warn!("nothing is made ready ahead: there are no threads for it");
            return;
        };
        for_assemblies.install(|| service.recall_recent());
        for id in service.recent(MOST_RECENT) {
            prefetch.want(id);
        }
        prefetch.run(|work, termination| match work {
            Work::Assembly(id) => {
                // An error is reported to the client that plans the assembly.
                let _ = contained(|| for_assemblies.install(|| service.prepare(*id, termination)));
                false
            }
            Work::Question(speculation) => {
                for_questions.install(|| speculation.plan_next(&*service, termination))
            }
        });
    };
    thread::Builder::new().name("sbdp-prefetch".to_owned()).spawn(prepare)?;
    Ok(())
}

/// Lowers the priority of this thread. On Linux each thread has its own niceness.
fn yield_to_others(niceness: i32) {
    let this = rustix::thread::gettid();
    if let Err(error) = rustix::process::setpriority_process(Some(this), niceness) {
        tracing::debug!(%error, "no lower priority for what is not asked");
    }
}

/// What waits to be prepared, and whether the workers are idle. Shared by all threads.
#[derive(Debug, Default)]
pub(super) struct Prefetch {
    state: Mutex<PrefetchState>,
    changed: Condvar,
}

#[derive(Debug, Default)]
struct PrefetchState {
    waiting: VecDeque<AssemblyId>,
    /// The newest first: its plan is probably the one that is being carried out.
    speculations: VecDeque<Speculation>,
    /// Questions that were planned ahead.
    speculated: u64,
    /// Requests at work.
    busy: usize,
    quiet_since: Option<Instant>,
    /// What is being prepared.
    at_work: Option<AtWork>,
    closed: bool,
}

/// A preparation at work.
#[derive(Debug)]
struct AtWork {
    /// Interrupts it.
    stop: Arc<AtomicBool>,
    /// The number of questions that are left, if it plans questions.
    questions: Option<usize>,
}

impl AtWork {
    fn stop(&self) {
        self.stop.store(true, Ordering::Relaxed);
    }
}

/// Something to prepare.
#[derive(Debug)]
pub(super) enum Work {
    /// An assembly: what any plan of it needs.
    Assembly(AssemblyId),
    /// The next of the likely questions after a plan.
    Question(Box<Speculation>),
}

/// How much waits to be prepared, and how much was.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub(crate) struct PrefetchMetrics {
    /// Assemblies that wait or are being prepared.
    pub(crate) assemblies: usize,
    /// Questions that wait or are being planned.
    pub(crate) questions: usize,
    /// Questions that were planned ahead, since the daemon started.
    pub(crate) speculated: u64,
}

/// As long as this lives, nothing is prepared.
#[derive(Debug)]
pub(super) struct Busy<'p>(&'p Prefetch);

impl Drop for Busy<'_> {
    fn drop(&mut self) {
        let mut state = self.0.state();
        state.busy -= 1;
        state.quiet_since = Some(Instant::now());
        self.0.changed.notify_all();
    }
}

/// Ends all preparation when it is dropped.
#[derive(Debug)]
pub(super) struct CloseOnDrop(pub(super) Arc<Prefetch>);

impl Drop for CloseOnDrop {
    fn drop(&mut self) {
        self.0.close();
    }
}

impl Prefetch {
    /// A worker begins a request.
    pub(super) fn busy(&self) -> Busy<'_> {
        let mut state = self.state();
        state.busy += 1;
        state.at_work.iter().for_each(AtWork::stop);
        Busy(self)
    }

    /// A request was answered without a worker. Speculation stops, so that the client's next request finds a free
    /// processor. The preparation of an assembly goes on: a client is probably about to plan it.
    pub(super) fn answered(&self) {
        let mut state = self.state();
        state.quiet_since = Some(Instant::now());
        state.at_work.iter().filter(|work| work.questions.is_some()).for_each(AtWork::stop);
    }

    /// Queues an assembly behind those that wait.
    pub(super) fn want(&self, id: AssemblyId) {
        let mut state = self.state();
        state.waiting.retain(|waiting| *waiting != id);
        state.waiting.push_back(id);
        if state.waiting.len() > MOST_WAITING {
            state.waiting.pop_front();
        }
        self.changed.notify_all();
    }

    /// Queues the likely questions after a plan before those after older plans.
    pub(super) fn speculate(&self, speculation: Speculation) {
        let mut state = self.state();
        state.speculations.retain(|waiting| !waiting.is_as(&speculation));
        state.speculations.push_front(speculation);
        state.speculations.truncate(MOST_SPECULATIONS);
        self.changed.notify_all();
    }

    /// Figures for the metrics.
    pub(super) fn metrics(&self) -> PrefetchMetrics {
        let state = self.state();
        let at_work = state.at_work.as_ref();
        let assembly = at_work.is_some_and(|work| work.questions.is_none());
        let questions = at_work.and_then(|work| work.questions).unwrap_or(0);
        PrefetchMetrics {
            assemblies: state.waiting.len() + usize::from(assembly),
            questions: state.speculations.iter().map(Speculation::left).sum::<usize>() + questions,
            speculated: state.speculated,
        }
    }

    /// Ends all preparation.
    pub(super) fn close(&self) {
        let mut state = self.state();
        state.closed = true;
        state.at_work.iter().for_each(AtWork::stop);
        self.changed.notify_all();
    }

    /// Prepares what waits, whenever the workers are idle, until it is closed. `prepare` returns whether it planned a
    /// question.
    pub(super) fn run(&self, prepare: impl Fn(&mut Work, &Termination) -> bool) {
        while let Some((mut work, termination)) = self.next() {
            let speculated = prepare(&mut work, &termination);
            let mut state = self.state();
            state.at_work = None;
            state.speculated += u64::from(speculated);
            state.put_back(work, termination.check().is_err());
        }
    }

    /// Waits until the workers are idle and something is queued.
    fn next(&self) -> Option<(Work, Termination)> {
        let mut state = self.state();
        loop {
            if state.closed {
                return None;
            }
            let quiet = state.quiet_since.map_or(Duration::MAX, |since| since.elapsed());
            if state.busy > 0 || state.is_idle() {
                state = self.changed.wait(state).unwrap_or_else(PoisonError::into_inner);
            } else if quiet < QUIET {
                let waited = self.changed.wait_timeout(state, QUIET - quiet);
                state = waited.unwrap_or_else(PoisonError::into_inner).0;
            } else if let Some(work) = state.take() {
                let termination = Termination::default();
                let questions = match &work {
                    Work::Assembly(_) => None,
                    Work::Question(speculation) => Some(speculation.left()),
                };
                state.at_work = Some(AtWork { stop: termination.cancel_flag(), questions });
                return Some((work, termination));
            }
        }
    }

    /// The state is plain data, so it is consistent even if a thread panicked while it held the lock.
    fn state(&self) -> MutexGuard<'_, PrefetchState> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl PrefetchState {
    fn is_idle(&self) -> bool {
        self.waiting.is_empty() && self.speculations.is_empty()
    }

    fn take(&mut self) -> Option<Work> {
        let assembly = self.waiting.pop_front().map(Work::Assembly);
        assembly.or_else(|| self.speculations.pop_front().map(|f| Work::Question(Box::new(f))))
    }

    /// Interrupted work comes next again, and so do the questions that are left after a plan.
    fn put_back(&mut self, work: Work, was_stopped: bool) {
        match work {
            _ if self.closed => {}
            Work::Assembly(id) => {
                if was_stopped && !self.waiting.contains(&id) {
                    self.waiting.push_front(id);
                }
            }
            Work::Question(speculation) => {
                let is_there = self.speculations.iter().any(|waiting| waiting.is_as(&speculation));
                if speculation.left() > 0 && !is_there {
                    self.speculations.push_front(*speculation);
                    self.speculations.truncate(MOST_SPECULATIONS);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::channel;

    use super::super::jobs::PlanJob;
    use super::*;
    use crate::fixtures::{plan_of, step_of};
    use crate::plan::PlanStatus;
    use crate::search::PlanRequest;

    fn id(n: u8) -> AssemblyId {
        AssemblyId([n; 32])
    }

    #[test]
    fn what_a_request_stopped_is_made_ready_when_it_is_over() {
        let prefetch = Arc::new(Prefetch::default());
        let (begun, seen) = channel();
        let thread = {
            let prefetch = Arc::clone(&prefetch);
            std::thread::spawn(move || {
                let tries = Mutex::new(0);
                prefetch.run(|work, termination| {
                    let Work::Assembly(id) = *work else { panic!("{work:?}") };
                    let mut tries = tries.lock().unwrap();
                    *tries += 1;
                    begun.send(id).unwrap();
                    // The first is long: only a request ends it.
                    while *tries == 1 && termination.check().is_ok() {
                        std::thread::yield_now();
                    }
                    false
                });
            })
        };
        prefetch.want(id(1));
        assert_eq!(seen.recv().unwrap(), id(1));
        prefetch.want(id(2));
        let busy = prefetch.busy();
        assert!(seen.try_recv().is_err(), "nothing begins beside a request");
        drop(busy);
        assert_eq!((seen.recv().unwrap(), seen.recv().unwrap()), (id(1), id(2)), "first what was stopped");
        prefetch.close();
        thread.join().unwrap();
        assert!(seen.recv().is_err());
    }

    #[test]
    fn what_is_wanted_twice_is_made_ready_once_and_the_oldest_are_left_out() {
        let prefetch = Prefetch::default();
        for n in 0..=255 {
            prefetch.want(id(n));
        }
        prefetch.want(id(7));
        prefetch.want(AssemblyId([1, 0].repeat(16).try_into().unwrap()));
        let state = prefetch.state();
        assert_eq!((state.waiting.len(), state.waiting[0]), (MOST_WAITING, id(1)));
        assert_eq!(state.waiting.iter().filter(|w| **w == id(7)).count(), 1);
    }

    fn questions(assembly: u8, parts: usize) -> Speculation {
        let job = PlanJob::about(id(assembly), PlanRequest::default());
        let plan = plan_of(PlanStatus::Complete, (0..parts).map(step_of).collect());
        Speculation::after(&job, &plan, Duration::from_secs(1000)).unwrap()
    }

    #[test]
    fn assemblies_come_before_questions_and_the_newest_plan_before_others() {
        let prefetch = Prefetch::default();
        prefetch.speculate(questions(1, 1));
        prefetch.speculate(questions(2, 2));
        prefetch.want(id(3));
        prefetch.speculate(questions(1, 3));
        assert_eq!(prefetch.metrics(), PrefetchMetrics { assemblies: 1, questions: 13, speculated: 0 });
        let mut taken = Vec::new();
        while let Some((work, _)) = (prefetch.metrics().questions > 0).then(|| prefetch.next()).flatten() {
            taken.push(match work {
                Work::Assembly(_) => 0,
                Work::Question(speculation) => speculation.left(),
            });
            prefetch.state().at_work = None;
        }
        assert_eq!(taken, [0, 8, 5], "of plans that were made twice, what comes after the later one");
    }

    #[test]
    fn a_request_that_was_answered_at_once_stops_questions_alone() {
        let prefetch = Prefetch::default();
        prefetch.want(id(1));
        let (_, termination) = prefetch.next().unwrap();
        prefetch.answered();
        assert!(termination.check().is_ok());
        prefetch.state().at_work = None;
        prefetch.speculate(questions(1, 1));
        let (work, termination) = prefetch.next().unwrap();
        assert_eq!(
            prefetch.metrics(),
            PrefetchMetrics { assemblies: 0, questions: 2, speculated: 0 },
            "with what is at work"
        );
        prefetch.answered();
        assert!(termination.check().is_err());
        let mut state = prefetch.state();
        state.at_work = None;
        state.put_back(work, true);
        drop(state);
        assert_eq!(prefetch.metrics().questions, 2, "they are left");
    }

    #[test]
    fn only_so_many_plans_wait() {
        let prefetch = Prefetch::default();
        for n in 0..=MOST_SPECULATIONS as u8 {
            prefetch.speculate(questions(n, 1));
        }
        assert_eq!(prefetch.metrics().questions, 2 * MOST_SPECULATIONS);
        prefetch.close();
        prefetch.state().speculations.clear();
        prefetch.state().put_back(Work::Question(Box::new(questions(1, 1))), true);
        assert_eq!(prefetch.metrics().questions, 0, "nothing waits once it is closed");
    }
}
