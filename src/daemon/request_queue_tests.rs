//! Order, bounds and fairness of the queue, without threads.

use proptest::prelude::*;

use super::*;

const FREE: QueueLimits = QueueLimits {
    waiting: 100,
    waiting_per_owner: 100,
    bytes: u64::MAX,
    bytes_per_owner: u64::MAX,
    workers: 1,
    working_per_owner: 100,
    working_batch: 100,
    work_s_per_owner: None,
};

fn of(owner: u64) -> Ticket {
    Ticket { owner: Owner(owner), class: Class::Interactive, bytes: 0 }
}

fn batch(owner: u64) -> Ticket {
    Ticket { class: Class::Batch, ..of(owner) }
}

/// Pops and works off everything, one job at a time.
fn order(queue: &mut RequestQueue<u32>) -> Vec<u32> {
    std::iter::from_fn(|| {
        let (ticket, job) = queue.pop()?;
        queue.done(ticket, Duration::from_millis(1));
        Some(job)
    })
    .collect()
}

proptest! {
    #[test]
    fn it_keeps_its_bounds_and_loses_nothing(
        limit in 1_usize..6,
        per_owner in 1_usize..4,
        steps in proptest::collection::vec((0_u8..10, 0_u64..3), 0..80),
    ) {
        let bounds = QueueLimits { waiting: limit, waiting_per_owner: per_owner, working_per_owner: 2, ..FREE };
        let mut queue = RequestQueue::new(bounds);
        let (mut model, mut working): (Vec<(u64, u32)>, Vec<Ticket>) = (Vec::new(), Vec::new());
        for (number, (step, owner)) in (0_u32..).zip(steps) {
            match step {
                0..=4 => {
                    let own = model.iter().filter(|(o, _)| *o == owner).count();
                    let expected = match () {
                        () if own >= per_owner => Err(Rejected::OwnerFull),
                        () if model.len() >= limit => Err(Rejected::Full),
                        () => Ok(()),
                    };
                    prop_assert_eq!(queue.push(of(owner), number), expected);
                    if expected.is_ok() {
                        model.push((owner, number));
                    }
                }
                5..=7 => {
                    let busy = |owner: u64| working.iter().filter(|t| t.owner == Owner(owner)).count();
                    let possible = model.iter().any(|(owner, _)| busy(*owner) < 2);
                    let popped = queue.pop();
                    prop_assert_eq!(popped.is_some(), possible);
                    if let Some((ticket, job)) = popped {
                        prop_assert!(busy(ticket.owner.0) < 2);
                        let oldest = model.iter().position(|(o, _)| Owner(*o) == ticket.owner);
                        prop_assert_eq!(model.remove(oldest.unwrap()), (ticket.owner.0, job));
                        working.push(ticket);
                    }
                }
                8 => {
                    if let Some(ticket) = working.pop() {
                        queue.done(ticket, Duration::from_millis(1));
                    }
                }
                _ => {
                    let before = model.len();
                    model.retain(|(_, n)| n % 3 != 0);
                    prop_assert_eq!(queue.withdraw(|n| n % 3 == 0), model.len() < before);
                }
            }
            prop_assert_eq!(queue.len(), model.len());
        }
    }
}

#[test]
fn a_client_that_asks_for_much_waits_for_itself() {
    let mut queue = RequestQueue::new(FREE);
    (0..5).for_each(|n| queue.push(of(1), n).unwrap());
    queue.push(of(2), 10).unwrap();
    queue.push(of(3), 20).unwrap();
    queue.push(of(2), 11).unwrap();
    assert_eq!(order(&mut queue), [0, 10, 20, 1, 11, 2, 3, 4]);
}

#[test]
fn those_who_come_again_at_once_do_not_pass_one_who_waits() {
    let mut queue = RequestQueue::new(FREE);
    (0..9).for_each(|n| queue.push(of(1), n).unwrap());
    let mut first = 0;
    for round in 0..12 {
        for owner in 2..5 {
            let _ = queue.push(of(owner), 100 * owner as u32 + round);
        }
        let (ticket, _) = queue.pop().unwrap();
        queue.done(ticket, Duration::ZERO);
        first += u32::from(ticket.owner == Owner(1));
    }
    assert_eq!(first, 3, "one turn in four");
}

#[test]
fn a_client_at_work_waits_for_others_and_never_works_beyond_its_share() {
    let mut queue = RequestQueue::new(QueueLimits { working_per_owner: 1, ..FREE });
    (0..3).for_each(|n| queue.push(of(1), n).unwrap());
    let (first, _) = queue.pop().unwrap();
    assert_eq!(queue.pop(), None, "it works already");
    queue.push(of(2), 10).unwrap();
    assert_eq!(queue.pop().unwrap().1, 10);
    queue.done(first, Duration::ZERO);
    assert_eq!(queue.pop().unwrap().1, 1);
}

