//! Light from infinitely far away, as averages over the faces of an igloo (paper, Eq. 9).
//!
//! Directions are in render space, whose axes are the scene's; a map has its own (see [`super::map::Mapping`]). Radiance in W/(m² sr), linear Rec.709.

use std::sync::Arc;

use glam::{Mat3, Vec3};

use super::{Map, Sources};
use crate::igloo::{Igloo, Span};

/// Where the radiance comes from. Directions are in the map's axes, y up.
#[derive(Clone, Debug)]
pub enum Radiance {
    /// The same from everywhere.
    Uniform(Vec3),
    /// Linear in the sine of the elevation.
    Gradient { zenith: Vec3, horizon: Vec3, nadir: Vec3 },
    /// A picture.
    Map(Map),
}

impl Radiance {
    /// What it holds, in bytes.
    pub fn bytes(&self) -> u64 {
        if let Self::Map(map) = self { size_of_val(&map.pixels[..]) as u64 } else { 0 }
    }

    /// Whether it is black everywhere.
    pub fn is_black(&self) -> bool {
        match self {
            Self::Uniform(color) => *color == Vec3::ZERO,
            Self::Gradient { zenith, horizon, nadir } => [zenith, horizon, nadir].iter().all(|c| **c == Vec3::ZERO),
            Self::Map(map) => map.pixels.iter().all(|pixel| *pixel == Vec3::ZERO),
        }
    }
}

/// The environment of a scene.
#[derive(Clone, Debug)]
pub struct Environment {
    radiance: Radiance,
    /// What is lit as lights of its own and is not in the averages.
    sources: Option<Arc<Sources>>,
    /// From render space to the map's axes.
    to_map: Mat3,
    /// Averages over the faces of a fine igloo: what faces of any orientation are filled from.
    cells: Vec<Cell>,
}

/// A small part of the sphere.
#[derive(Clone, Copy, Debug)]
struct Cell {
    direction: Vec3,
    /// Mean radiance times solid angle.
    energy: Vec3,
}

/// Cells a face: with fewer, assigning whole cells to faces shows in the picture.
const CELLS_PER_FACE: u32 = 24;

impl Environment {
    /// An environment for shading with igloos of `faces` faces a hemisphere. `to_map` turns render space to the map's axes; `sources` are
    /// those of the map in `radiance`.
    pub fn new(radiance: Radiance, sources: Option<Arc<Sources>>, to_map: Mat3, faces: u32) -> Self {
        let mut environment = Self { radiance, sources, to_map, cells: Vec::new() };
        if !matches!(environment.radiance, Radiance::Uniform(_)) {
            let igloo = Igloo::new(Span::Sphere, (faces.saturating_mul(CELLS_PER_FACE)).clamp(1_000, 100_000));
            let averages = environment.averages(&igloo);
            let weight = igloo.face_solid_angle();
            environment.cells = averages
                .iter()
                .enumerate()
                .map(|(face, &mean)| Cell { direction: igloo.center(face), energy: mean * weight })
                .collect();
        }
        environment
    }

    /// Radiance from a unit direction, bilinear between a map's pixels; the sources are in it.
    pub fn radiance(&self, direction: Vec3) -> Vec3 {
        let d = self.to_map * direction;
        match &self.radiance {
            Radiance::Uniform(color) => *color,
            Radiance::Gradient { zenith, horizon, nadir } => {
                let end = if d.y >= 0.0 { zenith } else { nadir };
                *horizon + (*end - *horizon) * d.y.abs().min(1.0)
            }
            Radiance::Map(map) => map.lookup(d),
        }
    }

    /// The small bright sources, which are not in the averages.
    pub fn sources(&self) -> Option<&Sources> {
        self.sources.as_deref()
    }

    /// From render space to the map's axes.
    pub fn to_map(&self) -> Mat3 {
        self.to_map
    }

    /// Mean radiance over each face of an igloo that stands unturned in render space, the sources left out.
    pub fn averages(&self, igloo: &Igloo) -> Vec<Vec3> {
        match &self.radiance {
            Radiance::Uniform(color) => vec![*color; igloo.len()],
            Radiance::Gradient { .. } => (0..igloo.len()).map(|face| self.sampled_average(igloo, face)).collect(),
            Radiance::Map(map) => {
                let rest = self.sources.as_ref().map_or(map, |sources| &sources.rest);
                rest.averages(igloo, self.to_map.transpose())
            }
        }
    }

    /// Mean radiance over each face of an igloo turned by `frame` (its axes as columns), from the cells: energy is conserved,
    /// a cell counts wholly in the face of its middle. `means` is resized to the faces.
    pub fn turned_averages(&self, igloo: &Igloo, frame: &Mat3, means: &mut Vec<Vec3>) {
        means.clear();
        if let Radiance::Uniform(color) = self.radiance {
            means.resize(igloo.len(), color);
            return;
        }
        means.resize(igloo.len(), Vec3::ZERO);
        let to_igloo = frame.transpose();
        for cell in &self.cells {
            let local = to_igloo * cell.direction;
            if local.z >= 0.0 || igloo.span() == Span::Sphere {
                means[igloo.face_of(local)] += cell.energy;
            }
        }
        let weight = 1.0 / igloo.face_solid_angle();
        for mean in means {
            *mean *= weight;
        }
    }

