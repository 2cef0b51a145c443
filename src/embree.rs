//! Safe, typed Embree: ray queries against triangles and against hair segments.
//!
//! A scene comes into being committed and is immutable from then on, so every scene that exists can be traced, by any number of threads.
//! Units: `distance`, `near` and `far` count in lengths of `direction`; with a unit direction they are in the unit of the vertices.
//!
//! Embree works in single precision: move a model to the origin and scale it to about unit size before building a scene of it.
//!
//! ```
//! use glam::Vec3;
//! use tress::embree::{Device, TriangleScene};
//!
//! let corners = vec![Vec3::ZERO, Vec3::X, Vec3::Y];
//! let scene = TriangleScene::build(&Device::new()?, corners, vec![[0, 1, 2]])?;
//! let hit = scene.closest(Vec3::new(0.25, 0.25, 2.0), Vec3::NEG_Z, 0.0, f32::INFINITY);
//! assert_eq!(hit.map(|hit| hit.distance), Some(2.0));
//! # Ok::<(), tress::embree::Error>(())
//! ```

use std::any::Any;
use std::ffi::{CStr, CString, c_char, c_void};
use std::fmt::Display;
use std::mem::offset_of;
use std::ops::ControlFlow;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::ptr;
use std::sync::atomic::{AtomicI64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use embree4_sys as sys;
use glam::{Vec3, Vec4};

/// The first library version whose rays and hits have the layout that Tress is built for.
const OLDEST_LIBRARY: isize = 40300;

/// Embree takes coordinates beyond this for invalid and drops what uses them without a word.
pub const LARGEST_COORDINATE: f32 = 1.8e18;

/// What can go wrong with Embree or with what it is given.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    #[error("Embree cannot start: {message}")]
    Start { message: String },
    #[error("the Embree library found at run time is version {}, Tress needs 4.3.0 or newer; check LD_LIBRARY_PATH, or run ffi/setup.sh", dotted(*.found))]
    Version { found: isize },
    #[error("Embree failed while {during}: {message} ({code})")]
    Library { during: &'static str, code: String, message: String },
    #[error("vertex {index} is {value}; coordinates must be finite and below {LARGEST_COORDINATE:e}")]
    Vertex { index: usize, value: String },
    #[error("vertex {index} has radius {radius}; a radius must be finite and not negative")]
    Radius { index: usize, radius: f32 },
    #[error("triangle {index} uses vertices {vertices:?}, but there are only {count}")]
    Triangle { index: usize, vertices: [u32; 3], count: usize },
    #[error("segment {index} runs from vertex {first} to the next, but there are only {count}")]
    Segment { index: usize, first: u32, count: usize },
    #[error("{count} {what} in one scene are more than Embree can number")]
    TooMany { what: &'static str, count: usize },
}

fn dotted(version: isize) -> String {
    format!("{}.{}.{}", version / 10000, version / 100 % 100, version % 100)
}

/// What Embree's callbacks write to. Its address is known to Embree, so it lives in a box that outlives the device.
#[derive(Default)]
struct Monitor {
    error: Mutex<Option<(sys::RTCError, String)>>,
    bytes: AtomicI64,
}

struct DeviceHandle {
    device: sys::RTCDevice,
    monitor: Box<Monitor>,
    /// Held during a build, so that an error is told to the one who caused it.
    building: Mutex<()>,
}

// SAFETY: Embree's device functions may be called from any thread; `monitor` is synchronised by itself.
unsafe impl Send for DeviceHandle {}
// SAFETY: as above.
unsafe impl Sync for DeviceHandle {}

impl Drop for DeviceHandle {
    fn drop(&mut self) {
        // SAFETY: the handle holds the reference that rtcNewDevice returned. All scenes are gone, for each holds an Arc of this handle;
        // so Embree destroys the device here and calls `monitor` for the last time before the box is freed.
        unsafe { sys::rtcReleaseDevice(self.device) };
    }
}

/// An Embree device. Clones share it, and scenes keep it alive.
#[derive(Clone)]
pub struct Device(Arc<DeviceHandle>);

impl Device {
    /// A device that builds scenes with as many threads as the machine has.
    pub fn new() -> Result<Self, Error> {
        Self::with_config("")
    }

    /// A device that builds scenes with at most this many threads; 0 takes all there are. Queries run on the caller's thread in any case.
    pub fn with_threads(threads: usize) -> Result<Self, Error> {
        Self::with_config(&format!("threads={threads}"))
    }

    /// A device made from Embree's own configuration string, such as `"threads=2,isa=avx2"`.
    pub fn with_config(config: &str) -> Result<Self, Error> {
        let config =
            CString::new(config).map_err(|_| Error::Start { message: "its configuration holds a zero byte".into() })?;
        // SAFETY: `config` is a C string that lives through the call.
        let device = unsafe { sys::rtcNewDevice(config.as_ptr()) };
        if device.is_null() {
            // SAFETY: with a null device both functions tell about the failed creation; the message is a C string or null.
            let (code, message) = unsafe {
                (sys::rtcGetDeviceError(ptr::null_mut()), text(sys::rtcGetDeviceLastErrorMessage(ptr::null_mut())))
            };
            return Err(Error::Start { message: format!("{message} ({})", code_name(code)) });
        }
        let handle = DeviceHandle { device, monitor: Box::default(), building: Mutex::new(()) };
        // SAFETY: the device is valid; `monitor` is boxed, is only used through shared references, and outlives the device (see Drop).
        unsafe {
            let found = sys::rtcGetDeviceProperty(device, sys::RTC_DEVICE_PROPERTY_VERSION) as isize;
            if found < OLDEST_LIBRARY {
                return Err(Error::Version { found });
            }
            let monitor = ptr::from_ref::<Monitor>(&handle.monitor).cast_mut().cast::<c_void>();
            sys::rtcSetDeviceErrorFunction(device, Some(record_error), monitor);
            sys::rtcSetDeviceMemoryMonitorFunction(device, Some(record_memory), monitor);
        }
        Ok(Self(Arc::new(handle)))
    }

    /// The version of the library in use, as (major, minor, patch).
    pub fn version(&self) -> (u32, u32, u32) {
        // SAFETY: the device is valid.
        let version = unsafe { sys::rtcGetDeviceProperty(self.0.device, sys::RTC_DEVICE_PROPERTY_VERSION) } as u32;
        (version / 10000, version / 100 % 100, version % 100)
    }

    /// Bytes that Embree itself holds for all scenes of this device; the vertices and indices, which scenes share with it, come on top.
    pub fn memory_bytes(&self) -> u64 {
        self.0.monitor.bytes.load(Ordering::Relaxed).max(0) as u64
    }

    /// The first error that Embree has reported since the build began, if any.
    fn check(&self, during: &'static str) -> Result<(), Error> {
        match lock(&self.0.monitor.error).take() {
            None => Ok(()),
            Some((code, message)) => Err(Error::Library { during, code: code_name(code), message }),
        }
    }
}

impl std::fmt::Debug for Device {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (major, minor, patch) = self.version();
        write!(f, "Device(Embree {major}.{minor}.{patch})")
    }
}

/// Nothing is left half done under these locks, so a panic elsewhere does not spoil them.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// # Safety
/// `message` is null or a C string.
unsafe fn text(message: *const c_char) -> String {
    if message.is_null() {
        return "no message".into();
    }
    // SAFETY: the caller's promise.
    unsafe { CStr::from_ptr(message) }.to_string_lossy().into_owned()
}

fn code_name(code: sys::RTCError) -> String {
    // SAFETY: Embree returns a static string for any code.
    unsafe { text(sys::rtcGetErrorString(code)) }
}

/// Keeps the first error: later ones are mostly its consequences.
unsafe extern "C" fn record_error(monitor: *mut c_void, code: sys::RTCError, message: *const c_char) {
    // SAFETY: `with_config` registered a Monitor that outlives the device; Embree passes a C string.
    let (monitor, message) = unsafe { (&*monitor.cast::<Monitor>(), text(message)) };
    lock(&monitor.error).get_or_insert((code, message));
}

/// Called with the bytes about to be taken (positive) or given back (negative); true lets Embree go on.
unsafe extern "C" fn record_memory(monitor: *mut c_void, bytes: isize, _post: bool) -> bool {
    // SAFETY: `with_config` registered a Monitor that outlives the device.
    unsafe { &*monitor.cast::<Monitor>() }.bytes.fetch_add(bytes as i64, Ordering::Relaxed);
    true
}

/// A committed scene of one geometry.
struct SceneHandle {
    scene: sys::RTCScene,
    _device: Device,
}

// SAFETY: a committed scene is only read; Embree allows queries from any number of threads, and the release from any.
unsafe impl Send for SceneHandle {}
// SAFETY: as above.
unsafe impl Sync for SceneHandle {}

impl Drop for SceneHandle {
    fn drop(&mut self) {
        // SAFETY: the handle holds the reference that rtcNewScene returned.
        unsafe { sys::rtcReleaseScene(self.scene) };
    }
}

/// One shared buffer: elements of `stride` bytes, the first of which is at `data`.
struct Buffer {
    data: *const c_void,
    stride: usize,
    count: usize,
    format: sys::RTCFormat,
}

/// What distinguishes the two kinds of scene.
struct GeometryKind {
    geometry: sys::RTCGeometryType,
    scene_flags: sys::RTCSceneFlags,
    argument_filter: bool,
    during: &'static str,
}

impl SceneHandle {
    /// Builds a scene of one geometry, or of none where `indices` is empty.
    ///
    /// # Safety
    /// Both buffers must outlive the handle, unchanged; each vertex must be readable as 16 bytes; each index must be that of a vertex.
    unsafe fn build(device: &Device, kind: &GeometryKind, vertices: &Buffer, indices: &Buffer) -> Result<Self, Error> {
        let _building = lock(&device.0.building);
        *lock(&device.0.monitor.error) = None;
        // SAFETY: the handles are those that Embree returned (it reports an error on null instead of using it); the scene keeps its own
        // reference of the geometry; the buffers are as the caller promises.
        unsafe {
            let scene = sys::rtcNewScene(device.0.device);
            if scene.is_null() {
                device.check(kind.during)?;
                return Err(Error::Start { message: "it returned no scene and no error".into() });
            }
            let handle = Self { scene, _device: device.clone() };
            sys::rtcSetSceneFlags(scene, kind.scene_flags);
            // HIGH quality splits primitives and may report one twice.
            sys::rtcSetSceneBuildQuality(scene, sys::RTC_BUILD_QUALITY_MEDIUM);
            if indices.count > 0 {
                let geometry = sys::rtcNewGeometry(device.0.device, kind.geometry);
                for (role, buffer) in [(sys::RTC_BUFFER_TYPE_VERTEX, vertices), (sys::RTC_BUFFER_TYPE_INDEX, indices)] {
                    let Buffer { data, stride, count, format } = *buffer;
                    sys::rtcSetSharedGeometryBuffer(geometry, role, 0, format, data, 0, stride, count);
                }
                sys::rtcSetGeometryBuildQuality(geometry, sys::RTC_BUILD_QUALITY_MEDIUM);
                sys::rtcSetGeometryEnableFilterFunctionFromArguments(geometry, kind.argument_filter);
                sys::rtcCommitGeometry(geometry);
                sys::rtcAttachGeometry(scene, geometry);
                sys::rtcReleaseGeometry(geometry);
            }
            sys::rtcCommitScene(scene);
            device.check(kind.during)?;
            Ok(handle)
        }
    }
}

/// A ray as Embree wants it, or none where a query could not hit anything by rights: what is not finite, no direction, an empty range.
fn embree_ray(origin: Vec3, direction: Vec3, near: f32, far: f32) -> Option<sys::RTCRay> {
    let sound = origin.is_finite() && direction.is_finite() && direction != Vec3::ZERO && near >= 0.0 && near <= far;
    sound.then_some(sys::RTCRay {
        org_x: origin.x,
        org_y: origin.y,
        org_z: origin.z,
        tnear: near,
        dir_x: direction.x,
        dir_y: direction.y,
        dir_z: direction.z,
        time: 0.0,
        tfar: far,
        mask: u32::MAX,
        id: 0,
        flags: 0,
    })
}

fn check_coordinates(index: usize, position: Vec3) -> Result<(), Error> {
    // Written so that NaN fails.
    if position.abs().max_element() < LARGEST_COORDINATE && position.is_finite() {
        return Ok(());
    }
    Err(Error::Vertex { index, value: position.to_string() })
}

fn check_count(what: &'static str, count: usize) -> Result<(), Error> {
    // u32::MAX itself means "none".
    if count < u32::MAX as usize { Ok(()) } else { Err(Error::TooMany { what, count }) }
}

/// Where a ray meets a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TriangleHit {
    /// In lengths of the ray's direction.
    pub distance: f32,
    /// Which triangle, as given to [`TriangleScene::build`].
    pub triangle: u32,
    /// Weight of the triangle's second vertex; the first has `1 - u - v`.
    pub u: f32,
    /// Weight of the triangle's third vertex.
    pub v: f32,
    /// Geometric normal `(v1 - v0) × (v2 - v0)`: its length is twice the triangle's area.
    pub normal: Vec3,
}

