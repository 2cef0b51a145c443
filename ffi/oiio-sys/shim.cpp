#include "shim.h"

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>

#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <deque>
#include <exception>
#include <limits>
#include <memory>
#include <mutex>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

using OIIO::ImageInput;
using OIIO::ImageOutput;
using OIIO::ImageSpec;
using OIIO::ParamValue;
using OIIO::TypeDesc;

struct oiio_shim_input {
    std::unique_ptr<ImageInput> reader;
    ImageSpec spec;
    // Attribute values in words, for types the interface does not carry; a deque keeps their addresses.
    std::deque<std::string> texts;
};

struct oiio_shim_spec {
    ImageSpec spec;
};

namespace {

void set_error(char** error, const char* message) noexcept {
    if (!error) return;
    const std::size_t size = std::strlen(message) + 1;
    *error = static_cast<char*>(std::malloc(size));
    if (*error) std::memcpy(*error, message, size);
}

// Runs `body`; turns an exception into `error` and the result `failed`.
template <class Result, class Body>
Result guarded(char** error, Result failed, Body&& body) noexcept {
    try {
        return body();
    } catch (const std::exception& exception) {
        set_error(error, exception.what());
    } catch (...) {
        set_error(error, "an exception of unknown type");
    }
    return failed;
}

[[noreturn]] void fail(std::string message, const char* otherwise) {
    throw std::runtime_error(message.empty() ? std::string(otherwise) : std::move(message));
}

// The older and the newer reader for OpenEXR differ in what they accept; releases differ in which one is the default.
void initialise() {
    static std::once_flag once;
    std::call_once(once, [] { OIIO::attribute("openexr:core", 0); });
}

int32_t format_of(TypeDesc type) {
    switch (type.basetype) {
    case TypeDesc::UINT8: return OIIO_SHIM_U8;
    case TypeDesc::UINT16: return OIIO_SHIM_U16;
    case TypeDesc::UINT32: return OIIO_SHIM_U32;
    case TypeDesc::HALF: return OIIO_SHIM_HALF;
    case TypeDesc::FLOAT: return OIIO_SHIM_FLOAT;
    case TypeDesc::DOUBLE: return OIIO_SHIM_DOUBLE;
    default: return OIIO_SHIM_OTHER;
    }
}

TypeDesc type_of(int32_t format) {
    switch (format) {
    case OIIO_SHIM_U8: return TypeDesc::UINT8;
    case OIIO_SHIM_U16: return TypeDesc::UINT16;
    case OIIO_SHIM_HALF: return TypeDesc::HALF;
    case OIIO_SHIM_FLOAT: return TypeDesc::FLOAT;
    default: throw std::invalid_argument("a pixel format that cannot be written");
    }
}

// width * height * channels, or an exception where one of them is not positive or the product overflows.
std::size_t value_count(int64_t width, int64_t height, int64_t channels) {
    if (width <= 0 || height <= 0 || channels <= 0) throw std::invalid_argument("an image without pixels");
    const std::size_t most = std::numeric_limits<std::size_t>::max() / sizeof(float);
    const std::size_t pixels = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
    if (pixels > most / static_cast<std::size_t>(channels)) throw std::invalid_argument("an image too large to address");
    return pixels * static_cast<std::size_t>(channels);
}

void save(const std::vector<unsigned char>& bytes, const char* path) {
    std::FILE* file = std::fopen(path, "wb");
    bool ok = file && std::fwrite(bytes.data(), 1, bytes.size(), file) == bytes.size();
    int code = errno;
    if (file && std::fclose(file) != 0) {
        if (ok) code = errno;
        ok = false;
    }
    if (!ok) fail(std::strerror(code), "the file cannot be written");
}

}  // namespace

void oiio_shim_string_free(char* text) noexcept { std::free(text); }

int32_t oiio_shim_version(void) noexcept {
    return guarded(nullptr, 0, [] { return static_cast<int32_t>(OIIO::openimageio_version()); });
}

void oiio_shim_set_threads(int32_t count) noexcept {
    guarded(nullptr, 0, [&] {
        OIIO::attribute("threads", count);
        OIIO::attribute("exr_threads", count);
        return 0;
    });
}

oiio_shim_input* oiio_shim_input_open(const char* format, const char* path, char** error) noexcept {
    return guarded(error, static_cast<oiio_shim_input*>(nullptr), [&] {
        initialise();
        auto input = std::make_unique<oiio_shim_input>();
        input->reader = ImageInput::create(format);
        if (!input->reader) fail(OIIO::geterror(), "this OpenImageIO has no reader for the format");
        // With threads of its own the TIFF reader unpacks strips itself, beyond what a short one holds; alone it leaves them to libtiff, which
        // says so.
        if (std::strcmp(input->reader->format_name(), "tiff") == 0) input->reader->threads(1);
        // Colour as it is stored, not multiplied by alpha: that product is only right on linear values.
        ImageSpec config;
        config.attribute("oiio:UnassociatedAlpha", 1);
        if (!input->reader->open(path, input->spec, config)) fail(input->reader->geterror(), "the file cannot be opened");
        return input.release();
    });
}

