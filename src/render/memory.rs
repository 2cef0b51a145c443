//! How much memory a run will take, told from headers and counts before any of it is asked for.
//!
//! Sums of what is held at the same time, in bytes: counts times the sizes of what is stored, and for the structures of Embree and the parser of OBJ
//! files what was measured (docs/robustness.md). It leaves out what only the work shows: how many tiles a segment touches beyond two,
//! fragments of a pixel. So it is near what is taken at most, and no bound.

use std::path::Path;

use serde::Serialize;
use thiserror::Error;

use super::film::Pixel;
use super::lighting::shared::SharedLight;
use super::output;
use crate::fragment::PixelRect;
use crate::hair::formats::{Extent, extent};
use crate::illumination::photon;
use crate::image;
use crate::occlusion::ClusterTree;
use crate::scene::Document;
use crate::scene::description::{
    self, Description, EffectName, IndirectMode, OcclusionMode, Shadows, Surface, SurfaceMaterial,
};
use crate::shadow::{self, deep};

/// The program, its libraries and their buffers.
const PROGRAM: u64 = 120 << 20;
/// What a thread keeps from tile to tile and from point to point.
const THREAD: u64 = 4 << 20;
/// A point of the model of all hair: position, width, length along the strand; and the segment that begins there.
const MODEL_POINT: u64 = 20 + 12;
/// Its colour, where some object's varies.
const POINT_COLOR: u64 = 12;
/// A segment for rays: vertex of four floats, index, depth, and Embree's tree while it is built, as measured.
const RAY_SEGMENT: u64 = 24 + 76;
/// A triangle and its share of vertices as they are held, and Embree's tree while it is built, as measured.
const TRIANGLE: u64 = 64 + 150;
/// Bytes that the reader of OBJ files holds for one byte of text, as measured.
const OBJ_BYTE: u64 = 12;
/// Bytes of an OBJ file for each triangle, at least, and so what a file may become.
const OBJ_TRIANGLE: u64 = 20;
/// Triangles of a sphere.
const SPHERE_TRIANGLES: u64 = 20_480;
/// Triangles of a teapot.
const TEAPOT_TRIANGLES: u64 = 43_056;
/// A pixel's sums over passes, in `f64`, and the means of its streams.
const PASS_PIXEL: u64 = 264;
/// A pixel that may be drawn to judge a picture: its light, its variance and its chance.
const DRAWN_PIXEL: u64 = 32;
/// A photon that is kept, and its share of the trees over them while they are built.
const PHOTON: u64 = 120;
/// A way of such a photon through the box around the hair; and a point on it, with its share of the tree while it is built.
const BEAM: u64 = 56;
const MARK: u64 = 56;
/// Surfaces of medium grey reflect a photon as often, on the average.
const PHOTON_ARRIVALS: u64 = 3;
/// Image tiles that a segment is listed in, two on the average, and their counters.
const BIN_SEGMENT: u64 = 8;

/// What is to be done with a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Work {
    /// All that it names is loaded.
    Check,
    /// Its hair is grown and written.
    Grow,
    /// Points of the picture are compared, all pixels or those of a window.
    Crosscheck { window: Option<PixelRect>, threads: usize },
    /// It is rendered, all pixels or those of a window.
    Render { window: Option<PixelRect>, threads: usize },
    /// The same to an error or a time, with so many sets of photons in all.
    RenderTo { window: Option<PixelRect>, threads: usize, photon_sets: u64 },
}

/// Something that takes memory.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Part {
    /// What it is, as a user knows it: `hair[0].file (1200000 points)`.
    #[serde(rename = "part")]
    pub what: String,
    pub bytes: u64,
}

/// What a run takes at its most.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Estimate {
    /// What is held at that time.
    pub parts: Vec<Part>,
}

/// A run would take more memory than it may.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error(
    "{scene}: some {} of memory are needed, more than the limit of {} ({limit_is}); most of it by {}: {}; ask for less, or raise the limit",
    amount(*.bytes), amount(*.limit), .largest.what, amount(.largest.bytes)
)]
pub struct OverLimit {
    pub scene: String,
    pub bytes: u64,
    pub limit: u64,
    /// Where the limit comes from.
    pub limit_is: &'static str,
    pub largest: Part,
}