/// Triangles, ready to be traced. Watertight: a ray does not slip through a shared edge.
pub struct TriangleScene {
    // Before the buffers: fields are dropped in this order.
    scene: SceneHandle,
    /// One more than the caller gave, because Embree reads the last one with 16 bytes.
    positions: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
}

impl TriangleScene {
    /// Builds a scene of indexed triangles; no triangles at all is allowed.
    ///
    /// Refuses vertices that are not finite, which Embree would drop together with their triangles, and indices of vertices that are not there.
    pub fn build(device: &Device, mut positions: Vec<Vec3>, triangles: Vec<[u32; 3]>) -> Result<Self, Error> {
        let count = positions.len();
        check_count("vertices", count)?;
        check_count("triangles", triangles.len())?;
        positions.iter().enumerate().try_for_each(|(index, &p)| check_coordinates(index, p))?;
        if let Some(index) = triangles.iter().position(|t| t.iter().any(|&v| v as usize >= count)) {
            return Err(Error::Triangle { index, vertices: triangles[index], count });
        }
        positions.push(Vec3::ZERO);
        let kind = GeometryKind {
            geometry: sys::RTC_GEOMETRY_TYPE_TRIANGLE,
            scene_flags: sys::RTC_SCENE_FLAG_ROBUST,
            argument_filter: false,
            during: "building a scene of triangles",
        };
        let vertex_buffer = Buffer {
            data: positions.as_ptr().cast(),
            stride: size_of::<Vec3>(),
            count,
            format: sys::RTC_FORMAT_FLOAT3,
        };
        let index_buffer = Buffer {
            data: triangles.as_ptr().cast(),
            stride: size_of::<[u32; 3]>(),
            count: triangles.len(),
            format: sys::RTC_FORMAT_UINT3,
        };
        // SAFETY: both vectors go into the result beside the handle, are dropped after it and never changed, and a vector's elements do not
        // move with it; the vertex pushed above makes the last one readable as 16 bytes; the indices were checked.
        let scene = unsafe { SceneHandle::build(device, &kind, &vertex_buffer, &index_buffer)? };
        Ok(Self { scene, positions, triangles })
    }

