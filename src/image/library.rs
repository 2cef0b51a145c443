//! A safe wrapper of the C interface in `oiio-sys`: the only `unsafe` code for images. Errors are OpenImageIO's messages.

use super::{MetaValue, PixelFormat};
use oiio_sys as sys;
use std::ffi::{CStr, CString, c_char, c_void};
use std::ops::Range;
use std::os::unix::ffi::OsStrExt;
use std::path::Path;
use std::ptr::{self, NonNull};

pub(super) use sys::oiio_shim_header as Header;

pub(super) fn set_threads(count: i32) {
    // SAFETY: takes a plain number.
    unsafe { sys::oiio_shim_set_threads(count) }
}

pub(super) fn version() -> i32 {
    // SAFETY: no arguments, no preconditions.
    unsafe { sys::oiio_shim_version() }
}

/// An open image file.
pub(super) struct Input {
    handle: NonNull<sys::oiio_shim_input>,
    pub header: Header,
}

impl Drop for Input {
    fn drop(&mut self) {
        // SAFETY: the handle came from oiio_shim_input_open and is freed here only.
        unsafe { sys::oiio_shim_input_free(self.handle.as_ptr()) }
    }
}

impl Input {
    /// Opens `path` with OpenImageIO's reader `format`, whatever its extension.
    pub fn open(format: &CStr, path: &Path) -> Result<Self, String> {
        let path = c_path(path)?;
        let mut error = ptr::null_mut();
        // SAFETY: both strings are terminated and outlive the call; `error` is a valid place for a pointer.
        let handle = unsafe { sys::oiio_shim_input_open(format.as_ptr(), path.as_ptr(), &mut error) };
        let handle = NonNull::new(handle).ok_or_else(|| take(error))?;
        let mut header = Header::default();
        // SAFETY: a live handle and a valid struct to fill.
        unsafe { sys::oiio_shim_input_header(handle.as_ptr(), &mut header) };
        Ok(Self { handle, header })
    }

    /// Name and stored format of each channel, in OpenImageIO's order.
    pub fn channels(&self) -> Vec<(String, PixelFormat)> {
        (0..self.header.channels)
            .map(|channel| {
                // SAFETY: a live handle; any index is allowed; the name is null or lives as long as the handle.
                let (name, format) = unsafe {
                    let name = sys::oiio_shim_input_channel_name(self.handle.as_ptr(), channel);
                    (text(name), sys::oiio_shim_input_channel_format(self.handle.as_ptr(), channel))
                };
                (name, format_from(format))
            })
            .collect()
    }

    pub fn metadata(&mut self) -> Vec<(String, MetaValue)> {
        // SAFETY: a live handle.
        let count = unsafe { sys::oiio_shim_input_attribute_count(self.handle.as_ptr()) };
        (0..count).filter_map(|index| self.attribute(index)).collect()
    }

    fn attribute(&mut self, index: i32) -> Option<(String, MetaValue)> {
        let mut raw = sys::oiio_shim_attribute { name: ptr::null(), data: ptr::null(), kind: 0, count: 0 };
        // SAFETY: a live handle and a valid struct to fill; any index is allowed.
        if unsafe { sys::oiio_shim_input_attribute(self.handle.as_ptr(), index, &mut raw) } == 0 || raw.data.is_null() {
            return None;
        }
        // SAFETY: `data` points to what `kind` says, `count` values of it, and lives as long as the handle, which is
        // borrowed here. OpenImageIO keeps small values inside its structs: they may be unaligned.
        let value = unsafe {
            match raw.kind {
                sys::OIIO_SHIM_INT => MetaValue::Int(raw.data.cast::<i32>().read_unaligned()),
                sys::OIIO_SHIM_MATRIX => MetaValue::Matrix(raw.data.cast::<[f32; 16]>().read_unaligned()),
                sys::OIIO_SHIM_FLOATS => {
                    let data = raw.data.cast::<f32>();
                    let count = usize::try_from(raw.count).unwrap_or(0);
                    match count {
                        1 => MetaValue::Float(data.read_unaligned()),
                        _ => MetaValue::Floats((0..count).map(|i| data.add(i).read_unaligned()).collect()),
                    }
                }
                _ => MetaValue::Str(text(raw.data.cast())),
            }
        };
        // SAFETY: a terminated string that lives as long as the handle.
        Some((unsafe { text(raw.name) }, value))
    }

    /// Reads `rows` (in the file's coordinates; in a tiled file whole rows of tiles) of every channel, interleaved.
    pub fn read_rows(&mut self, rows: Range<i32>, out: &mut [f32]) -> Result<(), String> {
        let mut error = ptr::null_mut();
        // SAFETY: a live handle; `out` is valid for `out.len()` floats and the callee checks that this is the size of the rows.
        let ok = unsafe {
            sys::oiio_shim_input_read(
                self.handle.as_ptr(),
                rows.start,
                rows.end,
                out.as_mut_ptr(),
                out.len(),
                &mut error,
            )
        };
        if ok == 1 { Ok(()) } else { Err(take(error)) }
    }
}

/// A description of an image to be written.
pub(super) struct OutputSpec(NonNull<sys::oiio_shim_spec>);

