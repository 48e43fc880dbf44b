//! What a process holds, as /proc tells.

use std::path::Path;

use super::figures::{DaemonFigures, ProcessFootprint};

/// Requests after which nothing may grow any more.
const SETTLED: u64 = 2000;

/// What the process holds now; zeros where the system does not tell.
pub(in crate::bench) fn footprint(pid: u32, requests: u64) -> ProcessFootprint {
    let proc = Path::new("/proc").join(pid.to_string());
    let status = std::fs::read_to_string(proc.join("status")).unwrap_or_default();
    let kib = |name: &str| -> u64 {
        let value = status.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(':'));
        value.and_then(|v| v.split_whitespace().next()?.parse().ok()).unwrap_or(0)
    };
    let descriptors = std::fs::read_dir(proc.join("fd")).map_or(0, |list| list.count() as u64);
    ProcessFootprint { requests, private_kib: kib("RssAnon"), resident_kib: kib("VmRSS"), descriptors }
}

/// Follows a process while requests end.
#[derive(Debug)]
pub(super) struct Watch {
    pid: u32,
    figures: DaemonFigures,
    settled: bool,
}

impl Watch {
    pub(super) fn new(pid: u32) -> Self {
        Self { pid, figures: DaemonFigures::default(), settled: false }
    }

    /// Looks, when so many requests have ended.
    pub(super) fn look(&mut self, requests: u64) {
        let now = footprint(self.pid, requests);
        self.figures.at_end = now;
        if !self.settled {
            self.figures.at_2000 = now;
            self.settled = requests >= SETTLED;
        }
        let largest = &mut self.figures.largest;
        if self.settled {
            largest.requests = requests;
            largest.private_kib = largest.private_kib.max(now.private_kib);
            largest.resident_kib = largest.resident_kib.max(now.resident_kib);
            largest.descriptors = largest.descriptors.max(now.descriptors);
        }
    }

    pub(super) fn figures(&self) -> DaemonFigures {
        self.figures
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn this_process_holds_something_and_what_is_gone_holds_nothing() {
        let here = footprint(std::process::id(), 7);
        assert!(here.resident_kib > 100 && here.private_kib > 0 && here.descriptors > 2, "{here:?}");
        assert_eq!(here.requests, 7);
        assert_eq!(footprint(u32::MAX, 0), ProcessFootprint::default());
    }

    #[test]
    fn the_two_thousandth_request_is_held_fast_and_the_largest_counts_from_there() {
        let mut watch = Watch::new(std::process::id());
        [100, 2005, 3000].into_iter().for_each(|requests| watch.look(requests));
        let DaemonFigures { at_2000, at_end, largest } = watch.figures();
        assert_eq!((at_2000.requests, at_end.requests, largest.requests), (2005, 3000, 3000));
        assert!(largest.resident_kib >= at_2000.resident_kib);
    }
}
