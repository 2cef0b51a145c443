//! One tile of the picture: its fragments, their shading points in spatial order, and the pixels that they make.

use std::time::{Duration, Instant};

use glam::Vec3;

use super::clock::{Clock, Lap, Part};
use super::cpu;
use super::estimator::transmittance_rule;
use super::film::{EMPTY_DEPTH, Pixel};
use super::lamp_lit::{FromLamps, LampLit};
use super::lighting::{Lighting, Lit, Workspace};
use super::pass::{Pass, PointKey};
use super::progress::Progress;
use super::reflections::Reflections;
use super::specular::{Found, SpecularPixel, Through};
use super::statistics::NonFinite;
use crate::camera::Camera;
use crate::effects::ABSENT;
use crate::fragment::{
    HairFragment, HairSegment, MIN_WEIGHT, NO_SURFACE, PixelLayers, PixelRect, Rank, Shaded, SurfaceHit, SurfacePixel,
    scan_convert,
};
use crate::hair::StrandSample;
use crate::hash::{hash, hash64};
use crate::occlusion::Transmittance;
use crate::scene::Scene;
use crate::scene::description::{Layer, LayerChoice};
use crate::sequence::Sequence;
use crate::surface::{SurfacePoint, Surfaces};
use crate::tally::{self, Work};
use crate::z_order::z_order;

/// Half the side of the cube in which points are lit in spatial order, in render units: neighbours share their way through trees.
const SPACE: f32 = 2.0;
/// Purposes of random numbers.
const HAIR_POINT: u32 = 0x4841_4952;
const SURFACE_POINT: u32 = 0x5355_5246;
const DRAWN_LAYERS: u32 = 0x4C41_5952;
const SPECULAR: u32 = 0x5350_4543;
const MORE_SAMPLES: u32 = 0x4D4F_5245;

/// So many times the surface samples along the side of a pixel in which lamps light a surface unevenly.
const FINER: u32 = 4;

/// What all tiles of a picture share.
pub(super) struct Frame<'a> {
    pub scene: &'a Scene,
    pub lighting: &'a Lighting<'a>,
    pub rule: Transmittance,
    /// Layers a pixel that are shaded.
    pub layers: usize,
    pub layer_choice: LayerChoice,
    /// Surface samples along a pixel's side.
    pub per_side: u32,
    pub pass: Pass,
    /// Whether the environment is seen behind everything.
    pub background: bool,
    /// Whether the time of each pixel is wanted.
    pub costs: bool,
}

/// Buffers that one thread keeps from tile to tile.
#[derive(Default)]
pub(super) struct TileSpace {
    fragments: Vec<(u32, HairFragment)>,
    pub(super) hair: Vec<HairFragment>,
    pub(super) surfaces: SurfacePixel,
    met: Vec<SurfacePoint>,
    from_lamps: FromLamps,
    /// Directions of the rays that met these; only where there are mirrors or glass.
    directions: Vec<Vec3>,
    specular: SpecularPixel,
    pub(super) layers: PixelLayers,
    shaded: Vec<Shaded>,
    pub(super) points: Vec<Point>,
    order: Vec<(u32, u32)>,
    pub(super) workspace: Workspace,
}

/// A point to be shaded, and what it counts in its pixel.
pub(super) struct Point {
    /// Index of the pixel in the tile.
    pub pixel: u32,
    pub weight: f32,
    pub depth: f32,
    pub what: What,
    /// How it is seen, where it is by way of mirrors or glass.
    pub by_way: Option<ByWay>,
    /// Where lamps light it, if elsewhere in the pixel.
    pub lamp_lit: Option<LampLit>,
}

/// A point that the camera does not see itself.
#[derive(Clone, Copy)]
pub(super) struct ByWay {
    /// What the light is multiplied by beside the weight.
    pub tint: Vec3,
    /// Unit direction from the point to the mirror or glass.
    pub view: Vec3,
    /// Number among such points of the pixel.
    pub index: u32,
}

pub(super) enum What {
    Hair { segment: u32, sample: StrandSample },
    Surface(SurfacePoint),
}

/// A finished tile.
#[derive(Default)]
pub(super) struct Tile {
    pub pixels: Vec<Pixel>,
    pub fragments: u64,
    pub hair_points: u64,
    pub surface_points: u64,
    pub fragment_time: Duration,
    pub clock: Clock,
    /// What was seen in mirrors and glass.
    pub specular: Reflections,
    pub non_finite: Vec<NonFinite>,
    /// CPU time of each pixel, in microseconds; empty unless wanted.
    pub costs: Vec<f32>,
}

