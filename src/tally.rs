//! Counts of work that was done, noted where it is done: what a render that needs none of it is held against.
//!
//! Each thread counts for itself (an addition to its own memory, once a call, not once a crossing or a face); [`take`] collects the
//! counts of all threads of the pool that it is called in. Whole numbers: the sum depends on neither threads nor order.

use std::cell::Cell;

use serde::ser::{Serialize, SerializeMap, Serializer};

macro_rules! works {
    ($($(#[$doc:meta])* $variant:ident = $name:literal,)*) => {
        /// A kind of work.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum Work { $($(#[$doc])* $variant,)* }

        impl Work {
            /// All kinds, in the order of their counts.
            pub const ALL: &[Self] = &[$(Self::$variant,)*];

            /// Its name in statistics.
            #[must_use]
            pub fn name(self) -> &'static str {
                match self { $(Self::$variant => $name,)* }
            }
        }
    };
}

works! {
    /// Scenes of hair segments that Embree built, empty ones not counted.
    CurveGeometries = "curve_geometries",
    CurveSegments = "curve_segments",
    /// The same of triangles.
    TriangleGeometries = "triangle_geometries",
    Triangles = "triangles",
    /// Trees of clusters.
    ClusterTrees = "cluster_trees",
    /// Points at which Γ was found by projection,
    Projections = "projected_points",
    /// and by rays.
    RaytracedPoints = "raytraced_points",
    /// Rays through hair, whatever for.
    HairRays = "rays_through_hair",
    /// Points at which settings of Γ were judged.
    CalibrationPoints = "calibration_points",
    /// Rays to the first surface from shading points.
    GatherRays = "gather_rays",
    /// Other rays to the first surface: from the camera, and of photons.
    FirstHits = "first_hits",
    /// Rays that ask whether a surface is in the way.
    ShadowRays = "shadow_rays",
    /// Samples of light without extent,
    PointLight = "point_light_samples",
    SpotLight = "spot_light_samples",
    DirectionalLight = "directional_light_samples",
    /// of area lights, and of small bright sources.
    AreaLight = "area_light_samples",
    SmallSources = "small_source_samples",
    /// Faces whose light from the environment was added up.
    EnvironmentFaces = "environment_faces",
    /// Surfaces met by gather rays whose reflected light was found.
    Reflections = "reflections",
    /// Corners of the lattice on which points on hair share what they see of surfaces.
    SharedCorners = "shared_corners",
    /// Photons that left the lights.
    Photons = "photons",
    /// Photons that left the lights towards mirrors and glass.
    CausticPhotons = "caustic_photons",
    /// Ways from mirrors and glass on, of rays that met them.
    SpecularWays = "specular_ways",
    /// Look-ups in the photon map.
    PhotonLookups = "photon_lookups",
    /// Shadows of hair found by rays, of lights that have them.
    RaytracedShadows = "raytraced_shadows",
    DeepMaps = "deep_shadow_maps",
    PlainMaps = "shadow_maps",
    /// What hair leaves of the light of a lamp, asked for a point on hair, and on a surface.
    HairShadowsOnHair = "hair_shadows_on_hair",
    HairShadowsOnSurfaces = "hair_shadows_on_surfaces",
    /// Tables of highlights, and of fibres' lobes.
    HighlightTables = "highlight_tables",
    MarschnerTables = "marschner_tables",
    /// Directions for which F was found: of hair by Kajiya and Kay, with a highlight or without,
    KajiyaKay = "kajiya_kay_evaluations",
    /// with one,
    Highlight = "highlight_evaluations",
    /// and of fibres.
    Marschner = "marschner_evaluations",
    /// Colours that were held for points of hair.
    PointColors = "point_colors",
    /// Faces whose light was added up without hair.
    UnoccludedFaces = "unoccluded_faces",
    /// Hair fragments of pixels.
    HairFragments = "hair_fragments",
}

const KINDS: usize = Work::ALL.len();

thread_local! {
    static DONE: [Cell<u64>; KINDS] = const { [const { Cell::new(0) }; KINDS] };
}

/// Notes work of this thread.
#[inline]
pub fn add(work: Work, count: u64) {
    DONE.with(|done| {
        let cell = &done[work as usize];
        cell.set(cell.get() + count);
    });
}

/// How much of each kind of work was done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Counts([u64; KINDS]);

impl Default for Counts {
    fn default() -> Self {
        Self([0; KINDS])
    }
}

impl Counts {
    /// How much of one kind.
    #[must_use]
    pub fn of(&self, work: Work) -> u64 {
        self.0[work as usize]
    }

    /// Adds other work.
    pub fn add(&mut self, other: &Self) {
        self.0.iter_mut().zip(&other.0).for_each(|(sum, count)| *sum += count);
    }
}

impl Serialize for Counts {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(Some(KINDS))?;
        Work::ALL.iter().try_for_each(|&work| map.serialize_entry(work.name(), &self.of(work)))?;
        map.end()
    }
}

/// Takes what the threads of the pool that it is called in have noted; called outside of any pool, also the caller's.
#[must_use]
pub fn take() -> Counts {
    let mut all = Counts::default();
    if rayon::current_thread_index().is_none() {
        all.add(&own());
    }
    rayon::broadcast(|_| own()).iter().for_each(|counts| all.add(counts));
    all
}

fn own() -> Counts {
    DONE.with(|done| Counts(std::array::from_fn(|kind| done[kind].take())))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rayon::prelude::*;

    #[test]
    fn all_threads_of_a_pool_count_and_those_of_others_do_not() {
        let pool = |threads| rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        for threads in [1, 3] {
            let counts = pool(threads).install(|| {
                (0..1000_u64).into_par_iter().for_each(|i| add(Work::Photons, i));
                take()
            });
            assert_eq!((counts.of(Work::Photons), counts.of(Work::HairRays)), (499_500, 0), "{threads} threads");
        }
        let (one, other) = (pool(2), pool(2));
        one.install(|| add(Work::DeepMaps, 1));
        assert_eq!(other.install(take), Counts::default());
        assert_eq!(one.install(take).of(Work::DeepMaps), 1);
        assert_eq!(one.install(take), Counts::default(), "taken once");
    }

    #[test]
    fn names_are_told_apart() {
        let mut names: Vec<&str> = Work::ALL.iter().map(|work| work.name()).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), KINDS);
    }
}
