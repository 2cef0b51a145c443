//! Checks that every model of hair's reflection must pass.

use std::f64::consts::{PI, TAU};

use glam::Vec3;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::*;
use crate::hash::{hash, to_unit};

/// A direction at an inclination (towards the tangent) and azimuth around the tangent X, in radians.
pub fn direction(inclination: f64, azimuth: f64) -> Vec3 {
    let (sin, cos) = inclination.sin_cos();
    Vec3::new(sin as f32, (cos * azimuth.cos()) as f32, (cos * azimuth.sin()) as f32)
}

/// A strand along X, seen at an inclination.
pub fn seen(inclination: f64, color: Vec3) -> StrandPoint {
    StrandPoint { tangent: Vec3::X, view: direction(inclination, 0.3), color }
}

/// ∫ f dω by the midpoint rule over inclination and azimuth.
pub fn integral(rows: u32, columns: u32, mut f: impl FnMut(Vec3) -> Vec3) -> Vec3 {
    let mut sum = glam::DVec3::ZERO;
    for row in 0..rows {
        let inclination = PI * ((f64::from(row) + 0.5) / f64::from(rows) - 0.5);
        let area = inclination.cos() * PI / f64::from(rows) * TAU / f64::from(columns);
        for column in 0..columns {
            let azimuth = TAU * (f64::from(column) + 0.5) / f64::from(columns);
            sum += f(direction(inclination, azimuth)).as_dvec3() * area;
        }
    }
    sum.as_vec3()
}

/// The sampler's directions fall as its density says: the chi-squared test over 20 x 24 parts of equal area.
pub fn samples_follow_their_density(fibre: &dyn Fibre, at: &StrandPoint) {
    let (rows, columns, count, inner) = (20_usize, 24_usize, 100_000_u32, 16);
    let mut found = vec![0.0_f64; rows * columns];
    for n in 0..count {
        let random = [0, 1, 2, 3].map(|axis| to_unit(hash(&[n, axis, 77])));
        let Some(sampled) = fibre.sample(at, random) else { continue };
        let said = fibre.density(at, sampled.incoming);
        assert!((sampled.density / said - 1.0).abs() < 1e-3, "{} against {said}", sampled.density);
        assert!((sampled.incoming.length() - 1.0).abs() < 1e-5);
        let azimuth = f64::from(sampled.incoming.z).atan2(f64::from(sampled.incoming.y)).rem_euclid(TAU);
        let row = ((f64::from(sampled.incoming.x) + 1.0) * 0.5 * rows as f64) as usize;
        let column = (azimuth / TAU * columns as f64) as usize;
        found[row.min(rows - 1) * columns + column.min(columns - 1)] += 1.0;
    }
    let (mut statistic, mut degrees, mut total) = (0.0, 0, 0.0);
    let (mut rest, mut rest_found) = (0.0, 0.0);
    for row in 0..rows {
        for column in 0..columns {
            // Over the inclination, not its sine: next to the tangent a density may grow like 1 / cos.
            let [from, to] = [row, row + 1].map(|row| (2.0 * row as f64 / rows as f64 - 1.0).asin());
            let mut share = 0.0;
            for k in 0..inner * inner {
                let inclination = from + (to - from) * (f64::from(k / inner) + 0.5) / f64::from(inner);
                let across = (f64::from(k % inner) + 0.5) / f64::from(inner);
                let azimuth = TAU * (column as f64 + across) / columns as f64;
                let area = inclination.cos() * (to - from) * TAU / columns as f64 / f64::from(inner * inner);
                share += f64::from(fibre.density(at, direction(inclination, azimuth))) * area;
            }
            total += share;
            let (expected, found) = (share * f64::from(count), found[row * columns + column]);
            if expected < 10.0 {
                rest += expected;
                rest_found += found;
            } else {
                statistic += (found - expected).powi(2) / expected;
                degrees += 1;
            }
        }
    }
    assert!((total - 1.0).abs() < 5e-3, "the density adds up to {total}");
    if rest > 10.0 {
        statistic += (rest_found - rest) * (rest_found - rest) / rest;
        degrees += 1;
    }
    let p = ChiSquared::new(f64::from(degrees - 1)).expect("degrees").sf(statistic);
    assert!(p > 1e-4, "chi² = {statistic:.1} with {degrees} parts, p = {p:.2e}");
}

/// The mean of F over the density is the integral of F.
pub fn samples_find_the_albedo(fibre: &dyn Fibre, at: &StrandPoint, albedo: Vec3) {
    let count = 40_000;
    let (mut sum, mut squares) = (glam::DVec3::ZERO, glam::DVec3::ZERO);
    for n in 0..count {
        let random = [0, 1, 2, 3].map(|axis| to_unit(hash(&[n, axis, 78])));
        if let Some(sampled) = fibre.sample(at, random) {
            let value = (sampled.reflected / sampled.density).as_dvec3();
            sum += value;
            squares += value * value;
        }
    }
    let mean = sum / f64::from(count);
    let variance = squares / f64::from(count) - mean * mean;
    for axis in 0..3 {
        let error = (variance[axis].max(0.0) / f64::from(count)).sqrt();
        let off = (mean[axis] - f64::from(albedo[axis])).abs();
        assert!(off < 4.5 * error + 2e-3 * f64::from(albedo[axis]), "{mean} against {albedo}, error {error}");
        // The sampler is worth its name: a sample's deviation is of the order of the albedo.
        assert!(
            variance[axis].max(0.0).sqrt() < 2.0 * mean[axis],
            "{mean}: deviation {}",
            variance[axis].max(0.0).sqrt()
        );
    }
}
