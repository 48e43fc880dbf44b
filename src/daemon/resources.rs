//! What the system leaves to this process: memory, shared memory, file descriptors. To run out of memory of
//! either kind ends the process, and with it everybody's requests: what would need more is refused before.

use std::fs;
use std::path::{Path, PathBuf};

/// Taking meshes in needs about this many times their bytes in the upload, at the worst moment: beside the
/// upload itself there are the mesh as given, healed and in the planning frame, its edges, and all that is
/// derived from it. Measured: 43 times of a ball of two million triangles, 52 times of one of 200,000.
const NEEDED: u64 = 48;

/// What taking in an upload of so many bytes needs.
pub(super) fn memory_needed(upload: u64) -> u64 {
    upload.saturating_mul(NEEDED)
}

/// Bytes that this process can still take: what the machine has, or less where a control group (v2) that it
/// is in allows less. `None` where the system does not say.
pub(super) fn free_memory() -> Option<u64> {
    let machine = fs::read_to_string("/proc/meminfo").ok().and_then(|text| of_machine(&text));
    let groups = fs::read_to_string("/proc/self/cgroup").ok();
    let groups = groups.and_then(|text| of_groups(&text, |file| fs::read_to_string(file).ok()));
    [machine, groups].into_iter().flatten().min()
}

/// Bytes of memory that this process has now. `None` where the system does not say.
pub(super) fn resident_memory() -> Option<u64> {
    line_of(&fs::read_to_string("/proc/self/status").ok()?, "VmRSS:")
}

/// By the text of `/proc/meminfo`.
fn of_machine(text: &str) -> Option<u64> {
    line_of(text, "MemAvailable:")
}

/// The bytes in the line of a text that begins with a name.
fn line_of(text: &str, name: &str) -> Option<u64> {
    let line = text.lines().find_map(|line| line.strip_prefix(name))?;
    let kilobytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kilobytes << 10)
}

/// By the text of `/proc/self/cgroup` and the files of the groups: the least that one of them leaves.
fn of_groups(text: &str, read: impl Fn(&Path) -> Option<String>) -> Option<u64> {
    let path = text.lines().find_map(|line| line.strip_prefix("0::/"))?;
    let group = PathBuf::from("/sys/fs/cgroup").join(path);
    let number = |file: PathBuf| read(&file)?.trim().parse::<u64>().ok();
    let left = |group: &Path| {
        // "max" where there is no limit.
        Some(number(group.join("memory.max"))?.saturating_sub(number(group.join("memory.current"))?))
    };
    group.ancestors().filter_map(left).min()
}

/// Each client costs a few file descriptors: take as many as the system allows.
pub(crate) fn raise_file_limit() {
    use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
    let limit = getrlimit(Resource::Nofile);
    let raised = Rlimit { current: limit.maximum, maximum: limit.maximum };
    if let Err(error) = setrlimit(Resource::Nofile, raised) {
        tracing::debug!(%error, "the limit of open files stays as it is");
    }
}

/// Less free shared memory than this is worth a warning.
const SMALL_SHARED_MEMORY: u64 = 256 << 20;

/// Looks how much shared memory is left. What runs full is a SIGBUS, not an error: it is said before that.
#[derive(Debug, Default)]
pub(crate) struct SharedMemory {
    /// It was little when it was looked at last.
    is_small: bool,
}

impl SharedMemory {
    /// Bytes that are free; none where there is no limit. Warns when it has become little.
    pub(crate) fn look(&mut self) -> Option<u64> {
        let stat = rustix::fs::statvfs("/dev/shm").ok().filter(|stat| stat.f_blocks > 0)?;
        let free = stat.f_bavail.saturating_mul(stat.f_frsize);
        self.judge(free);
        Some(free)
    }

    fn judge(&mut self, free: u64) {
        // What goes up and down about the limit is not worth a line each time.
        let limit = if self.is_small { 2 * SMALL_SHARED_MEMORY } else { SMALL_SHARED_MEMORY };
        let was_small = std::mem::replace(&mut self.is_small, free < limit);
        if self.is_small && !was_small {
            tracing::warn!(
                free_mb = free >> 20,
                "little is free in /dev/shm: many clients or large uploads may end the daemon; enlarge it \
                 (`mount -o remount,size=…`, `docker run --shm-size`), or see who fills it (`ls -l /dev/shm`)"
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_the_machine_says_is_understood() {
        let text =
            "MemTotal:       24689764 kB\nMemFree:  1 kB\nMemAvailable:   23560000 kB\nBuffers: 2 kB\n";
        assert_eq!(of_machine(text), Some(23_560_000 << 10));
        for damaged in ["", "MemAvailable:", "MemAvailable: x kB", "MemAvailable: 5 MB", "MemTotal: 5 kB"] {
            assert_eq!(of_machine(damaged), None, "{damaged}");
        }
    }

    #[test]
    fn the_tightest_group_counts() {
        let files = |file: &Path| {
            let text = match file.to_str()? {
                "/sys/fs/cgroup/a.slice/b/memory.max" => "max\n",
                "/sys/fs/cgroup/a.slice/b/memory.current" => "100\n",
                "/sys/fs/cgroup/a.slice/memory.max" => "1000\n",
                "/sys/fs/cgroup/a.slice/memory.current" => "300\n",
                _ => return None,
            };
            Some(text.to_owned())
        };
        assert_eq!(of_groups("1:cpu:/x\n0::/a.slice/b\n", files), Some(700));
        assert_eq!(of_groups("0::/a.slice\n", files), Some(700));
        assert_eq!(of_groups("0::/\n", files), None);
        assert_eq!(of_groups("", files), None);
        let spent = |file: &Path| Some(if file.ends_with("memory.max") { "5" } else { "9" }.to_owned());
        assert_eq!(of_groups("0::/a\n", spent), Some(0));
    }

    #[test]
    fn this_process_has_memory_and_can_take_some() {
        assert!(resident_memory().is_some_and(|bytes| bytes > 1 << 20), "{:?}", resident_memory());
        assert!(free_memory().is_none_or(|bytes| bytes > 1 << 20), "{:?}", free_memory());
    }

    #[test]
    fn little_shared_memory_is_noticed_until_there_is_clearly_more() {
        let mut memory = SharedMemory::default();
        let mut small = |free_mb: u64| {
            memory.judge(free_mb << 20);
            memory.is_small
        };
        assert!(!small(300) && small(200) && small(300) && !small(600) && !small(300));
    }
}
