//! The C interface of `shim.h`, a layer over OpenImageIO that lets no C++ exception out. See there for the contracts;
//! safe wrappers live in Tress itself.
#![allow(non_camel_case_types)]

use std::ffi::{c_char, c_void};

/// An open image file.
#[repr(C)]
pub struct oiio_shim_input {
    _opaque: [u8; 0],
}

/// A description of an image to be written.
#[repr(C)]
pub struct oiio_shim_spec {
    _opaque: [u8; 0],
}

pub const OIIO_SHIM_OTHER: i32 = 0;
pub const OIIO_SHIM_U8: i32 = 1;
pub const OIIO_SHIM_U16: i32 = 2;
pub const OIIO_SHIM_U32: i32 = 3;
pub const OIIO_SHIM_HALF: i32 = 4;
pub const OIIO_SHIM_FLOAT: i32 = 5;
pub const OIIO_SHIM_DOUBLE: i32 = 6;

pub const OIIO_SHIM_TEXT: i32 = 0;
pub const OIIO_SHIM_INT: i32 = 1;
pub const OIIO_SHIM_FLOATS: i32 = 2;
pub const OIIO_SHIM_MATRIX: i32 = 3;

/// Geometry of an image: data window, display window (`full_`), tiles (0 where there are none).
#[repr(C)]
#[derive(Debug, Clone, Copy, Default)]
pub struct oiio_shim_header {
    pub x: i32,
    pub y: i32,
    pub width: i32,
    pub height: i32,
    pub depth: i32,
    pub full_x: i32,
    pub full_y: i32,
    pub full_width: i32,
    pub full_height: i32,
    pub full_depth: i32,
    pub channels: i32,
    pub tile_width: i32,
    pub tile_height: i32,
    pub tile_depth: i32,
    pub deep: i32,
}

/// A named value; `data` points to a C string or to `count` values, as `kind` says.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct oiio_shim_attribute {
    pub name: *const c_char,
    pub data: *const c_void,
    pub kind: i32,
    pub count: i32,
}

unsafe extern "C" {
    pub fn oiio_shim_string_free(text: *mut c_char);
    pub fn oiio_shim_version() -> i32;
    pub fn oiio_shim_set_threads(count: i32);

    pub fn oiio_shim_input_open(
        format: *const c_char,
        path: *const c_char,
        error: *mut *mut c_char,
    ) -> *mut oiio_shim_input;
    pub fn oiio_shim_input_free(input: *mut oiio_shim_input);
    pub fn oiio_shim_input_header(input: *const oiio_shim_input, header: *mut oiio_shim_header);
    pub fn oiio_shim_input_channel_name(input: *const oiio_shim_input, channel: i32) -> *const c_char;
    pub fn oiio_shim_input_channel_format(input: *const oiio_shim_input, channel: i32) -> i32;
    pub fn oiio_shim_input_attribute_count(input: *const oiio_shim_input) -> i32;
    pub fn oiio_shim_input_attribute(
        input: *mut oiio_shim_input,
        index: i32,
        attribute: *mut oiio_shim_attribute,
    ) -> i32;
    pub fn oiio_shim_input_read(
        input: *mut oiio_shim_input,
        y_begin: i32,
        y_end: i32,
        data: *mut f32,
        count: usize,
        error: *mut *mut c_char,
    ) -> i32;

    pub fn oiio_shim_spec_new(header: *const oiio_shim_header, error: *mut *mut c_char) -> *mut oiio_shim_spec;
    pub fn oiio_shim_spec_free(spec: *mut oiio_shim_spec);
    pub fn oiio_shim_spec_channel(
        spec: *mut oiio_shim_spec,
        channel: i32,
        name: *const c_char,
        format: i32,
        error: *mut *mut c_char,
    ) -> i32;
    pub fn oiio_shim_spec_attribute(
        spec: *mut oiio_shim_spec,
        attribute: *const oiio_shim_attribute,
        error: *mut *mut c_char,
    ) -> i32;
    pub fn oiio_shim_write(
        spec: *const oiio_shim_spec,
        format: *const c_char,
        path: *const c_char,
        data: *const f32,
        count: usize,
        error: *mut *mut c_char,
    ) -> i32;
}