impl<'a> Frame<'a> {
    /// A scene's picture, sampled as the scene says.
    pub fn new(lighting: &'a Lighting<'a>) -> Self {
        let scene = lighting.scene();
        let sampling = &scene.description().sampling;
        Self {
            scene,
            lighting,
            rule: transmittance_rule(scene),
            layers: sampling.layers as usize,
            layer_choice: sampling.layer_choice,
            per_side: f64::from(sampling.surface_samples).sqrt().ceil() as u32,
            pass: Pass::of(sampling.seed, 0),
            background: scene.description().camera.background,
            costs: scene.description().output.layers.contains(&Layer::Cost),
        }
    }

    fn camera(&self) -> &Camera {
        &self.scene.camera
    }

    /// A hair segment in camera space.
    pub fn segment(&self, index: u32) -> HairSegment {
        let hair = &self.scene.hair;
        let ends = hair.ends(index as usize).map(|end| self.camera().to_camera(end));
        HairSegment { ends, widths: hair.widths(index as usize), index }
    }

    /// Renders the pixels of `rect`; `segments` are those that may touch it. `None` if the work was cancelled.
    pub fn render(
        &self,
        rect: &PixelRect,
        segments: &[u32],
        space: &mut TileSpace,
        progress: &dyn Progress,
    ) -> Option<Tile> {
        if progress.cancelled() {
            return None;
        }
        let (begin, cpu) = (Instant::now(), cpu::thread());
        let mut tile = Tile::default();
        space.workspace.clock = Clock::default();
        self.collect_points(rect, segments, space, &mut tile);
        tile.fragment_time = begin.elapsed();
        let mut times = vec![Duration::ZERO; if self.costs { tile.pixels.len() } else { 0 }];
        space.workspace.specular = Reflections::default();
        let mut lit = vec![Lit::default(); space.points.len()];
        space.order.clear();
        space
            .order
            .extend(space.points.iter().enumerate().map(|(i, point)| (z_order(point.position(), SPACE), i as u32)));
        space.order.sort_unstable();
        for &(_, index) in &space.order {
            if progress.cancelled() {
                return None;
            }
            let point = &space.points[index as usize];
            let start = self.costs.then(Instant::now);
            lit[index as usize] = self.light(rect, point, &mut space.workspace);
            if let Some(start) = start {
                times[point.pixel as usize] += start.elapsed();
            }
        }
        tile.clock = space.workspace.clock;
        tile.specular.add(&space.workspace.specular);
        self.sum_up(rect, &space.points, &lit, &mut tile);
        tile.take_time(begin.elapsed(), cpu::thread().saturating_sub(cpu), &times, &space.fragments);
        Some(tile)
    }

