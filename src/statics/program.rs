//! Conic programs: the least of a quadratic function among the points of which linear functions lie in cones. Solved by
//! clarabel, an interior-point method.

use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver, SolverStatus, SupportedConeT};

use crate::termination::{Interrupt, Termination};

/// A program, built up row by row: the least of ½ Σ `curvature` x² + `linear` x where `right` − A x lies in the cones.
#[derive(Default)]
pub(super) struct Program {
    curvature: Vec<f64>,
    linear: Vec<f64>,
    /// By row, in the order of the cones.
    pub(super) right: Vec<f64>,
    pub(super) cones: Vec<SupportedConeT<f64>>,
    /// The entries of A.
    rows: Vec<usize>,
    columns: Vec<usize>,
    values: Vec<f64>,
}

/// Where a program has its least, and the multipliers of its rows.
pub(super) struct Optimum {
    pub(super) point: Vec<f64>,
    pub(super) multipliers: Vec<f64>,
}

impl Program {
    /// The least of ½ Σ `curvature` x² + `linear` x, by column; no curvature is negative.
    pub(super) fn new(curvature: Vec<f64>, linear: Vec<f64>) -> Self {
        Self { curvature, linear, ..Self::default() }
    }

    /// Adds to an entry of A.
    pub(super) fn push(&mut self, row: usize, column: usize, value: f64) {
        if value != 0.0 {
            self.rows.push(row);
            self.columns.push(column);
            self.values.push(value);
        }
    }

    /// Solves it, as well as the solver can: the caller has to check the point. `None` where there is none.
    ///
    /// # Errors
    /// The termination condition became true.
    pub(super) fn solve(self, termination: &Termination) -> Result<Option<Optimum>, Interrupt> {
        termination.check()?;
        let (rows, columns) = (self.right.len(), self.linear.len());
        if columns == 0 {
            // The solver does not expect it.
            return Ok(Some(Optimum { point: Vec::new(), multipliers: vec![0.0; rows] }));
        }
        let curved: Vec<usize> = (0..columns).filter(|&column| self.curvature[column] != 0.0).collect();
        let curvature = curved.iter().map(|&column| self.curvature[column]).collect();
        let quadratic = CscMatrix::new_from_triplets(columns, columns, curved.clone(), curved, curvature);
        let matrix = CscMatrix::new_from_triplets(rows, columns, self.rows, self.columns, self.values);
        let settings = DefaultSettings { verbose: false, max_threads: 1, ..DefaultSettings::default() };
        let solver =
            DefaultSolver::new(&quadratic, &self.linear, &matrix, &self.right, &self.cones, settings);
        let Ok(mut solver) = solver else { return Ok(None) };
        let condition = termination.clone();
        solver.set_termination_callback(move |_| condition.check().is_err());
        solver.solve();
        termination.check()?;
        let solution = solver.solution;
        // Where it got stuck, its last point may be right all the same.
        let has_point = matches!(
            solution.status,
            SolverStatus::Solved
                | SolverStatus::AlmostSolved
                | SolverStatus::InsufficientProgress
                | SolverStatus::NumericalError
                | SolverStatus::MaxIterations
        );
        Ok(has_point.then_some(Optimum { point: solution.x, multipliers: solution.z }))
    }
}
