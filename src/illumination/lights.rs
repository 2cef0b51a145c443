//! Lights inside the scene, in render space.

use glam::Vec3;

/// Squared distance, in render units, up to which a point lies at a light: below it squares lose their digits.
const AT_THE_LIGHT: f32 = 1e-30;

/// A light without extent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum DirectLight {
    /// Shines equally in all directions; `intensity` is W/sr, per square render unit.
    Point { position: Vec3, intensity: Vec3 },
    /// A point light that shines in a cone around the unit vector `axis`: `intensity` (as a point's) where the cosine to it is above
    /// `inner`, nothing below `outer`, and smoothly less between.
    Spot { position: Vec3, axis: Vec3, inner: f32, outer: f32, intensity: Vec3 },
    /// Parallel light; `toward` is the unit direction to the light, `irradiance` W/m² on a surface that faces it.
    Directional { toward: Vec3, irradiance: Vec3 },
}

/// A light without extent, and whether anything may be in its way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lamp {
    pub light: DirectLight,
    /// Whether surfaces and hair block its light; if not, they let all of it through.
    pub blocked: bool,
}

/// Light that arrives at a point if nothing is in the way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Incident {
    /// Unit direction to the light.
    pub toward: Vec3,
    /// Distance to the light, infinite for parallel light.
    pub distance: f32,
    /// Irradiance on a surface that faces the light.
    pub irradiance: Vec3,
}

impl DirectLight {
    /// The light at a point; nothing at the light itself.
    pub fn incident(&self, position: Vec3) -> Option<Incident> {
        match *self {
            Self::Point { position: light, intensity } => from_point(light, position, intensity),
            Self::Spot { position: light, axis, inner, outer, intensity } => {
                let incident = from_point(light, position, intensity)?;
                let inside = share_of_cone(-incident.toward.dot(axis), inner, outer);
                (inside > 0.0).then(|| Incident { irradiance: incident.irradiance * inside, ..incident })
            }
            Self::Directional { toward, irradiance } => Some(Incident { toward, distance: f32::INFINITY, irradiance }),
        }
    }
}

fn from_point(light: Vec3, position: Vec3, intensity: Vec3) -> Option<Incident> {
    let to_light = light - position;
    let distance2 = to_light.length_squared();
    if distance2 <= AT_THE_LIGHT {
        return None;
    }
    let distance = distance2.sqrt();
    // The largest number in place of infinity, which times a dark colour would be none.
    let irradiance = (intensity / distance2).min(Vec3::splat(f32::MAX));
    Some(Incident { toward: to_light / distance, distance, irradiance })
}

/// How much of a spot's intensity there is at a cosine to its axis: Hermite's cubic between the cosines of its edge.
pub(super) fn share_of_cone(cosine: f32, inner: f32, outer: f32) -> f32 {
    if cosine <= outer {
        return 0.0;
    }
    let x = if inner > outer { ((cosine - outer) / (inner - outer)).min(1.0) } else { 1.0 };
    x * x * (3.0 - 2.0 * x)
}

/// A rectangle that shines from the side of its normal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RectLight {
    /// The corner from which the sides start.
    pub corner: Vec3,
    pub edge_u: Vec3,
    pub edge_v: Vec3,
    /// Unit normal, along edge_u x edge_v.
    pub normal: Vec3,
    /// Area, in square render units.
    pub area: f32,
    /// Radiance, W/(m² sr).
    pub radiance: Vec3,
}

impl RectLight {
    /// A light around `center`; `None` where the sides span no area.
    pub fn new(center: Vec3, edge_u: Vec3, edge_v: Vec3, radiance: Vec3) -> Option<Self> {
        let across = edge_u.cross(edge_v);
        let area = across.length();
        (area > 0.0).then(|| Self {
            corner: center - 0.5 * (edge_u + edge_v),
            edge_u,
            edge_v,
            normal: across / area,
            area,
            radiance,
        })
    }