impl Estimate {
    /// All parts together.
    pub fn bytes(&self) -> u64 {
        self.parts.iter().fold(0, |sum, part| sum.saturating_add(part.bytes))
    }

    /// An error where it is more than `limit`; `limit_is` says where that comes from.
    ///
    /// # Errors
    /// [`OverLimit`], which names limit, estimate and the largest part.
    pub fn within(&self, limit: u64, limit_is: &'static str, scene: &Path) -> Result<(), OverLimit> {
        let bytes = self.bytes();
        let Some(largest) = self.parts.iter().max_by_key(|part| part.bytes).filter(|_| bytes > limit) else {
            return Ok(());
        };
        Err(OverLimit { scene: scene.display().to_string(), bytes, limit, limit_is, largest: largest.clone() })
    }

    fn add(&mut self, what: impl Into<String>, bytes: u64) {
        if bytes > 0 {
            self.parts.push(Part { what: what.into(), bytes });
        }
    }
}

/// An amount of memory as people write it: 3.25 GiB, 800 MiB.
pub fn amount(bytes: u64) -> String {
    let [mib, gib] = [20, 30].map(|shift| bytes as f64 / f64::from(1_u32 << shift));
    match bytes {
        0..0x10_0000 => format!("{bytes} bytes"),
        0x10_0000..0x4000_0000 => format!("{mib:.0} MiB"),
        _ => format!("{gib:.2} GiB"),
    }
}

/// What `work` on a scene takes. Files are looked at, not read: those that cannot be count nothing, and are complained of when they are read.
pub fn estimate(document: &Document, work: Work) -> Estimate {
    let counts = Counts::of(document);
    let loading = counts.loading(work);
    let (window, threads, film, photon_sets) = match work {
        Work::Check | Work::Grow => return loading,
        Work::Crosscheck { window, threads } => (window, threads, false, 1),
        Work::Render { window, threads } => (window, threads, true, 1),
        Work::RenderTo { window, threads, photon_sets } => (window, threads, true, photon_sets),
    };
    let rendering = counts.rendering(document, window, threads, film, photon_sets);
    if loading.bytes() > rendering.bytes() { loading } else { rendering }
}

/// A hair object.
struct Hair {
    what: String,
    grown: bool,
    extent: Extent,
}

/// What is in a scene.
struct Counts {
    hair: Vec<Hair>,
    /// Bytes of a point of the model of all hair.
    model_point: u64,
    /// What each surface is, its triangles and the bytes of its file.
    surfaces: Vec<(String, u64, u64)>,
    /// What the environment map is, its pixels and all its floats.
    map: Option<(String, u64, u64)>,
}

impl Counts {
    fn of(document: &Document) -> Self {
        let description = &document.description;
        let hair = description.hair.iter().enumerate().filter_map(|(index, hair)| {
            if let Some(file) = &hair.file {
                let extent = extent(&document.resolve(file)).unwrap_or_default();
                let what = format!("hair[{index}].file ({} points)", extent.points);
                return Some(Hair { what, grown: false, extent });
            }
            let grow = hair.grow.as_ref()?;
            let (strands, each) = (u64::from(grow.count), u64::from(grow.segments) + 1);
            let points = strands * each;
            let what = format!("hair[{index}].grow ({strands} strands of {each} points)");
            Some(Hair {
                what,
                grown: true,
                extent: Extent { strands, points, bytes: 16 * (points + strands), file_bytes: 0 },
            })
        });
        let surfaces =
            description.surface.iter().enumerate().map(|(index, surface)| surface_counts(document, index, surface));
        let map = description.environment.file.as_ref().and_then(|file| {
            let info = image::info(&document.resolve(file)).ok()?;
            let pixels = u64::from(info.width) * u64::from(info.height);
            // No larger map is read.
            let floats = (pixels * info.channels.len() as u64).min(crate::scene::environment::MAX_BYTES / 4);
            let what = format!("environment.file ({}x{} pixels)", info.width, info.height);
            Some((what, pixels.min(floats), floats))
        });
        let one_color = |hair: &description::Hair| match &hair.grow {
            Some(grow) => grow.color_variation == 0.0,
            // A file may have colours of its own.
            None => hair.color.is_some(),
        };
        let varies =
            !description.hair.iter().all(one_color) || description.effects.forced.contains(&EffectName::ColorVariation);
        let model_point = MODEL_POINT + if varies { POINT_COLOR } else { 0 };
        Self { hair: hair.collect(), model_point, surfaces: surfaces.collect(), map }
    }

