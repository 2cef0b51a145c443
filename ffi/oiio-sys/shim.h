// C interface to the part of OpenImageIO that Tress uses. The Rust declarations in src/lib.rs mirror this file.
//
// No exception leaves a function. A function with a parameter `error` sets it on failure to a message that the caller
// frees with oiio_shim_string_free, and leaves it alone on success. Paths are bytes, as the operating system has them.
#pragma once
#include <cstddef>
#include <cstdint>

extern "C" {

typedef struct oiio_shim_input oiio_shim_input;
typedef struct oiio_shim_spec oiio_shim_spec;

// How a channel is stored in a file.
enum oiio_shim_format : int32_t {
    OIIO_SHIM_OTHER = 0,
    OIIO_SHIM_U8 = 1,
    OIIO_SHIM_U16 = 2,
    OIIO_SHIM_U32 = 3,
    OIIO_SHIM_HALF = 4,
    OIIO_SHIM_FLOAT = 5,
    OIIO_SHIM_DOUBLE = 6,
};

// What an attribute's `data` points to: a C string, or `count` values.
enum oiio_shim_kind : int32_t {
    OIIO_SHIM_TEXT = 0,
    OIIO_SHIM_INT = 1,
    OIIO_SHIM_FLOATS = 2,
    OIIO_SHIM_MATRIX = 3,
};

// Geometry of an image: the data window, the display window (`full_`), tiles (0 where there are none).
typedef struct oiio_shim_header {
    int32_t x, y, width, height, depth;
    int32_t full_x, full_y, full_width, full_height, full_depth;
    int32_t channels;
    int32_t tile_width, tile_height, tile_depth;
    int32_t deep;
} oiio_shim_header;

// The pointers stay valid until the input is freed.
typedef struct oiio_shim_attribute {
    const char* name;
    const void* data;
    int32_t kind;
    int32_t count;
} oiio_shim_attribute;

void oiio_shim_string_free(char* text) noexcept;
// 10000 * major + 100 * minor + patch, of the library that is loaded.
int32_t oiio_shim_version(void) noexcept;
// Threads for reading and writing; 0 means one for each core.
void oiio_shim_set_threads(int32_t count) noexcept;

// Opens `path` with the reader called `format`, whatever its extension. Null on failure.
oiio_shim_input* oiio_shim_input_open(const char* format, const char* path, char** error) noexcept;
void oiio_shim_input_free(oiio_shim_input* input) noexcept;
void oiio_shim_input_header(const oiio_shim_input* input, oiio_shim_header* header) noexcept;
// Null, and OIIO_SHIM_OTHER, where `channel` is out of range.
const char* oiio_shim_input_channel_name(const oiio_shim_input* input, int32_t channel) noexcept;
int32_t oiio_shim_input_channel_format(const oiio_shim_input* input, int32_t channel) noexcept;
int32_t oiio_shim_input_attribute_count(const oiio_shim_input* input) noexcept;
// 0 where `index` is out of range, else 1.
int32_t oiio_shim_input_attribute(oiio_shim_input* input, int32_t index, oiio_shim_attribute* attribute) noexcept;
// Reads rows y_begin .. y_end (in the file's own coordinates; in a tiled file whole rows of tiles) of every channel of the
// first image at full resolution; `count` is the number of floats at `data` and must be exact. 1 on success, else 0.
int32_t oiio_shim_input_read(oiio_shim_input* input, int32_t y_begin, int32_t y_end, float* data, size_t count,
                             char** error) noexcept;

// A description of an image to be written. `header` gives windows and channel count; tiles and deep data are ignored.
oiio_shim_spec* oiio_shim_spec_new(const oiio_shim_header* header, char** error) noexcept;
void oiio_shim_spec_free(oiio_shim_spec* spec) noexcept;
int32_t oiio_shim_spec_channel(oiio_shim_spec* spec, int32_t channel, const char* name, int32_t format,
                               char** error) noexcept;
int32_t oiio_shim_spec_attribute(oiio_shim_spec* spec, const oiio_shim_attribute* attribute, char** error) noexcept;

// Writes a whole image, interleaved, with the writer called `format`: opens, writes, closes and asks for errors after each
// step. JPEG is made in memory first. 1 on success, else 0; success does not mean that the file is whole (some writers do not notice a full disk).
int32_t oiio_shim_write(const oiio_shim_spec* spec, const char* format, const char* path, const float* data, size_t count,
                        char** error) noexcept;
}