    /// The vertices, as given.
    pub fn positions(&self) -> &[Vec3] {
        &self.positions[..self.positions.len() - 1]
    }

    /// The triangles, as given.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// The first triangle that the ray meets at a distance in `near..=far`, from either side. A ray that is not finite meets nothing.
    pub fn closest(&self, origin: Vec3, direction: Vec3, near: f32, far: f32) -> Option<TriangleHit> {
        let ray = embree_ray(origin, direction, near, far)?;
        let none = u32::MAX;
        let hit = sys::RTCHit { primID: none, geomID: none, instID: [none], instPrimID: [none], ..Default::default() };
        let mut query = sys::RTCRayHit { ray, hit };
        // SAFETY: the scene is committed; `query` is a whole, aligned RTCRayHit; null arguments mean the defaults.
        unsafe { sys::rtcIntersect1(self.scene.scene, &raw mut query, ptr::null_mut()) };
        let hit = &query.hit;
        (hit.geomID != none).then(|| TriangleHit {
            distance: query.ray.tfar,
            triangle: hit.primID,
            u: hit.u,
            v: hit.v,
            normal: Vec3::new(hit.Ng_x, hit.Ng_y, hit.Ng_z),
        })
    }

    /// Whether the ray meets any triangle at a distance in `near..=far`.
    pub fn occluded(&self, origin: Vec3, direction: Vec3, near: f32, far: f32) -> bool {
        let Some(mut ray) = embree_ray(origin, direction, near, far) else { return false };
        // SAFETY: the scene is committed; `ray` is a whole, aligned RTCRay; null arguments mean the defaults.
        unsafe { sys::rtcOccluded1(self.scene.scene, &raw mut ray, ptr::null_mut()) };
        ray.tfar == f32::NEG_INFINITY
    }
}

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

