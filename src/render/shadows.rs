//! What hair leaves of the light of each point, spot and directional light, in the way that the scene asks for.

use std::sync::Arc;

use serde::Serialize;

use super::RenderError;
use super::estimator::transmittance_rule;
use super::progress::Progress;
use super::statistics::Watch;
use crate::effects::Effects;
use crate::hair::HairModel;
use crate::illumination::DirectLight;
use crate::occlusion::Transmittance;
use crate::scene::Scene;
use crate::scene::description::Shadows;
use crate::scene::loaded::LampShadows;
use crate::shadow::{Cone, DeepMap, MapError, Point, Settings, ShadowMap, Size, View};
use crate::tally::{self, Work};

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
    /// CPU time, in seconds.
    pub cpu_seconds: f64,
    /// Whether it is a deep one.
    pub deep: bool,
    /// Whether an earlier render made it, and took that time.
    #[serde(skip)]
    pub reused: bool,
}

/// Shadow maps of renders of one scene's hair that differ in settings alone: each is made once. A light's map stays until the light has another.
#[derive(Debug, Default)]
pub struct ShadowMaps {
    kept: Vec<Kept>,
}

#[derive(Debug)]
struct Kept {
    wanted: Wanted,
    map: Arc<HairShadow>,
    made: Made,
}

/// All that a map depends on beside the hair.
#[derive(Clone, Debug, PartialEq)]
struct Wanted {
    view: View,
    shadows: LampShadows,
    rule: Transmittance,
}

impl ShadowMaps {
    /// What is wanted, if it is there.
    fn find(&self, wanted: &Wanted) -> Option<(Arc<HairShadow>, Made)> {
        let kept = self.kept.iter().find(|kept| kept.wanted == *wanted)?;
        Some((kept.map.clone(), Made { reused: true, ..kept.made.clone() }))
    }

    /// Forgets a light's maps.
    fn forget(&mut self, light: &str) {
        self.kept.retain(|kept| kept.wanted.shadows.key != light);
    }

    /// Forgets all maps.
    pub fn clear(&mut self) {
        self.kept.clear();
    }
}

/// How hair's shadows of each light are found, on each kind of thing, and the maps among that.
#[derive(Debug, Default)]
pub struct HairShadows {
    pub on_hair: Vec<Arc<HairShadow>>,
    pub on_surfaces: Vec<Arc<HairShadow>>,
    pub made: Vec<Made>,
}

impl HairShadow {
    /// What each light of a scene needs, in their order, and the maps among it.
    ///
    /// # Errors
    /// Maps that take too much memory; cancelled work.
    pub fn build(
        scene: &Scene,
        effects: &Effects,
        maps: &mut ShadowMaps,
        progress: &dyn Progress,
    ) -> Result<HairShadows, RenderError> {
        let mut all = HairShadows::default();
        let [on_hair, on_surfaces] = [effects.hair_shadows_on_hair, effects.hair_shadows_on_surfaces];
        for (lamp, shadows) in scene.direct.iter().zip(&scene.shadows) {
            let free = Arc::new(Self::Free);
            let found = if on_hair || on_surfaces {
                Self::of(scene, &lamp.light, shadows, &mut all.made, maps, progress)?
            } else {
                free.clone()
            };
            all.on_hair.push(if on_hair { found.clone() } else { free.clone() });
            all.on_surfaces.push(if on_surfaces { found } else { free });
        }
        Ok(all)
    }

    fn of(
        scene: &Scene,
        light: &DirectLight,
        shadows: &LampShadows,
        made: &mut Vec<Made>,
        maps: &mut ShadowMaps,
        progress: &dyn Progress,
    ) -> Result<Arc<Self>, RenderError> {
        let hair = &scene.hair;
        if hair.is_empty() || shadows.mode == Shadows::None {
            return Ok(Arc::new(Self::Free));
        }
        if shadows.mode == Shadows::Raytraced {
            return Ok(Arc::new(Self::Rays));
        }
        let view = match *light {
            DirectLight::Point { position, .. } => View::from_point(hair, position, None),
            DirectLight::Spot { position, axis, outer, .. } => {
                View::from_point(hair, position, Some(Cone { axis, half_angle: outer.clamp(-1.0, 1.0).acos() }))
            }
            DirectLight::Directional { toward, .. } => View::parallel(hair, toward),
        };
        let wanted = Wanted { view, shadows: shadows.clone(), rule: transmittance_rule(scene) };
        if let Some((map, before)) = maps.find(&wanted) {
            made.push(before);
            return Ok(map);
        }
        // Two of one light need not be in memory at once.
        maps.forget(&shadows.key);
        let (map, new) = Self::map(hair, &wanted, progress)?;
        let map = Arc::new(map);
        maps.kept.push(Kept { wanted, map: map.clone(), made: new.clone() });
        made.push(new);
        Ok(map)
    }

    fn map(hair: &HairModel, wanted: &Wanted, progress: &dyn Progress) -> Result<(Self, Made), RenderError> {
        let watch = Watch::start();
        let Wanted { view, shadows, rule } = wanted.clone();
        let settings = Settings { resolution: shadows.resolution, error: shadows.error, ..Settings::default() };
        let failed = |source| match source {
            MapError::Cancelled => RenderError::Cancelled,
            source => RenderError::ShadowMap { light: shadows.key.clone(), source },
        };
        let cancelled = || progress.cancelled();
        let deep = shadows.mode == Shadows::DeepMap;
        let (map, size) = if deep {
            let map = DeepMap::build(view, hair, rule, &settings, &cancelled).map_err(failed)?;
            let size = map.size();
            (Self::Deep(Box::new(map)), size)
        } else {
            let map = ShadowMap::build(view, hair, rule, &settings, &cancelled).map_err(failed)?;
            let size = map.size();
            (Self::Plain(Box::new(map)), size)
        };
        let stage = watch.stage("map");
        let (seconds, cpu_seconds) = (stage.seconds, stage.cpu_seconds);
        Ok((map, Made { light: shadows.key, size, seconds, cpu_seconds, deep, reused: false }))
    }

    /// What hair leaves of the light at a point; `rays` finds it by a ray.
    pub fn transmittance(&self, model: &HairModel, point: &Point, rays: impl FnOnce() -> f32) -> f32 {
        match self {
            Self::Rays => {
                tally::add(Work::RaytracedShadows, 1);
                rays()
            }
            Self::Deep(map) => map.transmittance(model, point),
            Self::Plain(map) => map.transmittance(model, point),
            Self::Free => 1.0,
        }
    }
}
