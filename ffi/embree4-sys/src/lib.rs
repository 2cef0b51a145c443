//! Raw bindings to Embree 4, generated from the header that belongs to the library linked.
//!
//! Nothing here is safe or documented beyond Embree's own manual; Tress uses it through its `embree` module only.

#![allow(non_camel_case_types, non_snake_case, non_upper_case_globals, clippy::all)]

include!(concat!(env!("OUT_DIR"), "/embree4.rs"));

// Embree writes whole rays and hits through these: a binding smaller than the library's struct is a buffer overrun. Bindgen asserts the
// header's layout; these are the sizes of the 4.3 interface (with the instance-array member), which 4.4 kept.
const _: () = assert!(size_of::<RTCRay>() == 48);
const _: () = assert!(size_of::<RTCHit>() == 48);
const _: () = assert!(size_of::<RTCRayHit>() == 96 && align_of::<RTCRayHit>() == 16);
const _: () = assert!(RTC_VERSION >= 40300);

#[cfg(test)]
mod tests {
    use super::*;
    use std::ptr;

    #[test]
    fn library_loads_and_is_as_new_as_its_header() {
        // SAFETY: a null configuration is allowed; the device is released once and not used after.
        let version = unsafe {
            let device = rtcNewDevice(ptr::null());
            assert!(!device.is_null());
            let version = rtcGetDeviceProperty(device, RTC_DEVICE_PROPERTY_VERSION);
            rtcReleaseDevice(device);
            version
        };
        assert!(version >= RTC_VERSION as isize, "library {version}, header {RTC_VERSION}");
    }
}
