//! Every crossing of hair segments by a ray, or by a packet of rays from one point.

use std::any::Any;
use std::mem::offset_of;
use std::ops::ControlFlow;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};

use embree4_sys as sys;
use glam::Vec3;

use super::curves::CurveScene;
use super::embree_ray;
use crate::tally::{self, Work};

/// How many rays a packet holds.
pub const PACKET: usize = 8;

/// Where a ray crosses a hair segment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crossing {
    /// Which segment, as given to [`CurveScene::build`].
    pub segment: u32,
    /// Where along the segment, strictly between 0 (its first vertex) and 1.
    pub u: f32,
    /// Distance of the crossing of the segment's axis, in lengths of the ray's direction.
    pub distance: f32,
}

/// What a query hands to its filter through Embree, which knows the head of it only.
#[repr(C)]
struct CrossingQuery<'a, F> {
    context: sys::RTCRayQueryContext,
    visit: &'a mut F,
    panic: Option<Box<dyn Any + Send>>,
}

impl<'a, F: FnMut(usize, Crossing) -> ControlFlow<()>> CrossingQuery<'a, F> {
    fn new(visit: &'a mut F) -> Self {
        let none = u32::MAX;
        let context = sys::RTCRayQueryContext { instID: [none], instPrimID: [none] };
        Self { context, visit, panic: None }
    }

    /// The arguments of a query; they hold a pointer to `self`.
    fn arguments(&mut self) -> sys::RTCOccludedArguments {
        sys::RTCOccludedArguments {
            // The coherent flag, measured on packets of neighbouring directions from one point: 5 to 10 % slower.
            flags: sys::RTC_RAY_QUERY_FLAG_INCOHERENT,
            feature_mask: sys::RTC_FEATURE_FLAG_ALL,
            context: (&raw mut *self).cast(),
            filter: Some(filter::<F>),
            occluded: None,
        }
    }

    /// Whether the visitor breaks here; a panic of it is kept, and ends the query.
    fn breaks(&mut self, ray: usize, crossing: Crossing) -> bool {
        if self.panic.is_some() {
            return true;
        }
        match catch_unwind(AssertUnwindSafe(|| (self.visit)(ray, crossing))) {
            Ok(flow) => flow.is_break(),
            Err(panic) => {
                self.panic = Some(panic);
                true
            }
        }
    }
}

impl CurveScene {
    /// Calls `visit` once for every segment that the ray crosses at a distance in `near..=far`, in no particular order, until it breaks.
    ///
    /// True if it broke. The order is the same in each run on the same kind of processor, but not the order of distance. A ray that is not
    /// finite crosses nothing. A panic in `visit` ends the query and goes on in the caller.
    pub fn crossings<F>(&self, origin: Vec3, direction: Vec3, near: f32, far: f32, mut visit: F) -> bool
    where
        F: FnMut(Crossing) -> ControlFlow<()>,
    {
        tally::add(Work::HairRays, 1);
        let Some(mut ray) = embree_ray(origin, direction, near, far) else { return false };
        let mut visit = |_, crossing| visit(crossing);
        let mut query = CrossingQuery::new(&mut visit);
        let mut arguments = query.arguments();
        // SAFETY: the scene is committed; ray, query and arguments are whole, aligned and live through the call, on this thread alone; the
        // filter is the one made for this type of query.
        unsafe { sys::rtcOccluded1(self.scene.scene, &raw mut ray, &raw mut arguments) };
        if let Some(panic) = query.panic {
            resume_unwind(panic);
        }
        ray.tfar == f32::NEG_INFINITY
    }

    /// The same for up to [`PACKET`] rays from one point, each to its own distance: `visit` also gets the number of the ray.
    ///
    /// `directions` and `far` go together; what is beyond the shorter of them, or beyond [`PACKET`], is left out. A ray meets exactly the
    /// crossings that it would meet alone; the order among rays is not defined. Returns which rays the visitor broke off.
    pub fn packet_crossings<F>(&self, origin: Vec3, directions: &[Vec3], far: &[f32], mut visit: F) -> [bool; PACKET]
    where
        F: FnMut(usize, Crossing) -> ControlFlow<()>,
    {
        #[repr(C, align(32))]
        struct Valid([i32; PACKET]);
        tally::add(Work::HairRays, directions.len().min(far.len()).min(PACKET) as u64);
        let mut valid = Valid([0; PACKET]);
        let mut rays = sys::RTCRay8::default();
        for (i, (&direction, &far)) in directions.iter().zip(far).take(PACKET).enumerate() {
            let Some(ray) = embree_ray(origin, direction, 0.0, far) else { continue };
            valid.0[i] = -1;
            (rays.org_x[i], rays.org_y[i], rays.org_z[i]) = (ray.org_x, ray.org_y, ray.org_z);
            (rays.dir_x[i], rays.dir_y[i], rays.dir_z[i]) = (ray.dir_x, ray.dir_y, ray.dir_z);
            (rays.tnear[i], rays.tfar[i], rays.mask[i]) = (ray.tnear, ray.tfar, ray.mask);
            // On processors with narrower vectors Embree hands parts of the packet to the filter: the lane there is not the ray's number.
            rays.id[i] = i as u32;
        }
        let mut query = CrossingQuery::new(&mut visit);
        let mut arguments = query.arguments();
        // SAFETY: the scene is committed; mask, rays, query and arguments are whole, aligned to 32 bytes where Embree asks for it, and live
        // through the call, on this thread alone; the filter is the one made for this type of query.
        unsafe { sys::rtcOccluded8(valid.0.as_ptr(), self.scene.scene, &raw mut rays, &raw mut arguments) };
        if let Some(panic) = query.panic {
            resume_unwind(panic);
        }
        std::array::from_fn(|i| valid.0[i] != 0 && rays.tfar[i] == f32::NEG_INFINITY)
    }
}

/// Embree asks of each ray of a packet whether its hit counts: no, while the visitor wants more.
unsafe extern "C" fn filter<F: FnMut(usize, Crossing) -> ControlFlow<()>>(
    arguments: *const sys::RTCFilterFunctionNArguments,
) {
    // SAFETY: Embree passes valid arguments; the context is the one that the query passed down, whose type goes with `filter::<F>`, and nobody
    // else uses it during the query. RTCRayN and RTCHitN are the fields of RTCRay and RTCHit, in their order and of four bytes each, each
    // field N times in a row; `valid` has N elements.
    unsafe {
        let arguments = &*arguments;
        let query = &mut *arguments.context.cast::<CrossingQuery<F>>();
        let (lanes, ray, hit) = (arguments.N as usize, arguments.ray.cast::<u32>(), arguments.hit.cast::<u32>());
        for lane in 0..lanes {
            let valid = arguments.valid.add(lane);
            if valid.read() == 0 {
                continue;
            }
            let of_ray = |offset: usize| ray.add(offset / 4 * lanes + lane).read();
            let of_hit = |offset: usize| hit.add(offset / 4 * lanes + lane).read();
            let crossing = Crossing {
                segment: of_hit(offset_of!(sys::RTCHit, primID)),
                u: f32::from_bits(of_hit(offset_of!(sys::RTCHit, u))),
                distance: f32::from_bits(of_ray(offset_of!(sys::RTCRay, tfar))),
            };
            let inside = crossing.u > 0.0 && crossing.u < 1.0;
            if !(inside && query.breaks(of_ray(offset_of!(sys::RTCRay, id)) as usize, crossing)) {
                valid.write(0);
            }
        }
    }
}
