//! Projection of a wanted twist onto what contact allows.
//!
//! min ½|w − w*|² subject to aᵢ·w ≥ −bᵢ, by the dual active-set method of D. Goldfarb and A. Idnani
//! (1983) for an identity Hessian: start at w*, add the most violated row, keep multipliers
//! non-negative. At most six rows are ever active, so the normal equations are 6 × 6.

use nalgebra::{Matrix6, Vector6};

use crate::contact::constraint::VelocityConstraint;

/// The nearest allowed point and the rows that hold it, with their multipliers.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Projected {
    pub(super) w: Vector6<f64>,
    pub(super) active: Vec<(usize, f64)>,
}

impl Projected {
    /// The parts behind the constraints that hold it, ascending, without those that hardly push.
    pub(super) fn others(&self, rows: &[VelocityConstraint]) -> Vec<usize> {
        let strongest = self.active.iter().map(|(_, m)| *m).fold(0.0, f64::max);
        let pushing = self.active.iter().filter(|(_, m)| *m > 1e-6 * strongest);
        let mut out: Vec<_> = pushing.map(|(i, _)| rows[*i].other).collect();
        out.sort_unstable();
        out.dedup();
        out
    }
}

const FEASIBLE: f64 = 1e-10;
const MOST_ITERATIONS: usize = 400;

/// Projects `wanted`; `None` if no point satisfies all rows (or numbers degenerate).
pub(super) fn project(wanted: &Vector6<f64>, rows: &[VelocityConstraint]) -> Option<Projected> {
    let mut w = *wanted;
    let mut active: Vec<(usize, f64)> = Vec::with_capacity(6);
    for _ in 0..MOST_ITERATIONS {
        let Some(p) = most_violated(&w, rows) else {
            return Some(Projected { w, active });
        };
        let mut multiplier = 0.0;
        // Drop rows until the new one can be met.
        loop {
            let n = rows[p].a;
            let r = dual_direction(rows, &active, &n)?;
            let z = active.iter().zip(r.iter()).fold(n, |z, ((i, _), r)| z - rows[*i].a * *r);
            let slope = z.dot(&n);
            let full =
                if slope > 1e-9 * n.norm_squared() { Some(-(n.dot(&w) + rows[p].b) / slope) } else { None };
            let blocking = active
                .iter()
                .zip(r.iter())
                .enumerate()
                .filter(|(_, (_, r))| **r > 1e-12)
                .map(|(k, ((_, m), r))| (k, m / r))
                .min_by(|x, y| x.1.total_cmp(&y.1));
            let t = match (full, blocking) {
                (None, None) => return None,
                (Some(f), Some((_, b))) => f.min(b),
                (Some(f), None) => f,
                (None, Some((_, b))) => b,
            };
            if full.is_some() {
                w += z * t;
            }
            for ((_, m), r) in active.iter_mut().zip(r.iter()) {
                *m -= t * r;
            }
            multiplier += t;
            if full == Some(t) {
                active.push((p, multiplier));
                break;
            }
            let (k, _) = blocking?;
            active.remove(k);
        }
    }
    None
}

fn most_violated(w: &Vector6<f64>, rows: &[VelocityConstraint]) -> Option<usize> {
    let mut worst = (-FEASIBLE, None);
    for (i, row) in rows.iter().enumerate() {
        let slack = row.a.dot(w) + row.b;
        if slack < worst.0 {
            worst = (slack, Some(i));
        }
    }
    worst.1
}

/// r = (NᵀN)⁻¹ Nᵀ n over the active rows N; entries beyond them are zero.
fn dual_direction(
    rows: &[VelocityConstraint],
    active: &[(usize, f64)],
    n: &Vector6<f64>,
) -> Option<Vector6<f64>> {
    if active.len() > 6 {
        return None;
    }
    let mut gram = Matrix6::identity();
    let mut rhs = Vector6::zeros();
    for (i, (ri, _)) in active.iter().enumerate() {
        for (j, (rj, _)) in active.iter().enumerate() {
            gram[(i, j)] = rows[*ri].a.dot(&rows[*rj].a);
        }
        rhs[i] = rows[*ri].a.dot(n);
    }
    if active.is_empty() {
        return Some(rhs);
    }
    Some(gram.cholesky()?.solve(&rhs))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn row(a: [f64; 6], b: f64) -> VelocityConstraint {
        VelocityConstraint { a: Vector6::from(a), b, other: 0 }
    }

    #[test]
    fn an_allowed_twist_stays() {
        let w = Vector6::new(1.0, 0.0, 0.0, 0.0, 0.0, 0.0);
        let p = project(&w, &[row([0.0, 1.0, 0.0, 0.0, 0.0, 0.0], 0.0)]).unwrap();
        assert_eq!(p.w, w);
        assert!(p.active.is_empty());
    }

    #[test]
    fn a_wall_takes_away_the_part_towards_it_up_to_the_gap() {
        let w = Vector6::new(1.0, -1.0, 0.0, 0.0, 0.0, 0.0);
        let p = project(&w, &[row([0.0, 1.0, 0.0, 0.0, 0.0, 0.0], 0.25)]).unwrap();
        assert!((p.w - Vector6::new(1.0, -0.25, 0.0, 0.0, 0.0, 0.0)).norm() < 1e-12);
    }

    #[test]
    fn opposite_walls_that_want_to_be_left_at_once_cannot_be_met() {
        let rows = [row([1.0, 0.0, 0.0, 0.0, 0.0, 0.0], -0.1), row([-1.0, 0.0, 0.0, 0.0, 0.0, 0.0], -0.1)];
        assert!(project(&Vector6::zeros(), &rows).is_none());
    }

    proptest! {
        #[test]
        fn the_projection_is_allowed_and_optimal(
            w in prop::array::uniform6(-1.0..1.0f64),
            rows in prop::collection::vec((prop::array::uniform6(-1.0..1.0f64), 0.0..0.3f64), 0..40),
        ) {
            let rows: Vec<_> = rows.into_iter().map(|(a, b)| row(a, b)).collect();
            let wanted = Vector6::from(w);
            let p = project(&wanted, &rows).unwrap();
            for r in &rows {
                prop_assert!(r.a.dot(&p.w) + r.b > -1e-7);
            }
            // Optimality: w − w* is a non-negative combination of active rows.
            let mut rest = p.w - wanted;
            for (i, m) in &p.active {
                prop_assert!(*m >= -1e-9);
                prop_assert!((rows[*i].a.dot(&p.w) + rows[*i].b).abs() < 1e-7);
                rest -= rows[*i].a * *m;
            }
            prop_assert!(rest.norm() < 1e-7);
        }
    }
}
