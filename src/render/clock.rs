//! What each part of stage 2 takes.

use std::time::{Duration, Instant};

/// A part of stage 2 that is timed by itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// Rays from the camera to surfaces; a part of stage 1.
    CameraRays,
    /// Rays from shading points to the first surfaces.
    Gather,
    /// Γ over the igloo.
    Occlusion,
    /// F of the igloo's faces: hair without a highlight, with one, and fibres.
    KajiyaKay,
    Highlight,
    Marschner,
    /// Light from the environment, and the sum over the faces.
    Faces,
    /// Light of the surfaces that gather rays met.
    Reflection,
    AreaLights,
    SmallSources,
    /// Light from hot spots of surfaces.
    HotSpots,
    /// Light by way of mirrors and glass.
    Caustics,
    /// Lights without extent, and the surfaces in their way.
    PointLights,
    SpotLights,
    DirectionalLights,
    /// The hair in their way, to points on hair and on surfaces.
    HairShadowsOnHair,
    HairShadowsOnSurfaces,
}

const PARTS: usize = Part::HairShadowsOnSurfaces as usize + 1;

/// Time of stage 2 by part.
#[derive(Clone, Copy, Debug, Default)]
pub struct Clock([Duration; PARTS]);

impl Clock {
    /// Time of one part.
    #[must_use]
    pub fn of(&self, part: Part) -> Duration {
        self.0[part as usize]
    }

    /// Hair occlusion.
    #[must_use]
    pub fn gamma(&self) -> Duration {
        self.of(Part::Occlusion)
    }

    /// Light that arrives from all around, and F of it.
    #[must_use]
    pub fn lambda(&self) -> Duration {
        let parts = [Part::Gather, Part::KajiyaKay, Part::Highlight, Part::Marschner, Part::Faces];
        let more = [Part::Reflection, Part::AreaLights, Part::SmallSources, Part::HotSpots, Part::Caustics];
        parts.iter().chain(&more).map(|&part| self.of(part)).sum()
    }

    /// Lights without extent.
    #[must_use]
    pub fn direct(&self) -> Duration {
        let lamps = [Part::PointLights, Part::SpotLights, Part::DirectionalLights];
        let shadows = [Part::HairShadowsOnHair, Part::HairShadowsOnSurfaces];
        lamps.iter().chain(&shadows).map(|&part| self.of(part)).sum()
    }

    /// Adds another clock's times.
    pub fn add(&mut self, other: &Self) {
        self.0.iter_mut().zip(&other.0).for_each(|(sum, time)| *sum += *time);
    }

    /// Multiplies all times.
    pub(super) fn scale(&mut self, factor: f64) {
        self.0.iter_mut().for_each(|time| *time = time.mul_f64(factor));
    }
}

/// Reads the time once between each two parts. A reading takes some 25 ns: for the parts of a point, not for rays.
#[derive(Clone, Copy, Debug)]
pub struct Lap(Instant);

impl Lap {
    pub fn start() -> Self {
        Self(Instant::now())
    }

    /// What went by since the last reading goes to `part`.
    pub fn ends(&mut self, part: Part, clock: &mut Clock) {
        let now = Instant::now();
        clock.0[part as usize] += now - self.0;
        self.0 = now;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_time_goes_somewhere_once() {
        let (mut clock, begin) = (Clock::default(), Instant::now());
        let mut lap = Lap::start();
        for part in [Part::Gather, Part::Occlusion, Part::PointLights, Part::Gather] {
            std::thread::sleep(Duration::from_millis(3));
            lap.ends(part, &mut clock);
        }
        let all = begin.elapsed();
        let sum = clock.gamma() + clock.lambda() + clock.direct();
        assert!(sum <= all && sum > Duration::from_millis(12), "{sum:?} of {all:?}");
        // Asleep, a thread may stay so for longer, but not less long.
        assert!(
            clock.of(Part::Gather) >= Duration::from_millis(6) && clock.of(Part::Occlusion) >= Duration::from_millis(3)
        );
        let mut twice = clock;
        twice.add(&clock);
        twice.scale(0.5);
        assert_eq!(twice.of(Part::Gather), clock.of(Part::Gather));
        assert_eq!(clock.lambda(), clock.of(Part::Gather));
    }
}