void oiio_shim_input_free(oiio_shim_input* input) noexcept {
    guarded(nullptr, 0, [&] {
        delete input;
        return 0;
    });
}

void oiio_shim_input_header(const oiio_shim_input* input, oiio_shim_header* header) noexcept {
    const ImageSpec& spec = input->spec;
    *header = {spec.x,          spec.y,           spec.width,      spec.height,      spec.depth,
               spec.full_x,     spec.full_y,      spec.full_width, spec.full_height, spec.full_depth,
               spec.nchannels,  spec.tile_width,  spec.tile_height, spec.tile_depth, spec.deep ? 1 : 0};
}

const char* oiio_shim_input_channel_name(const oiio_shim_input* input, int32_t channel) noexcept {
    const auto& names = input->spec.channelnames;
    if (channel < 0 || static_cast<std::size_t>(channel) >= names.size()) return nullptr;
    return names[static_cast<std::size_t>(channel)].c_str();
}

int32_t oiio_shim_input_channel_format(const oiio_shim_input* input, int32_t channel) noexcept {
    if (channel < 0 || channel >= input->spec.nchannels) return OIIO_SHIM_OTHER;
    return format_of(input->spec.channelformat(channel));
}

int32_t oiio_shim_input_attribute_count(const oiio_shim_input* input) noexcept {
    return static_cast<int32_t>(input->spec.extra_attribs.size());
}

int32_t oiio_shim_input_attribute(oiio_shim_input* input, int32_t index, oiio_shim_attribute* attribute) noexcept {
    return guarded(nullptr, 0, [&] {
        const auto& attributes = input->spec.extra_attribs;
        if (index < 0 || static_cast<std::size_t>(index) >= attributes.size()) return 0;
        const ParamValue& value = attributes[static_cast<std::size_t>(index)];
        const TypeDesc type = value.type();
        const int count = value.nvalues() * static_cast<int>(type.basevalues());
        *attribute = {value.name().c_str(), value.data(), OIIO_SHIM_TEXT, count};
        if (type == TypeDesc(TypeDesc::STRING) && value.nvalues() == 1) {
            attribute->data = *static_cast<const char* const*>(value.data());
            if (!attribute->data) attribute->data = "";
        } else if (type == TypeDesc(TypeDesc::INT) && value.nvalues() == 1) {
            attribute->kind = OIIO_SHIM_INT;
        } else if (type == TypeDesc(TypeDesc::FLOAT, TypeDesc::MATRIX44) && value.nvalues() == 1) {
            attribute->kind = OIIO_SHIM_MATRIX;
        } else if (type.basetype == TypeDesc::FLOAT) {
            attribute->kind = OIIO_SHIM_FLOATS;
        } else {
            attribute->data = input->texts.emplace_back(ImageSpec::metadata_val(value)).c_str();
        }
        return 1;
    });
}

int32_t oiio_shim_input_read(oiio_shim_input* input, int32_t y_begin, int32_t y_end, float* data, size_t count,
                             char** error) noexcept {
    return guarded(error, 0, [&] {
        const ImageSpec& spec = input->spec;
        const int64_t rows = static_cast<int64_t>(y_end) - y_begin;
        if (y_begin < spec.y || y_end > static_cast<int64_t>(spec.y) + spec.height) throw std::out_of_range("rows outside the image");
        if (value_count(spec.width, rows, spec.nchannels) != count) throw std::length_error("a buffer of the wrong size");
        ImageInput& reader = *input->reader;
        const auto read = [&](TypeDesc format, void* out) {
            const bool ok = spec.tile_width > 0
                                ? reader.read_tiles(0, 0, spec.x, spec.x + spec.width, y_begin, y_end, spec.z, spec.z + 1, 0,
                                                    spec.nchannels, format, out)
                                : reader.read_scanlines(0, 0, y_begin, y_end, spec.z, 0, spec.nchannels, format, out);
            // A reader may note an error and still call the rows read.
            if (!ok || reader.has_error()) fail(reader.geterror(), "the pixels cannot be read");
        };
        if (spec.format == TypeDesc::FLOAT || !spec.channelformats.empty()) {
            std::memset(data, 0, count * sizeof(float));
            read(TypeDesc::FLOAT, data);
            return 1;
        }
        // A damaged file may leave pixels out without an error. Where the library converts, they would be what its own buffer held before:
        // in a buffer of ours they are zeros.
        std::vector<unsigned char> raw(count * spec.format.size());
        read(TypeDesc::UNKNOWN, raw.data());
        if (!OIIO::convert_image(spec.nchannels, spec.width, static_cast<int>(rows), 1, raw.data(), spec.format, OIIO::AutoStride,
                           OIIO::AutoStride, OIIO::AutoStride, data, TypeDesc::FLOAT, OIIO::AutoStride, OIIO::AutoStride,
                           OIIO::AutoStride))
            throw std::runtime_error("the pixels cannot be converted");
        return 1;
    });
}

