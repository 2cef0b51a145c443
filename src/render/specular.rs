//! Stage 1 in mirrors and glass: what the samples of a pixel that meet such surfaces see by way of them, and which of it is shaded.
//!
//! Each sample goes on by itself, so that edges in a mirror are as smooth as others. At the first borders of glass both ways are followed, then one
//! by chance. Hair that a way crosses is a layer each time (Eq. 7), the sky is added at once, and of all layers and surface points that the samples
//! of a pixel see a few are shaded, drawn by what they count, so that the mean is that of all.

use glam::Vec3;

use crate::fragment::draw;
use crate::hair::HairModel;
use crate::hash::{hash, to_unit, unit};
use crate::illumination::Illumination;
use crate::occlusion::HairRays;
use crate::occlusion::raytraced::{Met, Ray};
use crate::surface::SurfacePoint;
use crate::tally::{self, Work};

use super::reflections::Reflections;

/// Borders of glass at which both ways are followed.
const SPLIT: u32 = 2;
/// Surface points that are shaded at the most.
const POINTS: usize = 8;
/// Points of one finish are shaded as one where their normals differ by less than about 8 degrees
const SAME_NORMAL: f32 = 0.99;
/// and they lie as near to each other as this share of the way to them.
const SAME_PLACE: f32 = 0.02;
/// A way through hair ends where less than this is left of it.
const DARK: f32 = 1e-3;

/// Purposes of random numbers.
const WAY: u32 = 0x4D49_5257;
const CHOICE: u32 = 0x4D49_5243;

/// What a way came to.
#[derive(Clone, Copy, Debug)]
pub(super) enum Found {
    Surface(SurfacePoint),
    Hair { segment: u32, u: f32 },
}

/// Something that is seen by way of mirrors or glass.
#[derive(Clone, Copy, Debug)]
pub(super) struct Glimpse {
    pub found: Found,
    /// What it counts in the pixel.
    pub color: Vec3,
    /// Unit direction from it to where it is seen from.
    pub view: Vec3,
    /// Length of the way to it behind the first mirror or glass.
    length: f32,
}

/// What the samples of one pixel see by way of mirrors and glass. Kept from pixel to pixel.
#[derive(Debug, Default)]
pub(super) struct SpecularPixel {
    surfaces: Vec<Glimpse>,
    hair: Vec<Glimpse>,
    /// Light of the sky, weighted.
    pub sky: Vec3,
    pub seen: Reflections,
    branches: Vec<Branch>,
    met: Vec<Met>,
}

/// A ray that has met a mirror or glass.
#[derive(Clone, Copy, Debug)]
struct Branch {
    hit: SurfacePoint,
    direction: Vec3,
    color: Vec3,
    depth: u32,
    length: f32,
    key: u32,
}

/// What ways go through.
pub(super) struct Through<'a> {
    pub light: &'a Illumination,
    pub hair: Option<(&'a HairRays, &'a HairModel)>,
    /// Mirrors and glass that a way meets at the most.
    pub depth: u32,
}

impl SpecularPixel {
    /// Forgets the pixel before.
    pub fn clear(&mut self) {
        self.surfaces.clear();
        self.hair.clear();
        (self.sky, self.seen) = (Vec3::ZERO, Reflections::default());
    }