#[test]
fn interactive_goes_before_batch_but_not_for_ever() {
    let mut queue = RequestQueue::new(FREE);
    queue.push(batch(1), 1000).unwrap();
    (0..40).for_each(|n| queue.push(of(2), n).unwrap());
    let order = order(&mut queue);
    assert_eq!(order.iter().position(|&job| job == 1000), Some(PATIENCE as usize));
}

#[test]
fn batch_leaves_workers_to_those_who_wait() {
    let mut queue = RequestQueue::new(QueueLimits { working_batch: 1, ..FREE });
    queue.push(batch(1), 1).unwrap();
    queue.push(batch(2), 2).unwrap();
    let (first, _) = queue.pop().unwrap();
    assert_eq!(queue.pop(), None);
    queue.push(of(3), 3).unwrap();
    assert_eq!(queue.pop().unwrap().1, 3);
    queue.done(first, Duration::ZERO);
    assert_eq!(queue.pop().unwrap().1, 2);
}

#[test]
fn waiting_bytes_are_bounded_in_all_and_per_client_but_one_always_fits() {
    let heavy = |owner: u64, bytes: u64| Ticket { bytes, ..of(owner) };
    let mut queue = RequestQueue::new(QueueLimits { bytes: 250, bytes_per_owner: 120, ..FREE });
    queue.push(heavy(1, 1000), 0).unwrap();
    assert_eq!(queue.push(heavy(1, 1), 1), Err(Rejected::OwnerFull));
    assert_eq!(queue.push(heavy(2, 1), 1), Err(Rejected::Full));
    queue.withdraw(|_| true);
    queue.push(heavy(1, 100), 1).unwrap();
    queue.push(heavy(2, 100), 2).unwrap();
    queue.push(heavy(1, 20), 3).unwrap();
    assert_eq!(queue.push(heavy(3, 50), 4), Err(Rejected::Full));
}

#[test]
fn the_hint_grows_with_what_waits_and_how_long_it_takes() {
    let mut queue = RequestQueue::new(QueueLimits { workers: 2, ..FREE });
    assert_eq!(queue.hint_ms(Owner(1)), HINT_MS.0 as u32);
    queue.push(of(1), 0).unwrap();
    let (ticket, _) = queue.pop().unwrap();
    queue.done(ticket, Duration::from_millis(400));
    (0..4).for_each(|n| queue.push(of(1), n).unwrap());
    assert_eq!(queue.hint_ms(Owner(1)), 800);
    queue.push(of(1), 0).unwrap();
    let (ticket, _) = queue.pop().unwrap();
    queue.done(ticket, Duration::from_secs(10_000));
    assert_eq!(queue.hint_ms(Owner(1)), HINT_MS.1 as u32);
}

#[test]
fn a_closed_queue_takes_nothing_but_gives_what_it_has() {
    let mut queue = RequestQueue::new(FREE);
    queue.push(of(1), 1).unwrap();
    queue.close();
    assert_eq!(queue.push(of(1), 2), Err(Rejected::Closed));
    assert!(!queue.is_over());
    assert_eq!(order(&mut queue), [1]);
    assert!(queue.is_over() && queue.owners.is_empty());
}

#[test]
fn who_has_had_its_share_of_the_workers_is_told_when_there_is_more_and_others_are_not_kept_from_theirs() {
    let mut queue = RequestQueue::new(QueueLimits { work_s_per_owner: Some(6.0), ..FREE });
    let start = queue.now;
    queue.push(of(1), 0).unwrap();
    let (ticket, _) = queue.pop().unwrap();
    queue.done(ticket, Duration::from_secs(9));
    assert_eq!(queue.push(of(1), 1), Err(Rejected::OwnerSpent));
    // 3 s too many, at 6 s a minute.
    assert!((29_000..=31_000).contains(&queue.hint_ms(Owner(1))), "{}", queue.hint_ms(Owner(1)));
    queue.push(of(2), 2).unwrap();
    queue.pass_until(start + Duration::from_secs(29));
    assert_eq!(queue.push(of(1), 3), Err(Rejected::OwnerSpent));
    queue.pass_until(start + Duration::from_secs(31));
    queue.push(of(1), 4).unwrap();
    assert_eq!(order(&mut queue), [2, 4]);
    queue.pass_until(start + Duration::from_secs(200));
    assert!(queue.owners.is_empty(), "whoever owes nothing is forgotten");
}