/// Hair segments, ready to be traced: ribbons that face the ray, of linearly interpolated radius.
///
/// A ray crosses a segment where, seen along the ray, the nearest point of the segment's axis is no farther away than the radius there. Two
/// rules of Embree and of this module:
/// - **Self-intersection.** Embree drops a crossing unless its distance along the ray exceeds twice the radius *at the crossing* (interpolated;
///   with a unit direction `distance > 2 * radius`, whatever `near` is). It judges by that only, so it is no substitute for excluding by identity.
/// - **Joints.** Embree's segments have round ends, so neighbours would both report a crossing at their joint. There `u` is clamped to exactly
///   0 or 1; such crossings are dropped. What remains ends
///   square, a bend leaves a gap or an overlap of at most a radius, and a ray through a joint to the last bit crosses neither side.
pub struct CurveScene {
    // Before the buffers: fields are dropped in this order.
    scene: SceneHandle,
    vertices: Vec<Vec4>,
    segments: Vec<u32>,
}

/// What a query hands to its filter through Embree, which knows the head of it only.
#[repr(C)]
struct CrossingQuery<'a, F> {
    context: sys::RTCRayQueryContext,
    visit: &'a mut F,
    panic: Option<Box<dyn Any + Send>>,
}

impl CurveScene {
    /// Builds a scene of segments; no segments at all is allowed.
    ///
    /// `vertices` hold a position and a **radius** (half the width) in the same unit; segment `i` runs from vertex `segments[i]` to the next.
    /// Refuses vertices that are not finite and negative radii, which Embree would drop together with their segments, and vertices not there.
    pub fn build(device: &Device, vertices: Vec<Vec4>, segments: Vec<u32>) -> Result<Self, Error> {
        let count = vertices.len();
        check_count("vertices", count)?;
        check_count("segments", segments.len())?;
        for (index, vertex) in vertices.iter().enumerate() {
            check_coordinates(index, vertex.truncate())?;
            if !(0.0..LARGEST_COORDINATE).contains(&vertex.w) {
                return Err(Error::Radius { index, radius: vertex.w });
            }
        }
        if let Some(index) = segments.iter().position(|&first| first as usize + 1 >= count) {
            return Err(Error::Segment { index, first: segments[index], count });
        }
        let kind = GeometryKind {
            geometry: sys::RTC_GEOMETRY_TYPE_FLAT_LINEAR_CURVE,
            scene_flags: sys::RTC_SCENE_FLAG_FILTER_FUNCTION_IN_ARGUMENTS,
            argument_filter: true,
            during: "building a scene of hair segments",
        };
        let vertex_buffer =
            Buffer { data: vertices.as_ptr().cast(), stride: size_of::<Vec4>(), count, format: sys::RTC_FORMAT_FLOAT4 };
        let index_buffer = Buffer {
            data: segments.as_ptr().cast(),
            stride: size_of::<u32>(),
            count: segments.len(),
            format: sys::RTC_FORMAT_UINT,
        };
        // SAFETY: both vectors go into the result beside the handle, are dropped after it and never changed, and a vector's elements do not
        // move with it; a vertex has 16 bytes; the indices, and the one after each, were checked.
        let scene = unsafe { SceneHandle::build(device, &kind, &vertex_buffer, &index_buffer)? };
        Ok(Self { scene, vertices, segments })
    }

