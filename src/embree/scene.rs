//! A committed scene: built once, then only read.

use std::ffi::c_void;

use embree4_sys as sys;

use super::device::lock;
use super::{Device, Error};
use crate::tally::{self, Work};

/// A committed scene of one geometry.
pub(super) struct SceneHandle {
    pub(super) scene: sys::RTCScene,
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
pub(super) struct Buffer {
    pub(super) data: *const c_void,
    pub(super) stride: usize,
    pub(super) count: usize,
    pub(super) format: sys::RTCFormat,
}

/// What distinguishes the two kinds of scene.
pub(super) struct GeometryKind {
    pub(super) geometry: sys::RTCGeometryType,
    pub(super) scene_flags: sys::RTCSceneFlags,
    pub(super) argument_filter: bool,
    pub(super) during: &'static str,
    /// What a scene and its primitives are counted as.
    pub(super) counted: [Work; 2],
}

impl SceneHandle {
    /// Builds a scene of one geometry, or of none where `indices` is empty.
    ///
    /// # Safety
    /// Both buffers must outlive the handle, unchanged; each vertex must be readable as 16 bytes; each index must be that of a vertex.
    pub(super) unsafe fn build(
        device: &Device,
        kind: &GeometryKind,
        vertices: &Buffer,
        indices: &Buffer,
    ) -> Result<Self, Error> {
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
                tally::add(kind.counted[0], 1);
                tally::add(kind.counted[1], indices.count as u64);
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
