//! F and the lights of Λ: along the tangent, at grazing angles, at the light itself, and from 1e-20 to 1e20.

use std::f64::consts::PI;
use std::sync::LazyLock;

use glam::Vec3;

use super::{Draw, Measured, Property, U32};
use crate::illumination::{DirectLight, RectLight};
use crate::shading::{Highlight, KajiyaKay, Lambert};

pub const PROPERTIES: &[Property] = &[
    Property { name: "hair: diffuse term", quick: 4000, check: diffuse },
    Property { name: "hair: highlight's energy", quick: 100, check: highlight },
    Property { name: "light: radiance of any size", quick: 4000, check: linear },
    Property { name: "light: a point's, however near", quick: 4000, check: point },
    Property { name: "light: a rectangle's, however near", quick: 2000, check: rectangle },
];

/// sin θ / π². The sine is √((1 - c)(1 + c)): c has 8 roundoffs (a dot product of unit vectors that are rounded themselves), so at the tangent,
/// where the truth is below √(2·8u), it may be anything below that; away from it the error is c · 8u / sin θ.
fn diffuse(draw: &mut Draw) -> Measured {
    let tangent = draw.direction().as_vec3().normalize();
    let tilt = draw.pick(&[0.0, 1e-8, 1e-6, 1e-3, 1.0]);
    let incoming =
        (tangent.as_dvec3() * draw.pick(&[-1.0, 1.0]) + tilt * draw.direction()).normalize_or(glam::DVec3::Y).as_vec3();
    // Without a highlight: its table is made once, not with each case.
    static SHAPE: LazyLock<Highlight> = LazyLock::new(|| Highlight::new(20.0));
    let hair = KajiyaKay::new(tangent, -incoming, Vec3::ONE, Vec3::ZERO, &SHAPE);
    let got = f64::from(hair.evaluate(incoming).x);
    let sine = tangent.as_dvec3().cross(incoming.as_dvec3()).length();
    let error = (got - sine / (PI * PI)).abs();
    let bound = (8.0 * U32 / sine.max(1e-12)).min((16.0 * U32).sqrt()) + 4.0 * U32;
    Measured { error, bound: bound / (PI * PI) }
}

/// ∫ of the highlight over the sphere is its albedo, for any exponent and view, to 1 %. The table has 128 steps of the view's angle θ, linear
/// between; next to the strand's own direction its entries go as 1/θ, where that is off by (step / θ)² / 8: .2 % at .1, a fourth at the first step.
fn highlight(draw: &mut Draw) -> Measured {
    let exponent = draw.scale(1.0, 1e4) as f32;
    let theta = draw.pick(&[0.0, 1e-7, 0.3, 1.0, 1.0]) * draw.between(0.0, PI);
    let shape = Highlight::new(exponent);
    let view = Vec3::new(theta.sin() as f32, 0.0, theta.cos() as f32);
    let hair = KajiyaKay::new(Vec3::Z, view, Vec3::ZERO, Vec3::ONE, &shape);
    let lobe = |theta_in: f64| {
        let direction = Vec3::new(theta_in.sin() as f32, 0.0, theta_in.cos() as f32);
        2.0 * PI * theta_in.sin() * f64::from(hair.evaluate(direction).x)
    };
    let got = super::truth::integral(lobe, 0.0, PI, 1024);
    Measured { error: (got - 1.0).abs(), bound: if theta.sin() < 0.1 { 0.25 } else { 0.01 } }
}

/// Light scales: by powers of two from 1e-20 to 1e20 to the bit.
fn linear(draw: &mut Draw) -> Measured {
    let factor = f32::powi(2.0, draw.between(-66.0, 66.0) as i32);
    let position = draw.direction().as_vec3() * draw.scale(1e-3, 3.0) as f32;
    let radiance = Vec3::new(0.2, 1.0, 0.7);
    let light = |radiance: Vec3| DirectLight::Point { position: Vec3::new(0.1, 2.0, 0.0), intensity: radiance };
    let lambert = Lambert { albedo: Vec3::splat(0.5) };
    let at = |radiance: Vec3| {
        light(radiance).incident(position).map_or(Vec3::ZERO, |i| i.irradiance * lambert.evaluate(i.toward.y))
    };
    let difference = at(radiance * factor) - at(radiance) * factor;
    Measured { error: f64::from(difference.abs().max_element()), bound: 0.0 }
}

/// I / r², finite and to 8 roundoffs wherever the light is not at the point: a light at the point gives none.
fn point(draw: &mut Draw) -> Measured {
    let position = draw.direction().as_vec3() * draw.pick(&[0.0, 1e-3, 1.0]) as f32;
    let offset = draw.direction().as_vec3() * draw.pick(&[0.0, 1e-30, 1e-25, 1e-20, 1e-10, 1e-7, 1e-3, 1.0]) as f32;
    let intensity = draw.scale(1e-20, 1e20) as f32;
    let light = position + offset;
    let to_light = light.as_dvec3() - position.as_dvec3();
    let distance2 = to_light.length_squared();
    let Some(incident) = (DirectLight::Point { position: light, intensity: Vec3::splat(intensity) }).incident(position)
    else {
        // Nearer than 1e-15 of the scene nothing arrives.
        return Measured { error: distance2.sqrt(), bound: 1.1e-15 };
    };
    let got = f64::from(incident.irradiance.x);
    let want = (f64::from(intensity) / distance2).min(f64::from(f32::MAX));
    let unit = (f64::from(incident.toward.length()) - 1.0).abs();
    Measured { error: ((got - want).abs() / want).max(unit), bound: 8.0 * U32 }
}

/// Never more than a hemisphere full of the light, nor anything that is not a number, also in its plane, on it and at its corner.
fn rectangle(draw: &mut Draw) -> Measured {
    let size = draw.scale(1e-6, 1e3) as f32;
    let radiance = draw.scale(1e-20, 1e20) as f32;
    let Some(light) = RectLight::new(Vec3::ZERO, Vec3::X * size, Vec3::Y * size, Vec3::splat(radiance)) else {
        return Measured { error: f64::INFINITY, bound: 0.0 };
    };
    let height = draw.pick(&[0.0, 1e-30, 1e-20, 1e-7, 1e-3, 1.0]) as f32 * size;
    let place = Vec3::new(draw.between(-0.6, 0.6) as f32 * size, draw.between(-0.6, 0.6) as f32 * size, height);
    let n = 8;
    let mut sum = 0.0_f64;
    for i in 0..n * n {
        let (u, v) = (((i % n) as f32 + 0.5) / n as f32, ((i / n) as f32 + 0.5) / n as f32);
        if let Some((incident, _)) = light.sample(place, u, v) {
            sum += f64::from(incident.irradiance.x) * f64::from(incident.toward.dot(-light.normal).abs());
        }
    }
    let most = 2.0 * PI * f64::from(radiance) * (1.0 + 8.0 * U32);
    let mean = sum / f64::from(n * n);
    Measured { error: if mean >= 0.0 { mean } else { f64::NAN }, bound: most }
}