    /// Points of all hair.
    fn points(&self) -> u64 {
        self.hair.iter().map(|hair| hair.extent.points).sum()
    }

    /// While what the scene names is loaded: all strands of files, one grown object at a time, the model of all hair, and the meshes.
    fn loading(&self, work: Work) -> Estimate {
        let mut sum = Estimate::default();
        sum.add("the program itself", PROGRAM);
        // Written hair is joined to one; hair that is drawn is copied into the model.
        let copy = if work == Work::Grow { 40 } else { self.model_point };
        let largest = self.hair.iter().filter(|hair| hair.grown).map(|hair| hair.extent.bytes).max().unwrap_or(0);
        let reading = self.hair.iter().map(|hair| hair.extent.file_bytes).max().unwrap_or(0);
        for hair in &self.hair {
            let held = match hair.grown {
                false => hair.extent.bytes + if hair.extent.file_bytes == reading { reading } else { 0 },
                true if work == Work::Grow || hair.extent.bytes == largest => hair.extent.bytes,
                true => 0,
            };
            let copied = if hair.grown || work != Work::Grow { copy * hair.extent.points } else { 0 };
            sum.add(&*hair.what, held + copied);
        }
        for (what, triangles, file_bytes) in &self.surfaces {
            sum.add(&**what, 2 * 64 * triangles + OBJ_BYTE * file_bytes);
        }
        if let Some((what, pixels, floats)) = self.map.as_ref().filter(|_| work != Work::Grow) {
            sum.add(&**what, 12 * pixels + 4 * floats);
        }
        sum
    }

    /// While it is rendered: the model, the structures over it, the film and the pixels of finished tiles.
    fn rendering(
        &self,
        document: &Document,
        window: Option<PixelRect>,
        threads: usize,
        film: bool,
        photon_sets: u64,
    ) -> Estimate {
        let description = &document.description;
        // A finished map is less than half of what building it takes.
        let all_sets = |building: u64| building + (photon_sets - 1) * building / 2;
        let (mode, points) = (description.occlusion.mode, self.points());
        let mut sum = Estimate::default();
        sum.add("the program itself", PROGRAM + THREAD * threads as u64);
        for hair in &self.hair {
            sum.add(&*hair.what, self.model_point * hair.extent.points);
        }
        if points > 0 && matches!(mode, OcclusionMode::Igloo | OcclusionMode::Auto) {
            // Ordering takes 16 bytes a segment.
            sum.add(
                format!("the tree of clusters over {points} segments"),
                ClusterTree::bytes_for(points) + 16 * points,
            );
        }
        let light = &description.light;
        let mut shadows = (light.point.iter().map(|light| light.shadows))
            .chain(light.spot.iter().map(|light| light.shadows))
            .chain(light.directional.iter().map(|light| light.shadows));
        // Renders to an error, which have several sets of photons, have references with rays in place of maps.
        let to_error = photon_sets > 1;
        let raytraced_shadows = shadows.any(|shadows| shadows == Shadows::Raytraced || to_error && shadows.is_map());
        let occluded =
            mode != OcclusionMode::None && (mode != OcclusionMode::Igloo || description.occlusion.wants_calibration());
        if points > 0 && (occluded || raytraced_shadows || !self.surfaces.is_empty() && mode != OcclusionMode::None) {
            sum.add(format!("Embree's tree over {points} segments"), RAY_SEGMENT * points);
        }
        if points > 0 {
            add_maps(description, threads, &mut sum);
        }
        for (what, triangles, _) in &self.surfaces {
            sum.add(&**what, TRIANGLE * triangles);
        }
        if let Some((what, pixels, _)) = &self.map {
            // The illumination keeps one of its own.
            sum.add(&**what, 2 * 12 * pixels);
        }
        if !self.surfaces.is_empty() && description.indirect.mode == IndirectMode::Photons {
            let photons = u64::from(description.indirect.photons);
            let kept = (PHOTON_ARRIVALS * photons).min(photon::MOST as u64);
            sum.add(format!("the map of {photons} photons"), all_sets(PHOTON * kept));
        }
        let [width, height] = description.camera.resolution.map(f64::from);
        let shares =
            points > 0 && description.indirect.sharing > 0.0 && description.indirect.mode != IndirectMode::None;
        if shares && !self.surfaces.is_empty() {
            let bytes = SharedLight::bytes_for(width * height, 2 * description.occlusion.face_count());
            sum.add("light that points on hair share", bytes);
        }
        let specular = |surface: &Surface| surface.visible && surface.material != SurfaceMaterial::Diffuse;
        if description.surface.iter().any(specular) && description.indirect.mode != IndirectMode::None {
            let photons = u64::from(description.indirect.caustic_photons);
            let kept = photons.min(photon::MOST as u64);
            let beams = if points > 0 { photons.min(photon::MOST_BEAMS as u64) } else { 0 };
            sum.add(
                format!("the map of {photons} photons of caustics"),
                all_sets(PHOTON * kept + BEAM * beams + MARK * (8 * beams).min(photon::MOST_BEAMS as u64)),
            );
        }
        let [width, height] = description.camera.resolution;
        let rect = window.unwrap_or(PixelRect::image([width, height]));
        let pixels = [0, 1].map(|i| u64::from(rect.max[i].saturating_sub(rect.min[i]))).iter().product::<u64>();
        sum.add(format!("tiles of {points} segments"), BIN_SEGMENT * points);
        if film {
            // Finished tiles, the film, and its copy while it is mended; written, the values of all channels, twice.
            let shading = 3 * size_of::<Pixel>() as u64;
            let writing = size_of::<Pixel>() as u64 + 2 * 4 * output::channel_count(&description.output.layers) as u64;
            sum.add(format!("the picture of {pixels} pixels"), pixels * shading.max(writing));
            let (passes, mean) = (description.passes(), PASS_PIXEL + size_of::<Pixel>() as u64);
            if photon_sets > 1 {
                // To an error or a time: as many passes as it takes, and then pixels are drawn.
                sum.add("the mean of passes", pixels * (mean + DRAWN_PIXEL));
            } else if passes > 1 {
                sum.add(format!("the mean of {passes} passes"), pixels * mean);
            }
        }
        sum
    }
}

