//! One pixel laid open: all that a render makes of it, in the order in which it is made.
//!
//! The same code on a picture of this one pixel. What is random depends on the pixel, so the values are those of the whole picture.

use serde::Serialize;

use super::RenderError;
use super::lighting::{on_hair, on_surface};
use super::passes::Prepared;
use super::pipeline::{Options, with_threads};
use super::progress::Progress;
use super::statistics::NonFinite;
use super::tile::{Frame, Point, TileSpace, What};
use crate::fragment::PixelRect;
use crate::scene::Scene;

/// A hair fragment and the layer that it makes.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Fragment {
    pub segment: u32,
    pub strand: u32,
    /// Place on the segment, 0 to 1.
    pub u: f32,
    /// Scene units.
    pub depth: f64,
    /// Share of the pixel, 0 to 1.
    pub coverage: f32,
    /// t of Eq. 7.
    pub transparency: f32,
    /// Share of the light that the layer lets through.
    pub gamma: f64,
    /// How much of it is seen.
    pub weight: f64,
}

/// A shading point and its light.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Shading {
    /// Number of the point in its pixel.
    pub sample: u32,
    pub what: String,
    /// Scene units.
    pub position: [f64; 3],
    pub depth: f64,
    /// What it counts in the pixel, with the layers that it stands for.
    pub weight: f32,
    /// Names its random numbers.
    pub key: u32,
    /// Mean, least and largest Γ̄ over the faces of its igloo; 1 where nothing asks for it.
    pub gamma: [f32; 3],
    pub faces: usize,
    /// Faces whose first ray meets a surface.
    pub blocked_faces: usize,
    /// Faces whose Γ̄ is not finite.
    pub faces_not_finite: usize,
    /// Radiance towards the eye: Σ F·Γ̄·Λ̄ over the faces and area lights,
    pub environment: [f32; 3],
    /// Σ F·Λ̄, without hair, where `output.layers` asks for it (to find it more surfaces are lit),
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unoccluded: Option<[f32; 3]>,
    /// from point and directional lights,
    pub direct: [f32; 3],
    /// and what it sends out by itself.
    pub emission: [f32; 3],
    pub finite: bool,
}

/// A pixel laid open.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Inspected {
    /// Column and row.
    pub pixel: [u32; 2],
    /// Front to back.
    pub fragments: Vec<Fragment>,
    /// Samples of surfaces, and how many of them met one.
    pub surface_samples: [usize; 2],
    pub points: Vec<Shading>,
    /// Share that is covered.
    pub alpha: f32,
    /// Mean of Γ over what is seen.
    pub occlusion: f32,
    /// Scene units.
    pub depth: f32,
    /// W/(m² sr), linear Rec.709, as it is before neighbours mend what is not finite.
    pub beauty: [f32; 3],
    pub non_finite: Vec<NonFinite>,
}

/// Renders one pixel and keeps what makes it up. The scene comes back without its surfaces.
///
/// # Errors
/// As [`super::render`].
pub fn inspect(
    scene: &mut Scene,
    pixel: [u32; 2],
    threads: Option<usize>,
    progress: &dyn Progress,
) -> Result<Inspected, RenderError> {
    with_threads(threads, || {
        let rect = PixelRect { min: pixel, max: pixel.map(|i| i + 1) };
        let mut prepared = Prepared::new(scene, &Options { window: Some(rect), threads }, progress)?;
        prepared.begin_sharing();
        open(&prepared, rect, progress)
    })?
}

fn open(prepared: &Prepared<'_>, rect: PixelRect, progress: &dyn Progress) -> Result<Inspected, RenderError> {
    let (lighting, bins) = prepared.parts();
    let frame = Frame::new(lighting);
    let mut space = TileSpace::default();
    let mut tile = frame.render(&rect, bins.tile(0), &mut space, progress).ok_or(RenderError::Cancelled)?;
    let fragments = fragments(&frame, &space);
    let samples = &space.surfaces.samples;
    let met = samples.iter().filter(|sample| sample.depth.is_finite()).count();
    let surface_samples = [samples.len(), met];
    let points = std::mem::take(&mut space.points);
    let shadings =
        points.iter().enumerate().map(|(sample, point)| shading(&frame, &rect, point, sample as u32, &mut space));
    let points = shadings.collect();
    let value = tile.pixels.swap_remove(0);
    Ok(Inspected {
        pixel: rect.min,
        fragments,
        surface_samples,
        points,
        alpha: value.alpha,
        occlusion: value.occlusion,
        depth: value.depth,
        beauty: value.beauty.to_array(),
        non_finite: tile.non_finite,
    })
}

fn fragments(frame: &Frame<'_>, space: &TileSpace) -> Vec<Fragment> {
    let hair = &frame.scene.hair;
    let one = |layer: &crate::fragment::Layer| {
        let fragment = &space.hair[layer.fragment as usize];
        Fragment {
            segment: layer.segment,
            strand: hair.strand[layer.segment as usize],
            u: fragment.u,
            depth: frame.scene.space.scene_length(layer.depth.into()),
            coverage: fragment.coverage,
            transparency: frame.transparency(fragment),
            gamma: layer.gamma(),
            weight: layer.weight,
        }
    };
    space.layers.layers.iter().map(one).collect()
}

fn shading(frame: &Frame<'_>, rect: &PixelRect, point: &Point, sample: u32, space: &mut TileSpace) -> Shading {
    let key = frame.key(rect, point).own;
    let lit = frame.light(rect, point, &mut space.workspace);
    let (receiver, asked) = match &point.what {
        What::Hair { sample, .. } => (on_hair(sample), frame.lighting.gathers_on(frame.object(sample))),
        What::Surface(hit) => (on_surface(hit), frame.lighting.arrives() && hit.albedo != glam::Vec3::ZERO),
    };
    let (mut gamma, mut faces, mut blocked_faces, mut faces_not_finite) = ([1.0; 3], 0, 0, 0);
    if asked {
        let around = frame.lighting.around(&receiver, key, &mut space.workspace);
        faces = around.gamma.len();
        blocked_faces = around.far.iter().filter(|far| far.is_finite()).count();
        faces_not_finite = around.gamma.iter().filter(|gamma| !gamma.is_finite()).count();
        let least = around.gamma.iter().copied().fold(f32::INFINITY, f32::min);
        gamma = [lit.occlusion, least, around.gamma.iter().copied().fold(f32::NEG_INFINITY, f32::max)];
    }
    let to_scene = frame.scene.space.from_scene().inverse();
    Shading {
        sample,
        what: point.name(),
        position: to_scene.transform_point3(point.position().as_dvec3()).to_array(),
        depth: frame.scene.space.scene_length(point.depth.into()),
        weight: point.weight,
        key,
        gamma,
        faces,
        blocked_faces,
        faces_not_finite,
        environment: lit.environment.to_array(),
        unoccluded: frame.lighting.effects().unoccluded_layer.then(|| lit.unoccluded.to_array()),
        direct: lit.direct.to_array(),
        emission: lit.emission.to_array(),
        finite: lit.is_finite(),
    }
}
