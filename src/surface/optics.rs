//! Mirrors and clear glass: where light goes on from them, and how much of it.
//!
//! The geometry is computed in `f64`: near the critical angle and at grazing angles differences of squares cancel. Shares are of power; radiance
//! that crosses into a medium also changes by the squared ratio of the indices (light is squeezed into a narrower cone).

use glam::{DVec3, Vec3};

use super::{SurfacePoint, lifted};

/// What a surface that is not diffuse does with light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Optics {
    /// Reflects this share, 0 to 1.
    Mirror { reflectance: Vec3 },
    /// The border of a clear body, its outside where the triangles' normals point to. `transmission` is the share, 0 to 1, that goes in and out
    /// again, beside what is reflected: each crossing takes its root.
    Glass { ior: f32, transmission: Vec3 },
}

/// A way on from a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Way {
    pub origin: Vec3,
    /// Unit direction.
    pub direction: Vec3,
    /// Share of the power that goes this way.
    pub share: Vec3,
    /// What radiance that comes back along this way is multiplied by on top of `share`: 1 unless the way leads into another medium.
    pub squeeze: f32,
}

/// All ways on from a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ways {
    pub reflected: Way,
    pub refracted: Option<Way>,
    /// Share that is reflected before any colour.
    pub fresnel: f32,
}

/// Share of unpolarised light that a border between clear media reflects (Fresnel). `cosine` is that of the angle of incidence, 0 to 1; `eta` the
/// index behind the border over that before it. 1 beyond the critical angle.
pub fn fresnel(cosine: f64, eta: f64) -> f64 {
    let cosine = cosine.clamp(0.0, 1.0);
    // cos² of the refracted angle, times eta²: with 1 - cos² = (1 - cos)(1 + cos) its digits are kept near the normal.
    let inside2 = (eta - 1.0) * (eta + 1.0) + cosine * cosine;
    if inside2 <= 0.0 {
        return 1.0;
    }
    let inside = inside2.sqrt();
    let across = (cosine - inside) / (cosine + inside);
    let along = (eta * eta * cosine - inside) / (eta * eta * cosine + inside);
    0.5 * (across * across + along * along)
}

/// The mirrored direction.
pub fn reflect(direction: DVec3, normal: DVec3) -> DVec3 {
    (direction - 2.0 * direction.dot(normal) * normal).normalize()
}

/// The refracted direction (Snell's law), the normal on the side that light comes from; none beyond the critical angle. `eta` as in [`fresnel`].
pub fn refract(direction: DVec3, normal: DVec3, eta: f64) -> Option<DVec3> {
    let cosine = -direction.dot(normal);
    let inside2 = (eta - 1.0) * (eta + 1.0) + cosine * cosine;
    (inside2 > 0.0).then(|| ((direction + normal * (cosine - inside2.sqrt())) / eta).normalize())
}

impl Optics {
    /// How much more radiance there is on the side of the surface where a ray meets it than outside, under the same light: the index squared in glass.
    pub fn density(&self, outside: bool) -> f32 {
        match *self {
            Self::Glass { ior, .. } if !outside => ior * ior,
            _ => 1.0,
        }
    }

    /// Where light that comes along a unit direction goes on from a point of such a surface.
    ///
    /// Directions turn about the shading normal, so that a tessellated sphere is round; about the triangle's own where that would lead to the wrong side.
    pub fn ways(&self, point: &SurfacePoint, direction: Vec3) -> Ways {
        let incoming = direction.as_dvec3().normalize();
        let [smooth, flat] = [point.normal, point.flat_normal].map(|normal| normal.as_dvec3().normalize());
        let side = |way: DVec3| way.dot(flat) > 0.0;
        let mirrored = Some(reflect(incoming, smooth)).filter(|way| side(*way)).unwrap_or_else(|| {
            let way = reflect(incoming, flat);
            // A ray within the plane of the triangle stays there by rounding.
            if side(way) { way } else { (way + 1e-6 * flat).normalize() }
        });
        let reflected = |share| Way {
            origin: lifted(point.position, point.flat_normal),
            direction: mirrored.as_vec3(),
            share,
            squeeze: 1.0,
        };
        match *self {
            Self::Mirror { reflectance } => Ways { reflected: reflected(reflectance), refracted: None, fresnel: 1.0 },
            Self::Glass { ior, transmission } => {
                let ior = f64::from(ior);
                let eta = if point.outside { ior } else { 1.0 / ior };
                let through = refract(incoming, smooth, eta).map(|way| {
                    let straight = || refract(incoming, flat, eta).filter(|way| !side(*way)).unwrap_or(-flat);
                    if side(way) { straight() } else { way }
                });
                let share = if through.is_some() { fresnel(-incoming.dot(smooth), eta) } else { 1.0 } as f32;
                let refracted = through.map(|way| Way {
                    origin: lifted(point.position, -point.flat_normal),
                    direction: way.as_vec3(),
                    share: transmission.map(f32::sqrt) * (1.0 - share),
                    squeeze: (1.0 / (eta * eta)) as f32,
                });
                Ways { reflected: reflected(Vec3::splat(share)), refracted, fresnel: share }
            }
        }
    }
}

impl Ways {
    /// One of the ways by a uniform number in [0, 1), with the chance of its share before any colour; its `share` is over that chance.
    pub fn choose(&self, number: f32) -> Way {
        match self.refracted {
            Some(way) if number >= self.fresnel => Way { share: way.share / (1.0 - self.fresnel), ..way },
            Some(_) => Way { share: Vec3::ONE, ..self.reflected },
            None => self.reflected,
        }
    }
}

#[cfg(test)]
mod tests;