impl Drop for OutputSpec {
    fn drop(&mut self) {
        // SAFETY: the handle came from oiio_shim_spec_new and is freed here only.
        unsafe { sys::oiio_shim_spec_free(self.0.as_ptr()) }
    }
}

impl OutputSpec {
    pub fn new(header: &Header, channels: &[(String, PixelFormat)]) -> Result<Self, String> {
        let mut error = ptr::null_mut();
        // SAFETY: valid pointers for the length of the call.
        let handle = unsafe { sys::oiio_shim_spec_new(header, &mut error) };
        let spec = Self(NonNull::new(handle).ok_or_else(|| take(error))?);
        for (index, (name, format)) in (0..header.channels).zip(channels) {
            let name = c_text(name)?;
            // SAFETY: a live handle, a terminated string; the callee checks index and format.
            let ok = unsafe {
                sys::oiio_shim_spec_channel(spec.0.as_ptr(), index, name.as_ptr(), format_to(*format), &mut error)
            };
            if ok != 1 {
                return Err(take(error));
            }
        }
        Ok(spec)
    }

    pub fn set(&mut self, name: &str, value: &MetaValue) -> Result<(), String> {
        let name = c_text(name)?;
        let (kind, floats): (i32, &[f32]) = match value {
            MetaValue::Str(string) => {
                let string = c_text(string)?;
                return self.set_raw(&name, sys::OIIO_SHIM_TEXT, string.as_ptr().cast(), 1);
            }
            MetaValue::Int(number) => return self.set_raw(&name, sys::OIIO_SHIM_INT, ptr::from_ref(number).cast(), 1),
            MetaValue::Float(number) => (sys::OIIO_SHIM_FLOATS, std::slice::from_ref(number)),
            MetaValue::Floats(numbers) => (sys::OIIO_SHIM_FLOATS, numbers),
            MetaValue::Matrix(numbers) => (sys::OIIO_SHIM_MATRIX, numbers),
        };
        self.set_raw(&name, kind, floats.as_ptr().cast(), floats.len())
    }

    /// `data` must be what `kind` says, `count` values of it.
    fn set_raw(&mut self, name: &CStr, kind: i32, data: *const c_void, count: usize) -> Result<(), String> {
        let count = i32::try_from(count).map_err(|_| "too many values".to_owned())?;
        let attribute = sys::oiio_shim_attribute { name: name.as_ptr(), data, kind, count };
        let mut error = ptr::null_mut();
        // SAFETY: a live handle; `set` pairs each kind with data of that type, alive until it returns; the callee copies.
        let ok = unsafe { sys::oiio_shim_spec_attribute(self.0.as_ptr(), &attribute, &mut error) };
        if ok == 1 { Ok(()) } else { Err(take(error)) }
    }

    /// Writes the whole image with OpenImageIO's writer `format`.
    pub fn write(&self, format: &CStr, path: &Path, pixels: &[f32]) -> Result<(), String> {
        let path = c_path(path)?;
        let mut error = ptr::null_mut();
        // SAFETY: a live handle, terminated strings; `pixels` is valid for its length, which the callee checks against the spec.
        let ok = unsafe {
            sys::oiio_shim_write(
                self.0.as_ptr(),
                format.as_ptr(),
                path.as_ptr(),
                pixels.as_ptr(),
                pixels.len(),
                &mut error,
            )
        };
        if ok == 1 { Ok(()) } else { Err(take(error)) }
    }
}

fn format_from(code: i32) -> PixelFormat {
    match code {
        sys::OIIO_SHIM_U8 => PixelFormat::U8,
        sys::OIIO_SHIM_U16 => PixelFormat::U16,
        sys::OIIO_SHIM_U32 => PixelFormat::U32,
        sys::OIIO_SHIM_HALF => PixelFormat::Half,
        sys::OIIO_SHIM_FLOAT => PixelFormat::Float,
        _ => PixelFormat::Other,
    }
}

fn format_to(format: PixelFormat) -> i32 {
    match format {
        PixelFormat::U8 => sys::OIIO_SHIM_U8,
        PixelFormat::U16 => sys::OIIO_SHIM_U16,
        PixelFormat::U32 => sys::OIIO_SHIM_U32,
        PixelFormat::Half => sys::OIIO_SHIM_HALF,
        PixelFormat::Float => sys::OIIO_SHIM_FLOAT,
        PixelFormat::Other => sys::OIIO_SHIM_OTHER,
    }
}

fn c_path(path: &Path) -> Result<CString, String> {
    CString::new(path.as_os_str().as_bytes()).map_err(|_| "a file name cannot hold a zero byte".to_owned())
}

fn c_text(text: &str) -> Result<CString, String> {
    CString::new(text).map_err(|_| format!("text in a header cannot hold a zero byte: {text:?}"))
}

/// # Safety
/// `text` is null or a terminated string.
unsafe fn text(text: *const c_char) -> String {
    if text.is_null() {
        return String::new();
    }
    // SAFETY: the caller's promise.
    unsafe { CStr::from_ptr(text) }.to_string_lossy().into_owned()
}

/// Takes over an error message of the C interface.
fn take(error: *mut c_char) -> String {
    if error.is_null() {
        return "no reason given".to_owned();
    }
    // SAFETY: a message is a terminated string that we own; it is not used after it is freed.
    unsafe {
        let message = text(error);
        sys::oiio_shim_string_free(error);
        message
    }
}