    /// The vertices (position, radius), as given.
    pub fn vertices(&self) -> &[Vec4] {
        &self.vertices
    }

    /// The first vertex of each segment, as given.
    pub fn segments(&self) -> &[u32] {
        &self.segments
    }

    /// Calls `visit` once for every segment that the ray crosses at a distance in `near..=far`, in no particular order, until it breaks.
    ///
    /// True if it broke. The order is the same in each run on the same kind of processor, but not the order of distance. A ray that is not
    /// finite crosses nothing. A panic in `visit` ends the query and goes on in the caller.
    pub fn crossings<F>(&self, origin: Vec3, direction: Vec3, near: f32, far: f32, mut visit: F) -> bool
    where
        F: FnMut(Crossing) -> ControlFlow<()>,
    {
        let Some(mut ray) = embree_ray(origin, direction, near, far) else { return false };
        let none = u32::MAX;
        let context = sys::RTCRayQueryContext { instID: [none], instPrimID: [none] };
        let mut query = CrossingQuery { context, visit: &mut visit, panic: None };
        let mut arguments = sys::RTCOccludedArguments {
            flags: sys::RTC_RAY_QUERY_FLAG_INCOHERENT,
            feature_mask: sys::RTC_FEATURE_FLAG_ALL,
            context: (&raw mut query).cast(),
            filter: Some(filter::<F>),
            occluded: None,
        };
        // SAFETY: the scene is committed; ray, query and arguments are whole, aligned and live through the call, on this thread alone; the
        // filter is the one made for this type of query.
        unsafe { sys::rtcOccluded1(self.scene.scene, &raw mut ray, &raw mut arguments) };
        if let Some(panic) = query.panic {
            resume_unwind(panic);
        }
        ray.tfar == f32::NEG_INFINITY
    }
}