    /// Stage 1 alone: the points of the pixels of `rect`, pixel by pixel; `segments` are those that may touch it.
    pub fn points<'t>(&self, rect: &PixelRect, segments: &[u32], space: &'t mut TileSpace) -> &'t [Point] {
        self.collect_points(rect, segments, space, &mut Tile::default());
        &space.points
    }

    /// Stage 1: the points of all pixels, and the pixels' alpha and background.
    fn collect_points(&self, rect: &PixelRect, segments: &[u32], space: &mut TileSpace, tile: &mut Tile) {
        let width = rect.max[0] - rect.min[0];
        let projection = self.camera().projection();
        space.fragments.clear();
        space.points.clear();
        for &segment in segments {
            scan_convert(&self.segment(segment), &projection, rect, |x, y, fragment| {
                space.fragments.push(((y - rect.min[1]) * width + x - rect.min[0], fragment));
            });
        }
        // Stable: the fragments of a pixel stay in the order of their segments.
        space.fragments.sort_by_key(|(pixel, _)| *pixel);
        tile.fragments = space.fragments.len() as u64;
        tally::add(Work::HairFragments, tile.fragments);
        let mut next = 0;
        for index in 0..width * (rect.max[1] - rect.min[1]) {
            let end = next + space.fragments[next..].partition_point(|(pixel, _)| *pixel == index);
            space.hair.clear();
            space.hair.extend(space.fragments[next..end].iter().map(|(_, fragment)| *fragment));
            next = end;
            let place = rect.at(index as usize);
            let mut pixel = self.collect_pixel(index, place, space);
            if self.lighting.effects().specular {
                self.collect_by_way(index, place, space, &mut pixel);
                tile.specular.add(&space.specular.seen);
            }
            tile.pixels.push(pixel);
        }
    }

    fn collect_pixel(&self, index: u32, pixel: [u32; 2], space: &mut TileSpace) -> Pixel {
        self.meet_surfaces(pixel, space);
        let TileSpace { hair, surfaces, met, from_lamps, layers, shaded, points, .. } = space;
        let transparency = |fragment: &HairFragment| self.transparency(fragment);
        layers.composite(hair, transparency, &surfaces.samples, surfaces.groups.len());
        match self.layer_choice {
            LayerChoice::Seen => layers.select(self.layers, Rank::Seen, MIN_WEIGHT, shaded),
            LayerChoice::Gamma => layers.select(self.layers, Rank::Gamma, MIN_WEIGHT, shaded),
            LayerChoice::Drawn => {
                let sequence = self.pass.sequence;
                let random = sequence.number(hash64(&[DRAWN_LAYERS, sequence.seed, pixel[0], pixel[1]]));
                layers.draw(self.layers, random, shaded);
            }
        }
        for chosen in shaded.iter() {
            let fragment = &hair[chosen.fragment as usize];
            let sample = self.scene.hair.sample(fragment.segment as usize, fragment.u);
            let what = What::Hair { segment: fragment.segment, sample };
            points.push(Point {
                pixel: index,
                weight: chosen.weight as f32,
                depth: fragment.depth,
                what,
                by_way: None,
                lamp_lit: None,
            });
        }
        for (number, (group, &weight)) in surfaces.groups.iter().zip(&layers.group_weights).enumerate() {
            if weight <= 0.0 {
                continue;
            }
            let (at, lamp_lit) = if self.layer_choice == LayerChoice::Drawn {
                let (gathers, lit) = from_lamps.draw(&surfaces.samples, number, self.pass.sequence, pixel);
                (gathers, lit.map(|(at, counts)| LampLit { at: met[at], counts }))
            } else {
                (group.hit.index as usize, None)
            };
            let (weight, depth, what) = (weight as f32, group.hit.depth, What::Surface(met[at]));
            points.push(Point { pixel: index, weight, depth, what, by_way: None, lamp_lit });
        }
        let beauty = if self.background && layers.background() > 0.0 {
            let (_, direction) = self.camera().ray(f64::from(pixel[0]) + 0.5, f64::from(pixel[1]) + 0.5);
            self.lighting.illumination().environment.radiance(direction) * layers.background() as f32
        } else {
            Vec3::ZERO
        };
        Pixel { alpha: layers.alpha as f32, beauty, ..Pixel::default() }
    }

    /// The surfaces in a pixel; with more samples where layers are drawn and lamps light one of them unevenly: those that tell so are not among them, so that
    /// the mean stays right.
    fn meet_surfaces(&self, pixel: [u32; 2], space: &mut TileSpace) {
        let TileSpace { surfaces, met, directions, from_lamps, workspace, .. } = space;
        surfaces.samples.clear();
        surfaces.groups.clear();
        let Some(scene) = self.lighting.illumination().surfaces.as_ref().filter(|_| !ABSENT) else { return };
        let mut lap = Lap::start();
        let specular = self.lighting.effects().specular;
        let drawn = self.layer_choice == LayerChoice::Drawn;
        let few = self.pass.sequence;
        let many = Sequence { seed: hash(&[MORE_SAMPLES, few.seed]), ..few };
        for (per_side, sequence) in [(self.per_side, few), (FINER * self.per_side, many)] {
            met.clear();
            directions.clear();
            let hit = |origin, direction| {
                let hit = self.camera_ray(scene, origin, direction, met);
                directions.extend(hit.is_some_and(|_| specular).then_some(direction));
                hit
            };
            surfaces.gather(self.camera(), pixel, per_side, sequence, hit);
            if drawn {
                from_lamps.find(met, |point| self.lighting.light_of_lamps(point));
            }
            if !drawn || !from_lamps.uneven(&surfaces.samples, surfaces.groups.len()) {
                break;
            }
        }
        lap.ends(Part::CameraRays, &mut workspace.clock);
    }

    /// What the samples of a pixel see in mirrors and glass: points of their own, and the sky.
    fn collect_by_way(&self, index: u32, [x, y]: [u32; 2], space: &mut TileSpace, pixel: &mut Pixel) {
        let TileSpace { surfaces, met, directions, layers, points, specular, .. } = space;
        specular.clear();
        let hair = self.lighting.hair_rays().map(|rays| (rays, &self.scene.hair));
        let depth = self.scene.description().indirect.specular_depth;
        let through = Through { light: self.lighting.illumination(), hair, depth };
        let groups = surfaces.samples.iter().map(|sample| sample.group).filter(|&group| group != NO_SURFACE);
        for (sample, (group, (hit, direction))) in groups.zip(met.iter().zip(directions.iter())).enumerate() {
            if hit.optics.is_some() {
                let group = group as usize;
                let weight = layers.group_weights[group] / f64::from(surfaces.groups[group].samples);
                let key = hash(&[SPECULAR, self.pass.seed, x, y, sample as u32]);
                specular.follow(&through, hit, *direction, weight as f32, key);
            }
        }
        let mut count = 0;
        specular.choose(self.layers, hash(&[SPECULAR, self.pass.seed, x, y]), |seen, color| {
            let weight = color.element_sum() / 3.0;
            let what = match seen.found {
                Found::Surface(hit) => What::Surface(hit),
                Found::Hair { segment, u } => {
                    What::Hair { segment, sample: self.scene.hair.sample(segment as usize, u) }
                }
            };
            if weight > 0.0 {
                let by_way = Some(ByWay { tint: color / weight, view: seen.view, index: count });
                points.push(Point { pixel: index, weight, depth: 0.0, what, by_way, lamp_lit: None });
                count += 1;
            }
        });
        pixel.beauty += specular.sky;
        pixel.environment += specular.sky;
        pixel.unoccluded += specular.sky;
    }

    /// The first surface behind the near plane along a camera ray.
    fn camera_ray(
        &self,
        surfaces: &Surfaces,
        origin: Vec3,
        direction: Vec3,
        met: &mut Vec<SurfacePoint>,
    ) -> Option<SurfaceHit> {
        let slope = direction.dot(self.camera().forward().as_vec3());
        let hit = surfaces.closest(origin, direction, self.camera().near() as f32 / slope, f32::INFINITY)?;
        met.push(hit);
        Some(SurfaceHit {
            depth: hit.distance * slope,
            group: hit.finish,
            index: met.len() as u32 - 1,
            position: hit.position,
            normal: hit.normal,
        })
    }

    /// t of Eq. 7: one crossing's transmittance, or the power law of the length that is visible in the pixel.
    pub fn transparency(&self, fragment: &HairFragment) -> f32 {
        let segment = fragment.segment as usize;
        let [a, b] = self.scene.hair.ends(segment);
        1.0 - self.rule.opacity(self.scene.hair.transparency[segment], fragment.span * a.distance(b))
    }

    /// The hair object of a point on hair.
    pub fn object(&self, sample: &StrandSample) -> u16 {
        self.scene.hair.object[sample.on.strand as usize]
    }

    /// What names the random numbers of a point.
    pub fn key(&self, rect: &PixelRect, point: &Point) -> PointKey {
        let [x, y] = point.place(rect);
        let (purpose, index) = match &point.what {
            What::Hair { segment, .. } => (HAIR_POINT, *segment),
            What::Surface(hit) => (SURFACE_POINT, hit.triangle),
        };
        let Pass { seed, sequence } = self.pass;
        let named = |seed| hash(&[purpose, seed, x, y, index]);
        let key = PointKey { own: named(seed), sequence: Sequence { seed: named(sequence.seed), ..sequence } };
        // A mirror may show one triangle many times in a pixel.
        point.by_way.map_or(key, |by_way| key.part(SPECULAR, by_way.index))
    }

    pub fn light(&self, rect: &PixelRect, point: &Point, space: &mut Workspace) -> Lit {
        let key = self.key(rect, point);
        let position = point.position();
        let straight = || (self.camera().position().as_vec3() - position).normalize_or(Vec3::Z);
        let view = point.by_way.map_or_else(straight, |by_way| by_way.view);
        match &point.what {
            What::Hair { sample, .. } => self.lighting.hair(sample, self.object(sample), view, key, space),
            What::Surface(hit) => self.lighting.surface(hit, point.lamp_lit.as_ref(), key, space),
        }
    }

    /// Adds the points up in their own order, whatever the order in which they were lit.
    fn sum_up(&self, rect: &PixelRect, points: &[Point], lit: &[Lit], tile: &mut Tile) {
        let mut seen = vec![0.0_f32; tile.pixels.len()];
        let (mut pixel, mut sample) = (u32::MAX, 0);
        for (point, lit) in points.iter().zip(lit) {
            sample = if point.pixel == pixel { sample + 1 } else { 0 };
            pixel = point.pixel;
            match point.what {
                What::Hair { .. } => tile.hair_points += 1,
                What::Surface(_) => tile.surface_points += 1,
            }
            if !lit.is_finite() {
                let what = point.name();
                tile.non_finite.push(NonFinite { pixel: point.place(rect), sample: Some(sample), what });
                continue;
            }
            let pixel = &mut tile.pixels[point.pixel as usize];
            let weight = point.weight;
            if let Some(ByWay { tint, .. }) = point.by_way {
                pixel.direct += weight * tint * lit.direct;
                pixel.environment += weight * tint * lit.environment;
                pixel.unoccluded += weight * tint * lit.unoccluded;
                pixel.beauty += weight * tint * (lit.direct + lit.environment + lit.emission);
                // Alpha, depth and normal are of the mirror, which has a point of its own.
                continue;
            }
            seen[point.pixel as usize] += weight;
            pixel.direct += weight * lit.direct;
            pixel.environment += weight * lit.environment;
            pixel.unoccluded += weight * lit.unoccluded;
            pixel.beauty += weight * (lit.direct + lit.environment + lit.emission);
            pixel.occlusion += weight * lit.occlusion;
            pixel.depth += weight * point.depth;
            match &point.what {
                What::Hair { sample, .. } => pixel.tangent += weight * sample.tangent,
                What::Surface(hit) => pixel.normal += weight * hit.normal,
            }
        }
        let scene_unit = self.scene.space.scene_length(1.0) as f32;
        for (pixel, seen) in tile.pixels.iter_mut().zip(seen) {
            let anything = seen > 0.0;
            pixel.occlusion = if anything { pixel.occlusion / seen } else { 1.0 };
            pixel.depth = if anything { pixel.depth / seen * scene_unit } else { EMPTY_DEPTH };
            pixel.normal = pixel.normal.normalize_or_zero();
            pixel.tangent = pixel.tangent.normalize_or_zero();
        }
        // Sound points may add up to what is not: that is no less to be told.
        for (index, _) in tile.pixels.iter().enumerate().filter(|(_, pixel)| !pixel.is_finite()) {
            tile.non_finite.push(NonFinite {
                pixel: rect.at(index),
                sample: None,
                what: "the sum of its points".to_owned(),
            });
        }
    }
}

