//! Embree's device: what scenes are built with, and where its errors arrive.

use std::ffi::{CStr, CString, c_char, c_void};
use std::ptr;
use std::sync::atomic::{AtomicI64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use embree4_sys as sys;

use super::Error;

/// The first library version whose rays and hits have the layout that Tress is built for.
const OLDEST_LIBRARY: isize = 40300;

/// What Embree's callbacks write to. Its address is known to Embree, so it lives in a box that outlives the device.
#[derive(Default)]
pub(super) struct Monitor {
    pub(super) error: Mutex<Option<(sys::RTCError, String)>>,
    bytes: AtomicI64,
}

pub(super) struct DeviceHandle {
    pub(super) device: sys::RTCDevice,
    pub(super) monitor: Box<Monitor>,
    /// Held during a build, so that an error is told to the one who caused it.
    pub(super) building: Mutex<()>,
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
pub struct Device(pub(super) Arc<DeviceHandle>);

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
    pub(super) fn check(&self, during: &'static str) -> Result<(), Error> {
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
pub(super) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
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