/// Embree asks whether a hit counts: no, while the visitor wants more.
unsafe extern "C" fn filter<F: FnMut(Crossing) -> ControlFlow<()>>(arguments: *const sys::RTCFilterFunctionNArguments) {
    // SAFETY: Embree passes valid arguments; the context is the one that `crossings` passed down, whose type goes with `filter::<F>`, and nobody
    // else uses it during the query. rtcOccluded1 filters one ray at a time (N = 1), for which RTCRayN and RTCHitN are laid out as RTCRay and
    // RTCHit; they are read by field, for their alignment is only that of a float.
    unsafe {
        let arguments = &*arguments;
        let query = &mut *arguments.context.cast::<CrossingQuery<F>>();
        let hit = arguments.hit.cast::<u8>();
        let crossing = Crossing {
            segment: hit.add(offset_of!(sys::RTCHit, primID)).cast::<u32>().read(),
            u: hit.add(offset_of!(sys::RTCHit, u)).cast::<f32>().read(),
            distance: arguments.ray.cast::<u8>().add(offset_of!(sys::RTCRay, tfar)).cast::<f32>().read(),
        };
        let inside = crossing.u > 0.0 && crossing.u < 1.0;
        let accept = inside
            && match catch_unwind(AssertUnwindSafe(|| (query.visit)(crossing))) {
                Ok(flow) => flow.is_break(),
                Err(panic) => {
                    query.panic = Some(panic);
                    true
                }
            };
        if !accept {
            *arguments.valid = 0;
        }
    }
}

macro_rules! debug_as_counts {
    ($scene:ident, $field:ident) => {
        impl std::fmt::Debug for $scene {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                let count: &dyn Display = &self.$field.len();
                write!(f, concat!(stringify!($scene), "({} ", stringify!($field), ")"), count)
            }
        }
    };
}
debug_as_counts!(TriangleScene, triangles);
debug_as_counts!(CurveScene, segments);