    /// The light from the point at (u, v) in [0, 1)² of the rectangle, and how many steradians stand for the whole rectangle there:
    /// `cos θ A / r²` (area measure turned to solid angle).
    pub fn sample(&self, position: Vec3, u: f32, v: f32) -> Option<(Incident, f32)> {
        let to_light = self.corner + self.edge_u * u + self.edge_v * v - position;
        let distance2 = to_light.length_squared();
        if distance2 <= AT_THE_LIGHT {
            return None;
        }
        let distance = distance2.sqrt();
        let toward = to_light / distance;
        let cosine = -toward.dot(self.normal);
        if cosine <= 0.0 || !cosine.is_finite() {
            return None;
        }
        // Nearer than the rectangle's own size the point rule overshoots; no light fills more than the hemisphere it is seen in.
        let solid_angle = (self.area * cosine / distance2).min(std::f32::consts::TAU);
        Some((Incident { toward, distance, irradiance: self.radiance * solid_angle }, solid_angle))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_point_light_falls_off_with_the_square() {
        let light = DirectLight::Point { position: Vec3::Y * 2.0, intensity: Vec3::splat(8.0) };
        let here = light.incident(Vec3::ZERO).expect("not at the light");
        assert_eq!((here.toward, here.distance, here.irradiance), (Vec3::Y, 2.0, Vec3::splat(2.0)));
        assert_eq!(light.incident(Vec3::Y * 2.0), None);
    }

    #[test]
    fn a_spot_is_a_point_light_that_fades_at_its_edge() {
        let position = Vec3::Y * 2.0;
        let cos = |degrees: f32| degrees.to_radians().cos();
        let spot = DirectLight::Spot {
            position,
            axis: -Vec3::Y,
            inner: cos(10.0),
            outer: cos(20.0),
            intensity: Vec3::splat(8.0),
        };
        let point = DirectLight::Point { position, intensity: Vec3::splat(8.0) };
        let at = |degrees: f32| Vec3::new(2.0 * degrees.to_radians().tan(), 0.0, 0.0);
        let share = |degrees: f32| {
            let all = point.incident(at(degrees)).expect("not at the light");
            spot.incident(at(degrees)).map_or(0.0, |incident| {
                assert_eq!((incident.toward, incident.distance), (all.toward, all.distance));
                incident.irradiance.x / all.irradiance.x
            })
        };
        assert_eq!([0.0, 9.9, 20.1, 60.0].map(share), [1.0, 1.0, 0.0, 0.0]);
        let halfway = (0.5 * (cos(10.0) + cos(20.0))).acos().to_degrees();
        assert!((share(halfway) - 0.5).abs() < 1e-3);
        let shares: Vec<f32> = (10..=20).map(|degrees| share(degrees as f32)).collect();
        assert!(shares.windows(2).all(|s| s[1] < s[0]), "{shares:?}");
        assert_eq!(spot.incident(Vec3::Y * 3.0), None, "dark behind");
    }

    #[test]
    fn a_square_light_has_the_closed_form_of_its_irradiance() {
        // Irradiance at distance z on the axis of a square of half side a, parallel to it:
        // E = 4 L (a / √(a² + z²)) atan(a / √(a² + z²)), times cosines already inside (Siegel and Howell, C-11).
        let (a, z) = (0.5_f32, 0.8_f32);
        let light = RectLight::new(Vec3::Y * z, Vec3::X * 2.0 * a, Vec3::Z * 2.0 * a, Vec3::ONE).expect("an area");
        assert!(light.normal.distance(-Vec3::Y) < 1e-6);
        let n = 64;
        let mut sum = 0.0;
        for i in 0..n * n {
            let (u, v) = (((i % n) as f32 + 0.5) / n as f32, ((i / n) as f32 + 0.5) / n as f32);
            let (incident, _) = light.sample(Vec3::ZERO, u, v).expect("in front");
            sum += incident.irradiance.x * incident.toward.y / (n * n) as f32;
        }
        let root = (a * a + z * z).sqrt();
        let want = 4.0 * a / root * (a / root).atan();
        assert!((sum / want - 1.0).abs() < 1e-3, "{sum} against {want}");
        assert!(light.sample(Vec3::Y, 0.5, 0.5).is_none(), "dark behind");
    }
}
