//! What a record says of the machine and the time of its run.

use tracing_subscriber::fmt::format::Writer;
use tracing_subscriber::fmt::time::{FormatTime, SystemTime};

/// How many processors this process may use.
pub(super) fn processors() -> usize {
    std::thread::available_parallelism().map_or(0, usize::from)
}

/// The processor's name, or its architecture where the system does not say more.
pub(super) fn processor() -> String {
    let text = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    named(&text).unwrap_or_else(|| std::env::consts::ARCH.to_owned())
}

/// By the text of `/proc/cpuinfo`.
fn named(text: &str) -> Option<String> {
    let value = |line: &str| {
        let (key, value) = line.split_once(':')?;
        (key.trim() == "model name").then(|| value.trim().to_owned())
    };
    text.lines().find_map(value).filter(|name| !name.is_empty())
}

/// The time now, UTC, as RFC 3339 has it.
pub(super) fn now() -> String {
    let mut text = String::new();
    // Writing to a text cannot fail.
    let _ = SystemTime.format_time(&mut Writer::new(&mut text));
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_processor_is_named() {
        let text = "processor\t: 0\nmodel\t\t: 25\nmodel name\t: Fast 9000 @ 3.00GHz\nflags : a\n";
        assert_eq!(named(text).as_deref(), Some("Fast 9000 @ 3.00GHz"));
        for without in ["", "model name\t:\n", "processor : 0\n"] {
            assert_eq!(named(without), None, "{without}");
        }
        assert!(!processor().is_empty() && processors() > 0);
    }

    #[test]
    fn the_date_is_that_of_a_calendar() {
        let now = now();
        let (date, time) = now.split_once('T').unwrap();
        let date: Vec<u32> = date.split('-').map(|n| n.parse().unwrap()).collect();
        assert!(date[0] >= 2025 && (1..=12).contains(&date[1]) && (1..=31).contains(&date[2]), "{now}");
        assert!(time.ends_with('Z'), "{now}");
    }
}