impl Tile {
    /// Scales what was timed on the wall to the thread's CPU time `cpu` in the tile's `wall` time, and shares out what no point was timed for.
    fn take_time(&mut self, wall: Duration, cpu: Duration, times: &[Duration], fragments: &[(u32, HairFragment)]) {
        let scale = cpu.as_secs_f64() / wall.as_secs_f64().max(1e-9);
        self.fragment_time = self.fragment_time.mul_f64(scale);
        self.clock.scale(scale);
        if times.is_empty() {
            return;
        }
        // Fragments take the rest, and each pixel as long as one of them.
        let mut counts = vec![1.0_f64; times.len()];
        fragments.iter().for_each(|(pixel, _)| counts[*pixel as usize] += 1.0);
        let rest = wall.saturating_sub(times.iter().sum()).as_secs_f64();
        let each = rest / counts.iter().sum::<f64>();
        let cost = |(time, count): (&Duration, &f64)| (1e6 * scale * (time.as_secs_f64() + each * count)) as f32;
        self.costs = times.iter().zip(&counts).map(cost).collect();
    }
}

impl Point {
    pub fn position(&self) -> Vec3 {
        match &self.what {
            What::Hair { sample, .. } => sample.position,
            What::Surface(hit) => hit.position,
        }
    }

    /// Column and row in the whole picture.
    pub fn place(&self, rect: &PixelRect) -> [u32; 2] {
        rect.at(self.pixel as usize)
    }

    pub fn name(&self) -> String {
        match &self.what {
            What::Hair { segment, sample } => format!("strand {}, segment {segment}", sample.on.strand),
            What::Surface(hit) => format!("triangle {}", hit.triangle),
        }
    }
}

impl Lit {
    pub(super) fn is_finite(&self) -> bool {
        let vectors = [self.direct, self.environment, self.unoccluded, self.emission];
        vectors.iter().all(|v| v.is_finite()) && self.occlusion.is_finite()
    }
}
