//! The estimator of Γ that a scene asks for, with what it needs.

use crate::effects::Effects;
use crate::embree::Device;
use crate::hair::HairModel;
use crate::occlusion::{
    ClusterTree, Crossings, DepthMap, Fineness, HairRays, Igloo, Projection, RaySettings, Receiver, Scratch, Span,
    ThinnedSegments, Thinning, Transmittance, layer, projection,
};
use crate::scene::Scene;
use crate::scene::description::{CrossingRule, Occlusion, OcclusionMode, ProjectionRule, TransmittanceRule};
use crate::tally::{self, Work};

/// How Γ is found.
#[derive(Debug)]
pub enum Estimator {
    /// Hair blocks nothing.
    Free,
    /// One that is asked only because the user forces it, before the one that counts.
    Beside { beside: Box<Estimator>, counts: Box<Estimator> },
    /// By projection, far hair in clusters: how finely on the sphere around hair and on a surface's hemisphere.
    Projected { tree: ClusterTree, sphere: Box<Fine>, hemisphere: Box<Fine> },
    /// By projection, segment by segment: the paper's own ways.
    Segments { segments: ThinnedSegments, thinning: Thinning, projection: Projection },
    /// By rays, on hair and on surfaces.
    Raytraced { hair: RaySettings, surface: RaySettings },
}

/// A map for an igloo, and the largest extent of a lump.
#[derive(Debug)]
pub struct Fine {
    pub map: DepthMap,
    /// In radians.
    pub opening: f32,
}

impl Fine {
    /// What a fineness is on an igloo.
    pub fn new(fineness: Fineness, igloo: &Igloo) -> Self {
        let map = fineness.map(igloo);
        let opening = fineness.angle(&map);
        Self { map, opening }
    }
}

/// Buffers that one thread keeps from point to point.
#[derive(Debug, Default)]
pub struct Space {
    clusters: Scratch,
    pieces: Vec<projection::Piece>,
}

/// The scene's rule of transmittance, its lengths in render space.
pub fn transmittance_rule(scene: &Scene) -> Transmittance {
    let settings = &scene.description().occlusion;
    match settings.transmittance {
        TransmittanceRule::Crossing => Transmittance::Crossing,
        TransmittanceRule::SegmentLength => {
            Transmittance::SegmentLength { unit: scene.space.length(settings.unit_length) as f32 }
        }
    }
}

/// The scene's settings of rays, for a number of them.
pub fn ray_settings(settings: &Occlusion, rays: u32) -> RaySettings {
    let crossings = match settings.crossings {
        CrossingRule::Multiply => Crossings::Multiply { residual: settings.residual as f32 },
        CrossingRule::Stochastic => Crossings::Stochastic { roulette: settings.roulette as f32 },
    };
    RaySettings { crossings, ..RaySettings::fastest(rays) }
}

impl Estimator {
    /// Builds the one that the effects call for. Where a calibration is to come it has the settings that suit any hair; `auto` comes as a projection.
    pub fn build(scene: &Scene, effects: &Effects, sphere: &Igloo, hemisphere: &Igloo) -> Self {
        let settings = &scene.description().occlusion;
        if !(effects.projected_occlusion || effects.raytraced_occlusion) {
            return Self::Free;
        }
        match settings.mode {
            OcclusionMode::None => Self::Free,
            OcclusionMode::Raytraced => {
                let rays = ray_settings(settings, settings.rays.unwrap_or(1));
                Self::Raytraced { hair: rays, surface: rays }
            }
            // Segment by segment, the projection is never the cheaper one.
            OcclusionMode::Auto if settings.by_segments() => {
                let rays = ray_settings(settings, 1);
                Self::Raytraced { hair: rays, surface: rays }
            }
            OcclusionMode::Igloo if settings.by_segments() => Self::segments(scene),
            OcclusionMode::Igloo | OcclusionMode::Auto => {
                let opening = settings.opening.filter(|_| settings.mode == OcclusionMode::Igloo).map(|o| o as f32);
                Self::projected(scene, opening, sphere, hemisphere)
            }
        }
    }

    fn projected(scene: &Scene, opening: Option<f32>, sphere: &Igloo, hemisphere: &Igloo) -> Self {
        let faces = scene.description().occlusion.face_count();
        let fine = |igloo: &Igloo| Box::new(Fine::new(Fineness::for_faces(igloo.span(), faces, opening), igloo));
        let (sphere, hemisphere) = (fine(sphere), fine(hemisphere));
        Self::Projected { tree: ClusterTree::build(&scene.hair, transmittance_rule(scene)), sphere, hemisphere }
    }

