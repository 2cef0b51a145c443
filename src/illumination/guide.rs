//! Where a single ray to the environment goes: by radiance times cosine.

use std::f32::consts::PI;

use glam::{Mat3, Vec3};

use crate::igloo::{Igloo, Span, frame_around};

/// Faces a hemisphere at the most: each counts once for every ray.
const MOST_FACES: u32 = 100;

/// The environment over a coarse igloo. Rays see the faces' means, not the pixels: less noise, the same mean.
#[derive(Clone, Debug)]
pub struct Guide {
    igloo: Igloo,
    centers: Vec<Vec3>,
    means: Vec<Vec3>,
    /// Of each face, the mean of the three channels.
    brightness: Vec<f32>,
    /// Sine of the largest angle between a face's centre and a place in it.
    reach: f32,
    /// The same from everywhere: then the cosine alone has no noise.
    even: bool,
}

impl Guide {
    /// The igloo for `faces` faces a hemisphere wanted.
    pub fn igloo(faces: u32) -> Igloo {
        Igloo::new(Span::Sphere, faces.min(MOST_FACES))
    }

    /// A guide over an igloo with the mean radiance of each of its faces.
    pub fn new(igloo: Igloo, means: Vec<Vec3>) -> Self {
        let centers: Vec<Vec3> = (0..igloo.len()).map(|face| igloo.center(face)).collect();
        let corners = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0), (0.5, 0.0), (0.5, 1.0)];
        let nearest = |face: usize| {
            let cosines = corners.map(|(u, v)| igloo.direction(face, u, v).dot(centers[face]));
            cosines.into_iter().fold(1.0, f32::min)
        };
        let cosine = (0..igloo.len()).map(nearest).fold(1.0, f32::min);
        // A face of a quarter of the sphere or more reaches everywhere.
        let reach = if cosine > 0.0 { (1.0 - cosine * cosine).sqrt() + 1e-4 } else { 1.0 };
        let brightness: Vec<f32> = means.iter().map(|mean| mean.element_sum() / 3.0).collect();
        let even = means.iter().all(|&mean| mean.distance(means[0]) <= 1e-4 * means[0].length());
        Self { igloo, centers, means, brightness, reach, even }
    }

    /// A direction above a surface with this unit normal, and radiance times cosine over its density (per steradian); none where no light
    /// comes from above. The mean over uniform numbers in [0, 1)³ is the irradiance of the faces' means.
    pub fn sample(&self, normal: Vec3, [u, v, w]: [f32; 3]) -> Option<(Vec3, Vec3)> {
        if self.even {
            return Some((cosine_sample(normal, [v, w]), self.means[0] * PI));
        }
        let weight = |face: usize| self.brightness[face] * self.mean_cosine(self.centers[face].dot(normal));
        let total: f32 = (0..self.means.len()).map(weight).sum();
        let mut left = u * total;
        let mut chosen = None;
        for face in 0..self.means.len() {
            let weight = weight(face);
            if weight > 0.0 {
                // The last of them also takes what rounding leaves.
                chosen = Some((face, weight));
                if left < weight {
                    break;
                }
                left -= weight;
            }
        }
        let (face, weight) = chosen?;
        let direction = self.igloo.direction(face, v, w);
        let cosine = direction.dot(normal);
        let density = weight / total / self.igloo.face_solid_angle();
        (cosine > 0.0 && density > 0.0).then(|| (direction, self.means[face] * (cosine / density)))
    }

    /// About the mean of max(0, cosine) over a face whose centre has this cosine; above zero wherever a part of the face is above the horizon.
    fn mean_cosine(&self, center: f32) -> f32 {
        let s = self.reach;
        if center >= s { center } else { (center + s).max(0.0).powi(2) / (4.0 * s) }
    }
}

/// A direction around a normal with a density of cosine / π.
pub(super) fn cosine_sample(normal: Vec3, [v, w]: [f32; 2]) -> Vec3 {
    let (sin, cos) = (2.0 * PI * v).sin_cos();
    let radius = w.sqrt();
    let frame: Mat3 = frame_around(normal);
    frame * Vec3::new(radius * cos, radius * sin, (1.0 - w).sqrt())
}

#[cfg(test)]
mod tests;
