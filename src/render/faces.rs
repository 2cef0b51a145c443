//! Σ F · Γ̄ · Λ̄ over the faces of an igloo (paper, Eq. 5 discretised).

use glam::Vec3;

use crate::surface::SurfacePoint;
use crate::tally::{self, Work};

/// What a face must pass on of a radiance of 1 for its surface to be lit: the faces left out add up to less than half a per cent.
const WORTH_A_LOOK: f32 = 2e-5;

/// Whether the surface of a face is worth being lit for what the face passes on.
pub fn worth_a_look(passed_on: Vec3) -> bool {
    let most = passed_on.max_element();
    // What is no number is worth it: it shall be seen.
    most >= WORTH_A_LOOK || most.is_nan()
}

/// The sum over the faces, with hair and, where `UNOCCLUDED`, also without.
///
/// F of a face times its solid angle is `free(face)`, Γ̄ `gamma`, Λ̄ `light`; `met` says which faces end at a surface (empty: none).
/// Compiled for each case: what is off is not asked for at each face.
pub fn sum<const UNOCCLUDED: bool>(
    free: impl Fn(usize) -> Vec3,
    gamma: &[f32],
    light: &[Vec3],
    met: &[Option<SurfacePoint>],
) -> [Vec3; 2] {
    let [mut occluded, mut unoccluded] = [Vec3::ZERO; 2];
    if UNOCCLUDED {
        tally::add(Work::UnoccludedFaces, gamma.len() as u64);
    }
    for (face, (&gamma, &light)) in gamma.iter().zip(light).enumerate() {
        let free = free(face);
        let weight = free * gamma;
        if !UNOCCLUDED {
            occluded += weight * light;
            continue;
        }
        unoccluded += free * light;
        // A surface that is lit for this sum alone: the other does not depend on whether this one is wanted.
        let for_this = met.get(face).is_some_and(|met| met.is_some() && !worth_a_look(weight));
        if !for_this {
            occluded += weight * light;
        }
    }
    [occluded, unoccluded]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sum_with_hair_does_not_depend_on_the_other() {
        let point = SurfacePoint {
            distance: 1.0,
            position: Vec3::ZERO,
            flat_normal: Vec3::Z,
            normal: Vec3::Z,
            triangle: 0,
            finish: 0,
            albedo: Vec3::ONE,
            emission: Vec3::ZERO,
        };
        let met = [None, Some(point), Some(point), None];
        let (gamma, light) = ([0.3, 1e-9, 0.7, 0.0], [Vec3::ONE, Vec3::X, Vec3::Y, Vec3::Z]);
        let free = |face: usize| Vec3::splat(0.1 * (face + 1) as f32);
        // Alone, the sum has no light of the second face, which is not worth a look.
        let mut alone = light;
        alone[1] = Vec3::ZERO;
        let [occluded, none] = sum::<false>(free, &gamma, &alone, &met);
        let [same, unoccluded] = sum::<true>(free, &gamma, &light, &met);
        assert_eq!((occluded, none), (same, Vec3::ZERO));
        assert!((unoccluded - Vec3::new(0.3, 0.4, 0.5)).abs().max_element() < 1e-6, "{unoccluded}");
        assert!(worth_a_look(Vec3::NAN) && !worth_a_look(Vec3::ZERO));
    }
}