    /// Follows a sample of the weight `weight` that met a mirror or glass along a unit direction; `key` names its random numbers.
    pub fn follow(&mut self, through: &Through<'_>, hit: &SurfacePoint, direction: Vec3, weight: f32, key: u32) {
        self.seen.rays += f64::from(weight);
        self.branches.clear();
        self.branches.push(Branch { hit: *hit, direction, color: Vec3::splat(weight), depth: 0, length: 0.0, key });
        while let Some(branch) = self.branches.pop() {
            let Some(optics) = branch.hit.optics else { continue };
            if branch.depth == through.depth {
                let cut = branch.color.element_sum() / 3.0 * optics.density(branch.hit.outside);
                self.seen.cut += f64::from(cut);
                continue;
            }
            let ways = optics.ways(&branch.hit, branch.direction);
            let both = branch.depth < SPLIT && ways.refracted.is_some();
            let chosen = ways.choose(to_unit(hash(&[WAY, branch.key])));
            let first = if both { ways.reflected } else { chosen };
            for (index, way) in [Some(first), ways.refracted.filter(|_| both)].into_iter().flatten().enumerate() {
                let color = branch.color * way.share * way.squeeze;
                if color != Vec3::ZERO {
                    let key = hash(&[WAY, branch.key, index as u32]);
                    self.go(
                        through,
                        Branch { color, depth: branch.depth + 1, key, ..branch },
                        way.origin,
                        way.direction,
                    );
                }
            }
        }
    }

    /// Goes on from a mirror or glass to what is met next.
    fn go(&mut self, through: &Through<'_>, branch: Branch, origin: Vec3, direction: Vec3) {
        tally::add(Work::SpecularWays, 1);
        let hit = through.light.surfaces.as_ref().and_then(|s| s.closest(origin, direction, 0.0, f32::INFINITY));
        let far = hit.as_ref().map_or(f32::INFINITY, |hit| hit.distance);
        let left = self.cross_hair(through, &branch, &Ray { origin, direction, far, on: None });
        let color = branch.color * left;
        if left == 0.0 {
            return;
        }
        let Some(hit) = hit else {
            self.sky += color * through.light.environment.radiance(direction);
            return;
        };
        let length = branch.length + hit.distance;
        if hit.optics.is_some() {
            self.branches.push(Branch { hit, direction, color, length, ..branch });
            return;
        }
        let same = |seen: &&mut Glimpse| {
            let Found::Surface(point) = &seen.found else { return false };
            point.finish == hit.finish
                && point.normal.dot(hit.normal) > SAME_NORMAL
                && point.position.distance(hit.position) < SAME_PLACE * length.min(seen.length)
        };
        match self.surfaces.iter_mut().find(same) {
            Some(seen) => seen.color += color,
            None => self.surfaces.push(Glimpse { found: Found::Surface(hit), color, view: -direction, length }),
        }
    }

    /// Takes the hair along a ray as layers, and gives what is left behind them.
    fn cross_hair(&mut self, through: &Through<'_>, branch: &Branch, ray: &Ray) -> f32 {
        let Some((rays, _)) = through.hair else { return 1.0 };
        rays.along(ray, &mut self.met);
        let mut left = 1.0;
        for &Met { segment, u, distance, opacity } in &self.met {
            let color = branch.color * (left * opacity);
            let found = Found::Hair { segment, u };
            self.hair.push(Glimpse { found, color, view: -ray.direction, length: branch.length + distance });
            left *= 1.0 - opacity;
            if left < DARK {
                return 0.0;
            }
        }
        left
    }

    /// What is shaded of it: at most `layers` layers of hair and as many surface points as that or eight.
    pub fn choose(&self, layers: usize, key: u32, mut take: impl FnMut(&Glimpse, Vec3)) {
        some(&self.surfaces, layers.max(POINTS), unit(&[CHOICE, key, 0]), &mut take);
        some(&self.hair, layers, unit(&[CHOICE, key, 1]), &mut take);
    }
}

/// Takes at most `count` of a list, each with the colour that it stands for: the expected colour of each is its own.
fn some(list: &[Glimpse], count: usize, random: f64, take: &mut impl FnMut(&Glimpse, Vec3)) {
    if list.len() <= count {
        list.iter().for_each(|seen| take(seen, seen.color));
        return;
    }
    let weight = |n: usize| f64::from(list[n].color.element_sum());
    draw(list.len(), weight, count, random, |n, stands_for| {
        take(&list[n], list[n].color * (stands_for / weight(n)) as f32)
    });
}

#[cfg(test)]
mod tests;