oiio_shim_spec* oiio_shim_spec_new(const oiio_shim_header* header, char** error) noexcept {
    return guarded(error, static_cast<oiio_shim_spec*>(nullptr), [&] {
        value_count(header->width, header->height, header->channels);
        auto result = std::make_unique<oiio_shim_spec>();
        ImageSpec& spec = result->spec;
        spec = ImageSpec(header->width, header->height, header->channels, TypeDesc::FLOAT);
        spec.x = header->x;
        spec.y = header->y;
        spec.full_x = header->full_x;
        spec.full_y = header->full_y;
        spec.full_width = header->full_width;
        spec.full_height = header->full_height;
        spec.channelformats.assign(static_cast<std::size_t>(header->channels), TypeDesc(TypeDesc::FLOAT));
        // OpenImageIO guesses these from the names of its own choosing; ours come later.
        spec.alpha_channel = -1;
        spec.z_channel = -1;
        return result.release();
    });
}

void oiio_shim_spec_free(oiio_shim_spec* spec) noexcept {
    guarded(nullptr, 0, [&] {
        delete spec;
        return 0;
    });
}

int32_t oiio_shim_spec_channel(oiio_shim_spec* spec, int32_t channel, const char* name, int32_t format,
                               char** error) noexcept {
    return guarded(error, 0, [&] {
        const auto index = static_cast<std::size_t>(channel);
        spec->spec.channelnames.at(index) = name;
        spec->spec.channelformats.at(index) = type_of(format);
        if (std::strcmp(name, "A") == 0) spec->spec.alpha_channel = channel;
        if (std::strcmp(name, "Z") == 0) spec->spec.z_channel = channel;
        return 1;
    });
}

int32_t oiio_shim_spec_attribute(oiio_shim_spec* spec, const oiio_shim_attribute* attribute, char** error) noexcept {
    return guarded(error, 0, [&] {
        ImageSpec& target = spec->spec;
        switch (attribute->kind) {
        case OIIO_SHIM_TEXT: target.attribute(attribute->name, static_cast<const char*>(attribute->data)); break;
        case OIIO_SHIM_INT: target.attribute(attribute->name, *static_cast<const int32_t*>(attribute->data)); break;
        case OIIO_SHIM_MATRIX:
            if (attribute->count != 16) throw std::length_error("a matrix without 16 values");
            target.attribute(attribute->name, TypeDesc(TypeDesc::FLOAT, TypeDesc::MATRIX44), attribute->data);
            break;
        case OIIO_SHIM_FLOATS:
            if (attribute->count < 1) throw std::length_error("an attribute without values");
            target.attribute(attribute->name,
                             attribute->count == 1 ? TypeDesc(TypeDesc::FLOAT) : TypeDesc(TypeDesc::FLOAT, attribute->count),
                             attribute->data);
            break;
        default: throw std::invalid_argument("an attribute of unknown kind");
        }
        return 1;
    });
}

int32_t oiio_shim_write(const oiio_shim_spec* spec, const char* format, const char* path, const float* data, size_t count,
                        char** error) noexcept {
    return guarded(error, 0, [&] {
        initialise();
        ImageSpec target = spec->spec;
        if (value_count(target.width, target.height, target.nchannels) != count) throw std::length_error("a buffer of the wrong size");
        // Writers without formats for each channel look at the common one only.
        target.format = target.channelformats.at(0);
        bool same = true;
        for (const TypeDesc& type : target.channelformats) same = same && type == target.format;
        if (same) target.channelformats.clear();
        // When it cannot write to a file, libjpeg ends the process; so it gets no file.
        std::vector<unsigned char> bytes;
        OIIO::Filesystem::IOVecOutput memory(bytes);
        const std::unique_ptr<ImageOutput> writer = ImageOutput::create(format);
        if (!writer) fail(OIIO::geterror(), "this OpenImageIO has no writer for the format");
        if (!same && !writer->supports("channelformats")) throw std::invalid_argument("the format stores all channels alike");
        const bool in_memory = std::strcmp(format, "jpeg") == 0;
        if (in_memory && !writer->set_ioproxy(&memory)) fail(writer->geterror(), "the format cannot be written to memory");
        if (!writer->open(path, target)) fail(writer->geterror(), "the file cannot be created");
        const bool written = writer->write_image(TypeDesc::FLOAT, data) && !writer->has_error();
        const std::string message = writer->geterror();
        const bool closed = writer->close() && !writer->has_error();
        if (!written) fail(message, "the pixels cannot be written");
        if (!closed) fail(writer->geterror(), "the file cannot be finished");
        if (in_memory) save(bytes, path);
        return 1;
    });
}