    fn sampled_average(&self, igloo: &Igloo, face: usize) -> Vec3 {
        const SIDE: u32 = 4;
        let offset = |i: u32| (i as f32 + 0.5) / SIDE as f32;
        let samples =
            (0..SIDE * SIDE).map(|i| self.radiance(igloo.direction(face, offset(i % SIDE), offset(i / SIDE))));
        samples.sum::<Vec3>() / (SIDE * SIDE) as f32
    }
}

/// The rotation from render space (the scene's axes) to a map's axes, y up: the scene's up axis goes to the map's +Y by the
/// shortest turn, then the map is turned about it by `rotate` degrees, counter-clockwise seen from above.
pub fn map_axes(up: Vec3, rotate: f64) -> Mat3 {
    let upright = Mat3::from_quat(glam::Quat::from_rotation_arc(up, Vec3::Y));
    Mat3::from_rotation_y(-rotate.to_radians() as f32) * upright
}

#[cfg(test)]
mod tests {
    use super::super::map::Mapping;
    use super::*;

    /// A map that is bright at one place.
    fn map(width: usize, height: usize, bright: impl Fn(usize, usize) -> f32) -> Radiance {
        let pixels = (0..width * height).map(|i| Vec3::splat(bright(i % width, i / width))).collect();
        Radiance::Map(Map::new(Mapping::LatLong, width, height, pixels))
    }

    #[test]
    fn the_centre_is_z_and_a_quarter_is_x() {
        let at = |column: usize| Environment::new(map(64, 32, |x, _| f32::from(x == column)), None, Mat3::IDENTITY, 10);
        assert!(at(32).radiance(Vec3::new(0.05, 0.0, 1.0).normalize()).x < 1.0 + 1e-6);
        let angle = |column: usize| {
            let (sin, cos) = (std::f32::consts::TAU * (column as f32 + 0.5) / 64.0).sin_cos();
            Vec3::new(sin, 0.0, -cos)
        };
        for column in [0, 15, 16, 31, 32, 50, 63] {
            assert!((at(column).radiance(angle(column)).x - 1.0).abs() < 1e-3, "{column}");
        }
        assert!(angle(16).distance(Vec3::X) < 0.06 && angle(32).distance(Vec3::Z) < 0.06);
        let top = Environment::new(map(64, 32, |_, y| f32::from(y < 2)), None, Mat3::IDENTITY, 10);
        assert!(top.radiance(Vec3::Y).x > 0.99 && top.radiance(-Vec3::Y).x < 0.01);
    }

    #[test]
    fn averages_conserve_the_energy_of_a_map_with_a_lamp() {
        let (width, height) = (128, 64);
        let lamp = |x: usize, y: usize| if (x, y) == (37, 20) { 3000.0 } else { 0.1 };
        let environment = Environment::new(map(width, height, lamp), None, map_axes(Vec3::Z, 33.0), 100);
        let mut exact = 0.0_f64;
        for y in 0..height {
            let theta = |k: usize| std::f64::consts::PI * (y + k) as f64 / height as f64;
            let solid_angle = std::f64::consts::TAU / width as f64 * (theta(0).cos() - theta(1).cos());
            exact += (0..width).map(|x| f64::from(lamp(x, y)) * solid_angle).sum::<f64>();
        }
        for faces in [20, 100, 1000] {
            let igloo = Igloo::new(Span::Sphere, faces);
            let sum: f32 = environment.averages(&igloo).iter().map(|m| m.x).sum();
            let energy = f64::from(sum * igloo.face_solid_angle());
            assert!((energy / exact - 1.0).abs() < 1e-4, "{faces} faces: {energy} against {exact}");
            let mut turned = Vec::new();
            environment.turned_averages(&igloo, &crate::igloo::frame_around(Vec3::X), &mut turned);
            let energy = f64::from(turned.iter().map(|m| m.x).sum::<f32>() * igloo.face_solid_angle());
            assert!((energy / exact - 1.0).abs() < 1e-4, "{faces} faces, turned: {energy} against {exact}");
        }
    }

    #[test]
    fn up_axes_keep_up_up_and_stay_right_handed() {
        for (up, _) in [(Vec3::X, 0), (Vec3::Y, 1), (Vec3::Z, 2)] {
            for rotate in [0.0, 90.0, 200.0] {
                let axes = map_axes(up, rotate);
                assert!((axes * up).distance(Vec3::Y) < 1e-6);
                assert!((axes.determinant() - 1.0).abs() < 1e-5);
            }
        }
        // Turned by 90 degrees counter-clockwise, what was at +Z (the centre) is at +X.
        let environment =
            Environment::new(map(64, 32, |x, _| f32::from((30..34).contains(&x))), None, map_axes(Vec3::Y, 90.0), 10);
        assert!(environment.radiance(Vec3::X).x > 0.9);
    }
}
