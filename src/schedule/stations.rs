//! A line of stations: each carries out the next steps of a plan, in its order.

use std::ops::Range;

/// Halvings of the interval in which the cycle time lies. The interval is at most as long as all steps together: 2⁻⁶⁰ of that
/// is less than the rounding of a sum. At half, cycles are off by 1e-9 of the whole; at double, nothing changes.
const HALVINGS: usize = 60;

/// Steps in a row for each of some stations, so that the station that takes the longest takes as short as possible. With fewer
/// steps than stations, some have none.
#[must_use]
pub fn stations(seconds: &[f64], count: usize) -> Vec<Range<usize>> {
    let whole: f64 = seconds.iter().sum();
    let mut shortest = seconds.iter().copied().fold(0.0, f64::max);
    let mut longest = whole;
    for _ in 0..HALVINGS {
        let cycle = f64::midpoint(shortest, longest);
        if filled(seconds, cycle).len() <= count { longest = cycle } else { shortest = cycle }
    }
    let mut found = filled(seconds, longest);
    found.resize(count.max(found.len()), seconds.len()..seconds.len());
    found
}

/// As many steps for each station as a cycle allows, at least one.
fn filled(seconds: &[f64], cycle: f64) -> Vec<Range<usize>> {
    let mut found: Vec<Range<usize>> = Vec::new();
    let mut used = f64::INFINITY;
    for (step, time) in seconds.iter().enumerate() {
        match found.last_mut() {
            Some(last) if used + time <= cycle => {
                last.end = step + 1;
                used += time;
            }
            _ => {
                found.push(step..step + 1);
                used = *time;
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cycle(seconds: &[f64], stations: &[Range<usize>]) -> f64 {
        stations.iter().map(|steps| seconds[steps.clone()].iter().sum()).fold(0.0, f64::max)
    }

    /// The shortest cycle of all ways to cut, one after the other.
    fn shortest(seconds: &[f64], count: usize) -> f64 {
        if count == 1 {
            return seconds.iter().sum();
        }
        let cut =
            |first: usize| seconds[..first].iter().sum::<f64>().max(shortest(&seconds[first..], count - 1));
        (0..=seconds.len()).map(cut).fold(f64::INFINITY, f64::min)
    }

    #[test]
    fn the_longest_station_is_as_short_as_it_can_be() {
        let mut state = 7_u64;
        for case in 0..200 {
            let mut random = |most: u64| {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                (state >> 33) % most
            };
            let seconds: Vec<f64> = (0..1 + random(7)).map(|_| random(20) as f64 / 4.0).collect();
            let count = 1 + random(4) as usize;
            let found = stations(&seconds, count);
            assert_eq!(found.len(), count, "case {case}: {seconds:?}");
            let steps: Vec<usize> = found.iter().flat_map(Clone::clone).collect();
            assert_eq!(steps, (0..seconds.len()).collect::<Vec<_>>());
            let (got, best) = (cycle(&seconds, &found), shortest(&seconds, count));
            assert!((got - best).abs() < 1e-9, "case {case}: {seconds:?} on {count}: {got}, not {best}");
        }
    }
}
