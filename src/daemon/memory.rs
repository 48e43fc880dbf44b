//! How much memory is left. To run out of it ends the process, and with it everybody's requests: what would
//! need more is refused before.

use std::fs;
use std::path::{Path, PathBuf};

/// Taking meshes in needs about this many times their bytes in the upload, at the worst moment: beside the
/// upload itself there are the mesh as given, healed and in the planning frame, its edges, and all that is
/// derived from it. Measured: 43 times of a ball of two million triangles, 52 times of one of 200,000.
const NEEDED: u64 = 48;

/// What taking in an upload of so many bytes needs.
pub(super) fn needed(upload: u64) -> u64 {
    upload.saturating_mul(NEEDED)
}

/// Bytes that this process can still take: what the machine has, or less where a control group (v2) that it
/// is in allows less. `None` where the system does not say.
pub(super) fn available() -> Option<u64> {
    let machine = fs::read_to_string("/proc/meminfo").ok().and_then(|text| of_machine(&text));
    let groups = fs::read_to_string("/proc/self/cgroup").ok();
    let groups = groups.and_then(|text| of_groups(&text, |file| fs::read_to_string(file).ok()));
    [machine, groups].into_iter().flatten().min()
}

/// By the text of `/proc/meminfo`.
fn of_machine(text: &str) -> Option<u64> {
    let line = text.lines().find_map(|line| line.strip_prefix("MemAvailable:"))?;
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
    fn this_process_can_take_some() {
        assert!(available().is_none_or(|bytes| bytes > 1 << 20), "{:?}", available());
    }
}
