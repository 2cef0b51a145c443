//! What hair leaves of the light of each point, spot and directional light, in the way that the scene asks for.

use std::time::Instant;

use serde::Serialize;

use super::RenderError;
use super::estimator::transmittance_rule;
use super::progress::Progress;
use crate::illumination::DirectLight;
use crate::scene::Scene;
use crate::scene::description::Shadows;
use crate::scene::loaded::LampShadows;
use crate::shadow::{Cone, DeepMap, MapError, Point, Settings, ShadowMap, Size, View};

/// How hair's shadow of one light is found.
#[derive(Debug)]
pub enum HairShadow {
    Rays,
    Deep(Box<DeepMap>),
    Plain(Box<ShadowMap>),
    /// There is none.
    Free,
}

/// A map that was made.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Made {
    /// Key of its light in the scene file.
    pub light: String,
    #[serde(flatten)]
    pub size: Size,
    /// Wall time, in seconds.
    pub seconds: f64,
}

impl HairShadow {
    /// What each light of a scene needs, in their order, and the maps among it.
    ///
    /// # Errors
    /// Maps that take too much memory; cancelled work.
    pub fn build(scene: &Scene, progress: &dyn Progress) -> Result<(Vec<Self>, Vec<Made>), RenderError> {
        let mut made = Vec::new();
        let lamps = scene.direct.iter().zip(&scene.shadows);
        let shadows: Result<_, _> =
            lamps.map(|(lamp, shadows)| Self::of(scene, &lamp.light, shadows, &mut made, progress)).collect();
        Ok((shadows?, made))
    }

    fn of(
        scene: &Scene,
        light: &DirectLight,
        shadows: &LampShadows,
        made: &mut Vec<Made>,
        progress: &dyn Progress,
    ) -> Result<Self, RenderError> {
        let hair = &scene.hair;
        if hair.is_empty() || shadows.mode == Shadows::None {
            return Ok(Self::Free);
        }
        if shadows.mode == Shadows::Raytraced {
            return Ok(Self::Rays);
        }
        let begin = Instant::now();
        let view = match *light {
            DirectLight::Point { position, .. } => View::from_point(hair, position, None),
            DirectLight::Spot { position, axis, outer, .. } => {
                View::from_point(hair, position, Some(Cone { axis, half_angle: outer.clamp(-1.0, 1.0).acos() }))
            }
            DirectLight::Directional { toward, .. } => View::parallel(hair, toward),
        };
        let settings = Settings { resolution: shadows.resolution, error: shadows.error, ..Settings::default() };
        let failed = |source| match source {
            MapError::Cancelled => RenderError::Cancelled,
            source => RenderError::ShadowMap { light: shadows.key.clone(), source },
        };
        let cancelled = || progress.cancelled();
        let rule = transmittance_rule(scene);
        let (map, size) = if shadows.mode == Shadows::DeepMap {
            let map = DeepMap::build(view, hair, rule, &settings, &cancelled).map_err(failed)?;
            let size = map.size();
            (Self::Deep(Box::new(map)), size)
        } else {
            let map = ShadowMap::build(view, hair, rule, &settings, &cancelled).map_err(failed)?;
            let size = map.size();
            (Self::Plain(Box::new(map)), size)
        };
        made.push(Made { light: shadows.key.clone(), size, seconds: begin.elapsed().as_secs_f64() });
        Ok(map)
    }

    /// What hair leaves of the light at a point; `rays` finds it by a ray.
    pub fn transmittance(&self, point: &Point, rays: impl FnOnce() -> f32) -> f32 {
        match self {
            Self::Rays => rays(),
            Self::Deep(map) => map.transmittance(point),
            Self::Plain(map) => map.transmittance(point),
            Self::Free => 1.0,
        }
    }
}
