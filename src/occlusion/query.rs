//! Γ̄ of all faces from one point: the walk through the tree, compiled for what the processor can do.

use glam::Mat3;

use super::clusters::ClusterTree;
use super::depth_map::{Corners, DepthMap};
use super::view::{Above, Directions, Turned, Upright};
use super::walk::{Lists, Queues, Walk};
use super::{Receiver, Span};
use crate::hair::HairModel;

/// What the processor can do; all give the same bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Instructions {
    /// Those that every processor of the kind has.
    Baseline,
    #[cfg(target_arch = "x86_64")]
    Avx2,
    #[cfg(target_arch = "x86_64")]
    Avx512,
}

impl Instructions {
    /// All that this processor has, the best first.
    pub fn available() -> Vec<Self> {
        let mut all = vec![Self::Baseline];
        #[cfg(target_arch = "x86_64")]
        {
            if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("bmi2") {
                all.insert(0, Self::Avx2);
                let avx512 = is_x86_feature_detected!("avx512f")
                    && is_x86_feature_detected!("avx512vl")
                    && is_x86_feature_detected!("avx512dq")
                    && is_x86_feature_detected!("avx512bw");
                if avx512 {
                    all.insert(0, Self::Avx512);
                }
            }
        }
        all
    }
}

/// Where the first opaque surface ends what counts.
#[derive(Clone, Copy, Debug)]
pub(super) struct Far<'a> {
    /// Its distance in each face.
    pub faces: &'a [f32],
    /// The square of it in each cell of the map,
    pub cells: &'a [f32],
    /// and in the four cells that a tent reaches from each.
    pub corners: &'a [[f32; 4]],
}

impl Far<'_> {
    /// What of a lump at a squared distance counts in each of its four cells.
    #[inline(always)]
    pub fn cut(&self, cell: usize, amount: &Corners, distance2: f32) -> Corners {
        let far2 = &self.corners[cell];
        std::array::from_fn(|corner| if distance2 < far2[corner] { amount[corner] } else { 0.0 })
    }
}

/// Buffers that one thread keeps from point to point.
#[derive(Debug)]
pub struct Scratch {
    /// Only what the processor has.
    instructions: Instructions,
    /// Work done since it was made, in lanes of kernels.
    pub(super) work: u64,
    pub(super) lists: Box<Lists>,
    /// Solid angle times opacity, where lumps gave it.
    pub(super) depth: Vec<Corners>,
    /// Solid angle of one wide ribbon in each cell; zero between ribbons.
    pub(super) layer: Vec<f32>,
    pub(super) touched: Vec<u32>,
    pub(super) queues: Box<Queues>,
    cells: Vec<f32>,
    far: Vec<f32>,
    far_corners: Vec<Corners>,
}

impl Default for Scratch {
    fn default() -> Self {
        Self::with_instructions(Instructions::available()[0])
    }
}

impl Scratch {
    /// For code of these instructions; the baseline's where the processor does not have them.
    pub fn with_instructions(instructions: Instructions) -> Self {
        let has = Instructions::available().contains(&instructions);
        Self {
            instructions: if has { instructions } else { Instructions::Baseline },
            work: 0,
            lists: Box::default(),
            depth: Vec::new(),
            layer: Vec::new(),
            touched: Vec::new(),
            queues: Box::default(),
            cells: Vec::new(),
            far: Vec::new(),
            far_corners: Vec::new(),
        }
    }
}

impl ClusterTree {
    /// Γ̄ of each face of the igloo that `map` was made for (paper, Eq. 8).
    ///
    /// `opening` is the largest angular extent of a lump, in radians; `far[face]` the distance of the first opaque surface, where there
    /// are any. `model` is the one that the tree was built of.
    #[expect(clippy::too_many_arguments, reason = "one query in full: where, over what, how finely")]
    pub fn transmittances(
        &self,
        model: &HairModel,
        receiver: &Receiver,
        map: &DepthMap,
        opening: f32,
        far: Option<&[f32]>,
        gamma: &mut [f32],
        scratch: &mut Scratch,
    ) {
        scratch.depth.clear();
        scratch.depth.resize(map.len(), Corners::default());
        let (mut cells, mut corners) = (std::mem::take(&mut scratch.far), std::mem::take(&mut scratch.far_corners));
        if let Some(far) = far {
            cells.clear();
            cells.extend(map.faces().iter().map(|&face| far[face as usize] * far[face as usize]));
            corners.clear();
            corners.extend((0..map.len()).map(|cell| map.corners(cell).map(|corner| cells[corner])));
        }
        // Emptying the map and summing it up cost about a lane for each two cells.
        scratch.work += map.len() as u64 / 2;
        let limits = far.map(|faces| Far { faces, cells: &cells, corners: &corners });
        // Compiled for each case, so that what a scene has not is not asked for at each lump.
        let asked = Asked { hair: (self, model), receiver, map, opening, limits };
        match (map.span(), receiver.frame == Mat3::IDENTITY) {
            (Span::Hemisphere, _) => asked.see::<Above>(scratch, gamma),
            (Span::Sphere, true) => asked.see::<Upright>(scratch, gamma),
            (Span::Sphere, false) => asked.see::<Turned>(scratch, gamma),
        }
        (scratch.far, scratch.far_corners) = (cells, corners);
    }
}

/// What a walk is made of, before it is known which.
struct Asked<'a> {
    hair: (&'a ClusterTree, &'a HairModel),
    receiver: &'a Receiver,
    map: &'a DepthMap,
    opening: f32,
    limits: Option<Far<'a>>,
}

impl Asked<'_> {
    fn see<D: Directions>(&self, scratch: &mut Scratch, gamma: &mut [f32]) {
        let Self { hair, receiver, map, opening, limits } = *self;
        if limits.is_none() {
            dispatch(&Walk::<D, true>::new(hair, receiver, map, opening, limits), scratch, gamma);
        } else {
            dispatch(&Walk::<D, false>::new(hair, receiver, map, opening, limits), scratch, gamma);
        }
    }
}

/// Runs the code that is compiled for the scratch's instructions.
fn dispatch<D: Directions, const OPEN: bool>(walk: &Walk<'_, D, OPEN>, scratch: &mut Scratch, gamma: &mut [f32]) {
    match scratch.instructions {
        #[cfg(target_arch = "x86_64")]
        // SAFETY: `Scratch::with_instructions` takes it only where the processor has it.
        Instructions::Avx512 => unsafe { query_avx512(walk, scratch, gamma) },
        #[cfg(target_arch = "x86_64")]
        // SAFETY: as above.
        Instructions::Avx2 => unsafe { query_avx2(walk, scratch, gamma) },
        Instructions::Baseline => query(walk, scratch, gamma),
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512vl,avx512dq,avx512bw,bmi1,bmi2")]
fn query_avx512<D: Directions, const OPEN: bool>(walk: &Walk<'_, D, OPEN>, scratch: &mut Scratch, gamma: &mut [f32]) {
    query(walk, scratch, gamma);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,bmi1,bmi2")]
fn query_avx2<D: Directions, const OPEN: bool>(walk: &Walk<'_, D, OPEN>, scratch: &mut Scratch, gamma: &mut [f32]) {
    query(walk, scratch, gamma);
}

#[inline(always)]
fn query<D: Directions, const OPEN: bool>(walk: &Walk<'_, D, OPEN>, scratch: &mut Scratch, gamma: &mut [f32]) {
    walk.run(scratch);
    walk.map.finish(&scratch.depth, walk.far().map(|far| far.faces), &mut scratch.cells, gamma);
}

#[cfg(test)]
mod tests;