/// The shadow maps of lamps, each as large as it may become: how much hair a pixel of one holds is seen only when it is made. One is made at a time.
fn add_maps(description: &Description, threads: usize, sum: &mut Estimate) {
    let light = &description.light;
    let point = light.point.iter().map(|l| (l.shadows, l.map_resolution, l.map_error)).enumerate();
    let spot = light.spot.iter().map(|l| (l.shadows, l.map_resolution, l.map_error)).enumerate();
    let sun = light.directional.iter().map(|l| (l.shadows, l.map_resolution, l.map_error)).enumerate();
    let lamps = (point.map(|l| ("point", l))).chain(spot.map(|l| ("spot", l))).chain(sun.map(|l| ("directional", l)));
    let mut made = false;
    for (kind, (index, (shadows, resolution, error))) in lamps {
        let settings = shadow::Settings { resolution, error: error as f32, ..shadow::Settings::default() };
        let (what, bytes) = match shadows {
            Shadows::DeepMap => ("deep shadow map", deep::bytes_at_most(&settings)),
            Shadows::Map => ("shadow map", shadow::plain::bytes_at_most(&settings)),
            Shadows::Raytraced | Shadows::None => continue,
        };
        sum.add(format!("the {what} of light.{kind}[{index}]"), bytes);
        made = true;
    }
    if made {
        sum.add("making shadow maps", deep::BYTES_A_THREAD * threads as u64);
    }
}

fn surface_counts(document: &Document, index: usize, surface: &Surface) -> (String, u64, u64) {
    let key = format!("surface[{index}]");
    let Some(file) = &surface.file else {
        let triangles = match (&surface.sphere, &surface.teapot) {
            (Some(_), _) => SPHERE_TRIANGLES,
            (_, Some(_)) => TEAPOT_TRIANGLES,
            _ => 2,
        };
        return (key, triangles, 0);
    };
    let data = document.resolve(file).metadata().ok().filter(|data| data.is_file());
    let bytes = data.map_or(0, |data| data.len());
    (format!("{key}.file ({} of text)", amount(bytes)), bytes / OBJ_TRIANGLE, bytes)
}
