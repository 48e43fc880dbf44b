//! Schedules whose best is known.

use super::*;
use crate::geometry::{Bounds, Pose};
use crate::termination::Interrupt;

fn operation(part: usize, requires: &[usize], seconds: f64) -> Operation {
    Operation { parts: vec![part], requires: requires.to_vec(), seconds, swept: None }
}

fn nothing(_: &[usize]) -> Result<Held, Interrupt> {
    Ok(Held::default())
}

fn seconds(operations: &[Operation], arms: usize) -> f64 {
    let standing = (0..operations.len()).collect();
    schedule(operations, arms, standing, &mut nothing).unwrap().seconds
}

#[test]
fn independent_operations_are_shared_out_and_chains_are_not() {
    let alone: Vec<Operation> = (0..6).map(|i| operation(i, &[], 2.0)).collect();
    assert_eq!([1, 2, 3, 6, 9].map(|arms| seconds(&alone, arms)), [12.0, 6.0, 4.0, 2.0, 2.0]);
    let chain: Vec<Operation> = (0..6).map(|i| operation(i, if i == 0 { &[] } else { &[0] }, 2.0)).collect();
    assert_eq!([1, 2, 5].map(|arms| seconds(&chain, arms)), [12.0, 8.0, 4.0]);
}

#[test]
fn what_the_longest_chain_waits_for_begins_first() {
    // Three short ones, and a chain of three: on two arms as long as the chain, if that begins at once.
    let mut all: Vec<Operation> = (0..3).map(|i| operation(i, &[], 1.0)).collect();
    all.extend([operation(3, &[], 1.0), operation(4, &[3], 1.0), operation(5, &[4], 1.0)]);
    let found = schedule(&all, 2, (0..6).collect(), &mut nothing).unwrap();
    assert_eq!((found.seconds, &found.critical[..]), (3.0, &[3, 4, 5][..]));
    for pair in found.operations.windows(2) {
        assert!(pair[0].begin <= pair[1].begin);
    }
    // No arm does two things at once, and nothing begins before what it requires is over.
    for one in &found.operations {
        for other in &found.operations {
            let together = one.begin < other.end && other.begin < one.end;
            assert!(one.operation == other.operation || !together || one.arm != other.arm);
            if all[one.operation].requires.contains(&other.operation) {
                assert!(other.end <= one.begin);
            }
        }
    }
}

#[test]
fn room_is_used_by_one_at_a_time() {
    let bounds = |x: f64| Some(Bounds { min: [x, 0.0, 0.0].into(), max: [x + 1.5, 1.0, 1.0].into() });
    let crossing = |x: [f64; 2]| {
        let operations = [0, 1].map(|i| Operation { swept: bounds(x[i]), ..operation(i, &[], 1.0) });
        seconds(&operations, 2)
    };
    assert_eq!((crossing([0.0, 1.0]), crossing([0.0, 2.0])), (2.0, 1.0));
}

#[test]
fn a_bolt_is_held_while_its_nut_is_taken_off_and_follows_it() {
    // Nuts 0 and 1 carry bolts 2 and 3.
    let operations =
        [operation(0, &[], 1.0), operation(1, &[], 1.0), operation(2, &[0], 1.0), operation(3, &[1], 1.0)];
    let mut hold = |standing: &[usize]| {
        let hangs = |bolt: &usize| standing.contains(bolt) && !standing.contains(&(bolt - 2));
        let falling: Vec<usize> = [2, 3].into_iter().filter(hangs).collect();
        Ok(Held { arms: falling.len(), falling })
    };
    let mut with = |arms: usize| schedule(&operations, arms, (0..4).collect(), &mut hold);
    assert_eq!(with(1), Err(ScheduleError::TooFewArms { operation: 0, needed: 2 }));
    let two = with(2).unwrap();
    let order: Vec<usize> = two.operations.iter().map(|o| o.operation).collect();
    assert_eq!((order, two.seconds), (vec![0, 2, 1, 3], 4.0));
    assert_eq!(two.operations.iter().map(|o| o.held).collect::<Vec<_>>(), [1, 0, 1, 0]);
    assert_eq!(with(4).unwrap().seconds, 2.0);
}

#[test]
fn what_has_no_order_is_refused() {
    for requires in [[[1], [0]], [[0], [0]], [[7], [0]]] {
        let operations = [0, 1].map(|i| operation(i, &requires[i], 1.0));
        let found = schedule(&operations, 2, vec![0, 1], &mut nothing);
        assert_eq!(found, Err(ScheduleError::NoOrder));
    }
    assert_eq!(schedule(&[], 1, vec![], &mut nothing).unwrap().seconds, 0.0);
}

#[test]
fn times_are_those_of_lengths_and_turns() {
    let times = MotionTimes { grasp: 1.0, put_down: 2.0, speed: 50.0, turn: 4.0 };
    let at = |x: f64, turned: f64| Pose::new([x, 0.0, 0.0].into(), nalgebra::Vector3::x() * turned);
    let centre = [3.0, 4.0, 0.0].into();
    assert_eq!(times.of(&[Pose::identity()], &centre, 1.0), 3.0);
    assert!((times.of(&[at(0.0, 0.0), at(10.0, 0.0)], &centre, 10.0) - 5.0).abs() < 1e-12);
    // Half a turn takes longer than the shift that goes along with it.
    let half = [at(0.0, 0.0), at(1.0, 2.0), at(2.0, std::f64::consts::PI)];
    assert!((times.of(&half, &[0.0; 3].into(), 1.0) - 5.0).abs() < 1e-12);
    assert_eq!(times.out_of_range(), None);
    assert_eq!(MotionTimes { speed: 0.0, ..times }.out_of_range(), Some("speed"));
    assert_eq!(MotionTimes { turn: f64::NAN, ..times }.out_of_range(), Some("turn"));
}
