//! The deadline of a call, and the time that the daemon gets of it.

use std::time::{Duration, Instant};

use tonic::Status;
use tonic::metadata::MetadataMap;

use crate::status::argument;

/// The header by which gRPC passes a deadline on, as the time that is left.
const HEADER: &str = "grpc-timeout";
/// The most digits of its number, by the protocol of gRPC over HTTP/2.
const DIGITS: usize = 8;

/// The time that a call has, if it has a deadline.
pub(crate) fn timeout(metadata: &MetadataMap) -> Result<Option<Duration>, Status> {
    let Some(value) = metadata.get(HEADER) else { return Ok(None) };
    let parsed = value.to_str().ok().and_then(parse);
    parsed.map(Some).ok_or_else(|| argument(HEADER, "it is no time as gRPC defines them, as `250m`"))
}

fn parse(text: &str) -> Option<Duration> {
    let (digits, unit) = text.split_at_checked(text.len().checked_sub(1)?)?;
    if digits.len() > DIGITS || !digits.bytes().all(|digit| digit.is_ascii_digit()) {
        return None;
    }
    let number: u64 = digits.parse().ok()?;
    match unit {
        "H" => Some(Duration::from_secs(number * 3600)),
        "M" => Some(Duration::from_secs(number * 60)),
        "S" => Some(Duration::from_secs(number)),
        "m" => Some(Duration::from_millis(number)),
        "u" => Some(Duration::from_micros(number)),
        "n" => Some(Duration::from_nanos(number)),
        _ => None,
    }
}

/// Until when a plan may take.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Deadlines {
    /// When the caller takes no answer any more.
    pub(crate) call: Option<Instant>,
    /// When the request wants an answer.
    pub(crate) request: Option<Instant>,
}

impl Deadlines {
    /// The deadlines of a call that came at a moment. A time so long that no clock holds its end is none.
    pub(crate) fn new(arrived: Instant, call: Option<Duration>, request: Option<Duration>) -> Self {
        let after = |time: Option<Duration>| time.and_then(|time| arrived.checked_add(time));
        Self { call: after(call), request: after(request) }
    }

    /// The time that the daemon gets: its answer is to be back before the call's deadline. Of a call that is short of
    /// time, half is for planning.
    pub(crate) fn time_for_daemon(&self, now: Instant, margin: Duration) -> Option<Duration> {
        let left = |deadline: Instant| deadline.saturating_duration_since(now);
        let of_call = self.call.map(left).map(|left| left - margin.min(left / 2));
        let of_request = self.request.map(left);
        of_call.into_iter().chain(of_request).min()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_read_as_grpc_writes_them() {
        assert_eq!(parse("3H"), Some(Duration::from_secs(10_800)));
        assert_eq!(parse("99999999H"), Some(Duration::from_secs(99_999_999 * 3600)));
        assert_eq!(parse("250m"), Some(Duration::from_millis(250)));
        assert_eq!(parse("7n"), Some(Duration::from_nanos(7)));
        for wrong in ["", "m", "1", "-1S", "+1S", "123456789S", "1x", "1 S", "1é"] {
            assert_eq!(parse(wrong), None, "{wrong}");
        }
    }

    #[test]
    fn the_daemon_answers_before_the_deadline_of_the_call() {
        let (now, ms) = (Instant::now(), Duration::from_millis);
        let given = |call: Option<u64>, request: Option<u64>| {
            Deadlines::new(now, call.map(ms), request.map(ms)).time_for_daemon(now, ms(20))
        };
        assert_eq!(given(None, None), None);
        assert_eq!(given(Some(500), None), Some(ms(480)));
        assert_eq!(given(Some(500), Some(490)), Some(ms(480)));
        assert_eq!(given(Some(500), Some(100)), Some(ms(100)));
        assert_eq!(given(None, Some(100)), Some(ms(100)));
        assert_eq!(given(Some(10), None), Some(ms(5)));
        assert_eq!(given(Some(0), None), Some(ms(0)));
    }
}
