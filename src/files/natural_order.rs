//! The order in which people count: "2" before "10".

use std::cmp::Ordering;

/// Compares names with their runs of digits taken as numbers. Total: names that count alike
/// ("01" and "1") are ordered by their characters.
#[must_use]
pub fn natural_order(a: &str, b: &str) -> Ordering {
    let (mut rest_a, mut rest_b) = (a, b);
    while !rest_a.is_empty() && !rest_b.is_empty() {
        let (run_a, run_b) = (next_run(rest_a), next_run(rest_b));
        let order = compare_runs(run_a, run_b);
        if order != Ordering::Equal {
            return order;
        }
        rest_a = &rest_a[run_a.len()..];
        rest_b = &rest_b[run_b.len()..];
    }
    rest_a.len().cmp(&rest_b.len()).then_with(|| a.cmp(b))
}

/// A leading run of digits, or the leading run without any.
fn next_run(text: &str) -> &str {
    let digits = text.starts_with(|c: char| c.is_ascii_digit());
    let end = text.find(|c: char| c.is_ascii_digit() != digits).unwrap_or(text.len());
    &text[..end]
}

fn compare_runs(a: &str, b: &str) -> Ordering {
    let number = |run: &str| run.starts_with(|c: char| c.is_ascii_digit());
    if number(a) && number(b) {
        let (a, b) = (a.trim_start_matches('0'), b.trim_start_matches('0'));
        return a.len().cmp(&b.len()).then_with(|| a.cmp(b));
    }
    a.cmp(b)
}

#[cfg(test)]
mod tests {
    use super::natural_order;
    use proptest::prelude::*;

    #[test]
    fn numbers_count_as_numbers() {
        let mut names = ["10", "2", "bolt10", "bolt2", "bolt", "1", "01", "a", "999999999999999999999999"];
        names.sort_by(|a, b| natural_order(a, b));
        assert_eq!(names, ["01", "1", "2", "10", "999999999999999999999999", "a", "bolt", "bolt2", "bolt10"]);
    }

    proptest! {
        #[test]
        fn the_order_is_total(a in "[0-9a-cä]{0,6}", b in "[0-9a-cä]{0,6}", c in "[0-9a-cä]{0,6}") {
            prop_assert_eq!(natural_order(&a, &b), natural_order(&b, &a).reverse());
            prop_assert_eq!(natural_order(&a, &b).is_eq(), a == b);
            if natural_order(&a, &b).is_le() && natural_order(&b, &c).is_le() {
                prop_assert!(natural_order(&a, &c).is_le());
            }
        }
    }
}
