//! Random numbers and rotations that are the same for the same seed on every machine and in every
//! version. The random bits are those of the hash BLAKE3.

use std::f64::consts::TAU;

use nalgebra::{Quaternion, UnitQuaternion};

/// An endless row of random numbers.
#[derive(Debug, Clone)]
pub struct Uniform {
    bits: blake3::OutputReader,
}

impl Uniform {
    /// The row that belongs to some bytes.
    #[must_use]
    pub fn seeded(seed: &[u8]) -> Self {
        Self { bits: blake3::Hasher::new().update(seed).finalize_xof() }
    }

    /// The next number in [0, 1), uniform.
    pub fn number(&mut self) -> f64 {
        let mut bytes = [0; 8];
        self.bits.fill(&mut bytes);
        // As many bits as the number has: the interval is half open.
        (u64::from_le_bytes(bytes) >> 11) as f64 / (1u64 << 53) as f64
    }

    /// The next index below a count (at least 1), uniform.
    pub fn below(&mut self, count: usize) -> usize {
        ((self.number() * count as f64) as usize).min(count.saturating_sub(1))
    }

    /// A rotation, uniform on SO(3) (Shoemake, "Uniform random rotations", Graphics Gems III, 1992).
    pub fn rotation(&mut self) -> UnitQuaternion<f64> {
        let (split, first, second) = (self.number(), TAU * self.number(), TAU * self.number());
        let (a, b) = ((1.0 - split).sqrt(), split.sqrt());
        let q = Quaternion::new(b * second.cos(), a * first.sin(), a * first.cos(), b * second.sin());
        UnitQuaternion::from_quaternion(q)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Uniform on SO(3) means: the matrix entries have mean 0 and mean square 1/3, and the angle has
    /// the density (1 − cos θ)/π, whose mean is π/2 + 2/π.
    #[test]
    fn rotations_are_uniform() {
        const COUNT: u32 = 20_000;
        let (mut mean, mut square) = (nalgebra::Matrix3::zeros(), nalgebra::Matrix3::zeros());
        let mut angle = 0.0;
        let mut uniform = Uniform::seeded(b"rotations");
        for _ in 0..COUNT {
            let q = uniform.rotation();
            let matrix = q.to_rotation_matrix().into_inner();
            mean += matrix / f64::from(COUNT);
            square += matrix.component_mul(&matrix) / f64::from(COUNT);
            angle += q.angle() / f64::from(COUNT);
        }
        // About five standard deviations each.
        assert!(mean.amax() < 0.021, "{mean}");
        assert!((square.add_scalar(-1.0 / 3.0)).amax() < 0.012, "{square}");
        let expected = std::f64::consts::FRAC_PI_2 + 2.0 / std::f64::consts::PI;
        assert!((angle - expected).abs() < 0.025, "{angle} {expected}");
    }
}
