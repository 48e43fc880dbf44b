//! Random rotations of assemblies: the same for the same seed, assembly and number on every machine and
//! in every version, so that shards and later runs compare.

use nalgebra::UnitQuaternion;

use crate::geometry::Uniform;

/// The rotation of an assembly that has a number, from 1 on.
pub(super) fn random_rotation(seed: u64, assembly: &str, number: u32) -> UnitQuaternion<f64> {
    let seed = [&seed.to_le_bytes()[..], &number.to_le_bytes(), assembly.as_bytes()].concat();
    Uniform::seeded(&seed).rotation()
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
}
