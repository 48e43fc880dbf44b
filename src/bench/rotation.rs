//! Random rotations of assemblies.
//!
//! Guarantees: uniform on SO(3) (Shoemake, "Uniform random rotations", Graphics Gems III, 1992),
//! and the same for the same seed, assembly and number on every machine and in every version, so
//! that shards and later runs compare. The random bits are those of the hash BLAKE3.

use std::f64::consts::TAU;

use nalgebra::{Quaternion, UnitQuaternion};

/// The rotation of an assembly that has a number, from 1 on.
pub(super) fn random_rotation(seed: u64, assembly: &str, number: u32) -> UnitQuaternion<f64> {
    let mut hasher = blake3::Hasher::new();
    hasher.update(&seed.to_le_bytes()).update(&number.to_le_bytes()).update(assembly.as_bytes());
    let mut bits = hasher.finalize_xof();
    let mut uniform = || {
        let mut bytes = [0; 8];
        bits.fill(&mut bytes);
        // As many bits as the number has: the interval is [0, 1).
        (u64::from_le_bytes(bytes) >> 11) as f64 / (1u64 << 53) as f64
    };
    let (split, first, second) = (uniform(), TAU * uniform(), TAU * uniform());
    let (a, b) = ((1.0 - split).sqrt(), split.sqrt());
    let q = Quaternion::new(b * second.cos(), a * first.sin(), a * first.cos(), b * second.sin());
    UnitQuaternion::from_quaternion(q)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rotations_differ_by_seed_assembly_and_number_and_by_nothing_else() {
        let one = random_rotation(1, "a", 1);
        assert_eq!(one, random_rotation(1, "a", 1));
        for other in [random_rotation(2, "a", 1), random_rotation(1, "b", 1), random_rotation(1, "a", 2)] {
            assert!(one.angle_to(&other) > 1e-3, "{one} {other}");
        }
    }

    /// Uniform on SO(3) means: the matrix entries have mean 0 and mean square 1/3, and the angle has
    /// the density (1 − cos θ)/π, whose mean is π/2 + 2/π.
    #[test]
    fn rotations_are_uniform() {
        const COUNT: u32 = 20_000;
        let (mut mean, mut square) = (nalgebra::Matrix3::zeros(), nalgebra::Matrix3::zeros());
        let mut angle = 0.0;
        for number in 0..COUNT {
            let q = random_rotation(0, "x", number);
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