    /// Adds estimators that only the user's force asks for: `runs` beyond `called_for`.
    pub fn and_forced(self, scene: &Scene, called_for: &Effects, runs: &Effects, igloos: [&Igloo; 2]) -> Self {
        let beside = |beside, counts| Self::Beside { beside: Box::new(beside), counts: Box::new(counts) };
        let mut all = self;
        if runs.projected_occlusion && !called_for.projected_occlusion {
            all = beside(Self::projected(scene, None, igloos[0], igloos[1]), all);
        }
        if runs.raytraced_occlusion && !called_for.raytraced_occlusion {
            let rays = ray_settings(&scene.description().occlusion, 1);
            all = beside(Self::Raytraced { hair: rays, surface: rays }, all);
        }
        all
    }

    /// Whether hair blocks anything.
    pub fn blocks(&self) -> bool {
        match self {
            Self::Free => false,
            Self::Beside { counts, .. } => counts.blocks(),
            _ => true,
        }
    }

    /// Whether what counts is found by projection.
    pub fn projects(&self) -> bool {
        match self {
            Self::Beside { counts, .. } => counts.projects(),
            Self::Projected { .. } | Self::Segments { .. } => true,
            Self::Free | Self::Raytraced { .. } => false,
        }
    }

    /// What it holds for projection, in bytes.
    pub fn bytes(&self) -> u64 {
        match self {
            Self::Free | Self::Raytraced { .. } => 0,
            Self::Beside { beside, counts } => beside.bytes() + counts.bytes(),
            Self::Projected { tree, .. } => tree.bytes() as u64,
            Self::Segments { segments, .. } => segments.bytes() as u64,
        }
    }

    fn segments(scene: &Scene) -> Self {
        let settings = &scene.description().occlusion;
        let projection = match settings.projection {
            ProjectionRule::Sphere => Projection::Sphere,
            ProjectionRule::TangentPlane => Projection::TangentPlane,
        };
        let thinning = settings.thinning.as_ref().map_or(Thinning::NONE, |thinning| Thinning {
            fraction: thinning.fraction as f32,
            distance_unit: thinning.distance_unit.map_or(f32::INFINITY, |d| scene.space.length(d) as f32),
        });
        let segments = ThinnedSegments::build(&scene.hair, transmittance_rule(scene));
        Self::Segments { segments, thinning, projection }
    }

    /// Γ̄ of each face around a receiver, in `gamma`.
    ///
    /// `far[face]` is the distance of the first opaque surface; none of them is where `open`. `key` names the random numbers.
    #[expect(clippy::too_many_arguments, reason = "one query in full: where, over what, how finely")]
    pub fn transmittances(
        &self,
        model: &HairModel,
        rays: Option<&HairRays>,
        receiver: &Receiver,
        igloo: &Igloo,
        far: &[f32],
        open: bool,
        key: u32,
        gamma: &mut Vec<f32>,
        space: &mut Space,
    ) {
        gamma.clear();
        gamma.resize(igloo.len(), 0.0);
        match self {
            Self::Free => gamma.fill(1.0),
            Self::Beside { beside, counts } => {
                beside.transmittances(model, rays, receiver, igloo, far, open, key, gamma, space);
                counts.transmittances(model, rays, receiver, igloo, far, open, key, gamma, space);
            }
            Self::Projected { tree, sphere, hemisphere } => {
                tally::add(Work::Projections, 1);
                let Fine { map, opening } = if igloo.span() == Span::Sphere { &**sphere } else { &**hemisphere };
                let far = (!open).then_some(far);
                tree.transmittances(model, receiver, map, *opening, far, gamma, &mut space.clusters);
            }
            Self::Segments { segments, thinning, projection } => {
                tally::add(Work::Projections, 1);
                let pieces = &mut space.pieces;
                segments.optical_depths(receiver, igloo, thinning, *projection, far, gamma, model, pieces);
                layer::transmittances(gamma);
            }
            Self::Raytraced { hair, surface } => {
                tally::add(Work::RaytracedPoints, 1);
                let settings = if receiver.on.is_some() { hair } else { surface };
                // Without hair nothing needs rays.
                match rays {
                    Some(rays) => rays.transmittances(model, receiver, igloo, settings, far, key, gamma),
                    None => gamma.fill(1.0),
                }
            }
        }
    }
}

/// What rays through hair need, where the effects call for it.
///
/// # Errors
/// Embree's own.
pub fn hair_rays(device: &Device, scene: &Scene) -> Result<HairRays, crate::embree::Error> {
    HairRays::build(device, &scene.hair, transmittance_rule(scene))
}
