// The container of glTF: JSON, chunks, buffers and accessors.
//
//   .glb     | header 12 bytes | length, type | JSON | length, type | binary data |
//
//   bytes that an accessor reads:
//
//   buffer       | ... | buffer view                                             | ...
//   buffer view        | byteOffset | element 0 | ... | element 1 | ...          |
//                                   |<--- byteStride --->|
//
// Every offset and length comes from the file. They are compared so that nothing can overflow: an
// offset with a size first, then a length with what is left behind the offset.
#include "engine/io/mesh/gltf_document.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <string_view>
#include <utility>

#include "engine/base/error.h"
#include "engine/io/file/url.h"
#include "engine/io/mesh/gltf_numbers.h"
#include "engine/io/mesh/json_meter.h"

namespace ptc {
namespace {

std::uint32_t u32_at(std::span<const std::byte> bytes, std::size_t at) {
  std::uint32_t value = 0;
  std::memcpy(&value, bytes.data() + at, sizeof value);
  return value;
}

int hex_digit(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  return c >= 'A' && c <= 'F' ? c - 'A' + 10 : -1;
}

// Decodes base64, or returns nothing when a character is not base64. Source: RFC 4648, section 4.
std::optional<std::vector<std::byte>> decode_base64(std::string_view text) {
  constexpr std::string_view kDigits =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  while (text.ends_with('=')) text.remove_suffix(1);
  std::array<std::uint8_t, 256> value{};
  value.fill(255);
  for (std::size_t i = 0; i < kDigits.size(); ++i) {
    value[static_cast<unsigned char>(kDigits[i])] = static_cast<std::uint8_t>(i);
  }
  std::vector<std::byte> bytes;
  bytes.reserve(text.size() / 4 * 3 + 3);
  std::uint32_t bits = 0;
  int held = 0;
  for (const char c : text) {
    const std::uint8_t digit = value[static_cast<unsigned char>(c)];
    if (digit == 255) return std::nullopt;
    bits = bits << 6 | digit;
    held += 6;
    if (held < 8) continue;
    held -= 8;
    bytes.push_back(static_cast<std::byte>(bits >> held & 255));
  }
  return bytes;
}

// Refuses a document whose JSON takes more memory than there is.
[[noreturn]] void refuse_room(const std::filesystem::path& path, std::uint64_t bytes) {
  throw LimitError(path.string() + ": its JSON does not fit in `run.memory_bytes`: it takes " +
                   std::to_string((bytes >> 20) + 1) + " MiB or more");
}

// Refuses a document whose decompressed buffer views take more memory than there is.
[[noreturn]] void refuse_views(const std::filesystem::path& path, std::uint64_t bytes) {
  throw LimitError(path.string() +
                   ": its bufferViews that meshoptimizer compressed do not fit in "
                   "`run.memory_bytes`: they take " +
                   std::to_string((bytes >> 20) + 1) + " MiB or more");
}

// Returns the numbers in an element of a type, or 0 for matrices and unknown types.
std::size_t components_of(const std::string& type) {
  if (type == "SCALAR") return 1;
  if (type == "VEC2") return 2;
  if (type == "VEC3") return 3;
  return type == "VEC4" ? 4 : 0;
}

}  // namespace

GltfDocument::GltfDocument(const std::filesystem::path& path, std::uint64_t memory_bytes)
    : path_(path), file_(path), view_room_(memory_bytes) {
  bytes_read_ = file_.size();
  std::array<std::byte, 4> magic{};
  if (file_.size() >= 12) file_.read_at(0, magic);
  if (u32_at(magic, 0) == kGlbMagic) {
    read_chunks(memory_bytes);
  } else {
    parse(read_text(0, file_.size(), memory_bytes), memory_bytes);
  }
  buffers_.resize(count("buffers"));
  view_room_ -= std::min(view_room_, json_bytes_);
}

void GltfDocument::fail(const std::string& rule) const {
  throw DataError(path_.string() + ": " + rule);
}

// Reads the JSON of the file, if there is room for it.
std::vector<std::byte> GltfDocument::read_text(std::uint64_t offset, std::uint64_t length,
                                               std::uint64_t memory_bytes) const {
  if (length > memory_bytes) refuse_room(path_, length);
  std::vector<std::byte> text(length);
  file_.read_at(offset, text);
  return text;
}

void GltfDocument::parse(const std::vector<std::byte>& text, std::uint64_t memory_bytes) {
  // Measure the values before they are kept, so that nested arrays do not fill the memory first
  const auto* begin = reinterpret_cast<const char*>(text.data());
  JsonMeter meter;
  try {
    Json::sax_parse(begin, begin + text.size(), &meter);
    if (meter.too_deep()) fail("its JSON is nested more than 128 deep");
    json_bytes_ = meter.bytes();
    if (text.size() + json_bytes_ > memory_bytes) refuse_room(path_, text.size() + json_bytes_);
    root_ = Json::parse(begin, begin + text.size());
  } catch (const Json::exception& error) {
    fail(error.what());
  }
  if (!root_.is_object()) fail("the JSON of a glTF must be an object");
}

// Reads a GLB: 12 bytes of header, then chunks of length, type and data. The first is the JSON; the
// second may be the binary data.
void GltfDocument::read_chunks(std::uint64_t memory_bytes) {
  std::array<std::byte, 12> header;
  file_.read_at(0, header);
  if (u32_at(header, 4) != 2) fail("the version of the GLB is not 2");
  if (u32_at(header, 8) != file_.size()) fail("the GLB declares another length than the file has");
  std::uint64_t at = 12;
  for (std::size_t chunk = 0; at < file_.size(); ++chunk) {
    if (file_.size() - at < 8)
      fail("offset " + std::to_string(at) + ": the file ends in the header of a GLB chunk");
    std::array<std::byte, 8> head;
    file_.read_at(at, head);
    const std::uint32_t length = u32_at(head, 0);
    const std::uint32_t type = u32_at(head, 4);
    at += 8;
    if (length > file_.size() - at) {
      fail("offset " + std::to_string(at) + ": a GLB chunk reaches past the end of the file");
    }
    if ((chunk == 0) != (type == kGlbJson))
      fail("the first chunk of a GLB, and no other, must be JSON");
    if (chunk == 0) parse(read_text(at, length, memory_bytes), memory_bytes);
    if (chunk == 1 && type == kGlbBinary) {
      binary_chunk_.file = &file_;
      binary_chunk_.offset = at;
      binary_chunk_.length = length;
    }
    at += length;
  }
  if (root_.is_null()) fail("the GLB has no JSON");
}

std::size_t GltfDocument::count(const char* array) const {
  const auto found = root_.find(array);
  if (found == root_.end()) return 0;
  if (!found->is_array()) fail(std::string(array) + " is not an array");
  return found->size();
}

const GltfDocument::Json* GltfDocument::member(const Json& object, const char* key) {
  const auto found = object.find(key);
  return found == object.end() || !found->is_object() ? nullptr : &*found;
}

const GltfDocument::Json* GltfDocument::extension(const Json& object, const char* name) {
  const Json* const extensions = member(object, "extensions");
  return extensions == nullptr ? nullptr : member(*extensions, name);
}

const GltfDocument::Json& GltfDocument::at(const char* array, std::uint64_t index) const {
  if (index >= count(array)) fail(std::string(array) + " has no entry " + std::to_string(index));
  const Json& entry = root_[array][index];
  if (!entry.is_object()) fail(std::string(array) + " holds a value that is not an object");
  return entry;
}

std::optional<std::uint64_t> GltfDocument::unsigned_at(const Json& object, const char* key) const {
  const auto found = object.find(key);
  if (found == object.end()) return std::nullopt;
  if (!found->is_number_unsigned()) fail(std::string(key) + " is not an unsigned integer");
  return found->get<std::uint64_t>();
}

double GltfDocument::number_at(const Json& object, const char* key, double otherwise) const {
  const auto found = object.find(key);
  if (found == object.end()) return otherwise;
  if (!found->is_number() || !std::isfinite(found->get<double>())) {
    fail(std::string(key) + " is not a finite number");
  }
  return found->get<double>();
}

std::string GltfDocument::file_name(const std::string& uri) {
  std::string name;
  for (std::size_t i = 0; i < uri.size(); ++i) {
    const int high = uri[i] == '%' && i + 2 < uri.size() ? hex_digit(uri[i + 1]) : -1;
    const int low = high >= 0 ? hex_digit(uri[i + 2]) : -1;
    if (low < 0) {
      name.push_back(uri[i]);
      continue;
    }
    name.push_back(static_cast<char>(high * 16 + low));
    i += 2;
  }
  return name;
}

// Opens a file that the document names.
InputFile GltfDocument::open_part(const std::filesystem::path& name) const {
  const std::filesystem::path part = file_beside(path_, name.string());
  if (!is_file(part)) fail("its file " + part.string() + " is missing");
  return InputFile(part);
}

std::vector<std::byte> GltfDocument::decode_uri(const std::string& uri) const {
  const std::size_t comma = uri.find(";base64,");
  if (comma == std::string::npos) fail("a data URI is not base64");
  auto bytes = decode_base64(std::string_view(uri).substr(comma + 8));
  if (!bytes) fail("a data URI has characters that are not base64");
  return std::move(*bytes);
}

ByteRange GltfDocument::Buffer::part(std::uint64_t at, std::uint64_t size) const {
  if (file != nullptr) return {*file, offset + at, size};
  return ByteRange(std::span(held).subspan(at, size));
}

const GltfDocument::Buffer& GltfDocument::buffer(std::uint64_t index) {
  const Json& description = at("buffers", index);
  std::optional<Buffer>& found = buffers_[index];
  if (found) return *found;

  // Find its bytes. A file that several buffers name is opened, and counted, once
  const auto uri = description.find("uri");
  const bool has_uri = uri != description.end();
  if (has_uri && !uri->is_string()) fail("a uri is not a string");
  Buffer made;
  if (!has_uri) {
    if (index == 0) made = binary_chunk_;
  } else if (const std::string& text = uri->get_ref<const std::string&>();
             text.starts_with("data:")) {
    made.held = decode_uri(text);
    made.length = made.held.size();
    bytes_read_ += made.length;
  } else {
    const std::string name = std::filesystem::path(file_name(text)).lexically_normal().string();
    auto known = files_.find(name);
    if (known == files_.end()) {
      known = files_.try_emplace(name, open_part(name)).first;
      bytes_read_ += known->second.size();
    }
    made.file = &known->second;
    made.length = known->second.size();
  }

  // Take as many bytes as the buffer declares, because binary chunks are padded
  const std::uint64_t length = unsigned_at(description, "byteLength").value_or(0);
  if (length > made.length) {
    fail("buffer " + std::to_string(index) + " has only " + std::to_string(made.length) +
         " bytes of the declared " + std::to_string(length));
  }
  made.length = length;
  return found.emplace(std::move(made));
}

GltfDocument::View GltfDocument::find_view(std::uint64_t index) {
  const auto known = decompressed_.find(index);
  if (known != decompressed_.end()) return known->second;
  if (const auto stream = find_stream(index)) return decompress(index, *stream);
  return checked_view(at("bufferViews", index), "bufferView " + std::to_string(index));
}

GltfDocument::View GltfDocument::checked_view(const Json& description, const std::string& name) {
  const auto owner = unsigned_at(description, "buffer");
  if (!owner) fail("a bufferView has no buffer");
  const std::uint64_t bytes = buffer(*owner).length;
  const View view{*owner, unsigned_at(description, "byteOffset").value_or(0),
                  unsigned_at(description, "byteLength").value_or(0)};
  if (view.offset > bytes || view.length > bytes - view.offset) {
    fail(name + " reaches past its buffer");
  }
  return view;
}

std::optional<GltfDocument::Stream> GltfDocument::find_stream(std::uint64_t index) {
  const Json& description = at("bufferViews", index);
  const Json* const json = extension(description, "EXT_meshopt_compression");
  if (json == nullptr) return std::nullopt;
  const std::string name = "bufferView " + std::to_string(index);
  Stream stream{.view = checked_view(*json, name), .how = {}};
  stream.how.count = unsigned_at(*json, "count").value_or(0);
  stream.how.stride = unsigned_at(*json, "byteStride").value_or(0);
  if (const char* const rule = read_meshopt_view(*json, stream.how))
    fail(name + ": meshopt: " + rule);
  if (!stream.how.may_come_of(stream.view.length))
    fail(name + ": meshopt: it has more elements than bytes for them");
  if (unsigned_at(description, "byteLength").value_or(0) != stream.how.bytes() ||
      unsigned_at(description, "byteStride").value_or(stream.how.stride) != stream.how.stride) {
    fail(name + ": meshopt: its elements do not fill it");
  }
  return stream;
}

GltfDocument::View GltfDocument::decompress(std::uint64_t index, const Stream& stream) {
  const std::uint64_t needed = stream.how.bytes() + stream.view.length;
  if (needed > view_room_ - views_taken_) refuse_views(path_, views_taken_ + needed);
  std::vector<std::byte> bytes(stream.view.length);
  buffers_[stream.view.buffer]->part(stream.view.offset, bytes.size()).read(0, bytes);
  Buffer made;
  made.held = decode_meshopt(bytes, stream.how);
  if (made.held.size() != stream.how.bytes())
    fail("bufferView " + std::to_string(index) + ": meshopt: the stream is damaged");
  made.length = made.held.size();
  views_taken_ += made.length;
  const View view{buffers_.size(), 0, made.length};
  buffers_.emplace_back(std::move(made));
  return decompressed_.emplace(index, view).first->second;
}

std::uint64_t GltfDocument::view_bytes() {
  std::uint64_t bytes = 0, greatest = 0;
  for (std::uint64_t i = 0; i < count("bufferViews"); ++i) {
    const auto stream = find_stream(i);
    if (!stream) continue;
    const std::uint64_t more = stream->how.bytes();
    if (!decompressed_.contains(i)) greatest = std::max(greatest, stream->view.length);
    if (more > view_room_ || bytes + greatest > view_room_ - more)
      refuse_views(path_, bytes + greatest + more);
    bytes += more;
  }
  return bytes + greatest;
}

ByteRange GltfDocument::view(std::uint64_t index) {
  const View view = find_view(index);
  return buffers_[view.buffer]->part(view.offset, view.length);
}

bool GltfDocument::has_weights(const Json& object) {
  const auto weights = object.find("weights");
  return weights != object.end() && std::ranges::any_of(*weights, [](const Json& weight) {
           return weight.is_number() && weight.get<double>() != 0;
         });
}

GltfDocument::Elements GltfDocument::find_shape(std::uint64_t index, std::size_t components,
                                                std::optional<std::uint64_t> expected) const {
  const Json& accessor = at("accessors", index);
  const std::string name = "accessor " + std::to_string(index);
  const std::uint64_t type = unsigned_at(accessor, "componentType").value_or(0);
  if (!gltf_number(type)) fail(name + " has an unknown componentType");
  const auto shape = accessor.find("type");
  if (shape == accessor.end() || !shape->is_string() ||
      components_of(shape->get<std::string>()) != components) {
    fail(name + " is of the wrong type");
  }
  const std::uint64_t count = unsigned_at(accessor, "count").value_or(0);
  if (expected && count != *expected)
    fail(name + " has another number of elements than the others beside it");
  const auto flag = accessor.find("normalized");
  return {.count = count,
          .components = components,
          .type = type,
          .normalised = flag != accessor.end() && flag->is_boolean() && flag->get<bool>()};
}

GltfDocument::Elements GltfDocument::find_elements(std::uint64_t index, std::size_t components,
                                                   std::optional<std::uint64_t> expected) {
  const Json& accessor = at("accessors", index);
  const std::string name = "accessor " + std::to_string(index);
  const auto view_index = unsigned_at(accessor, "bufferView");
  const Json* const sparse = member(accessor, "sparse");
  if (!view_index && (sparse == nullptr || !expected)) fail(name + " has no bufferView");
  Elements found = find_shape(index, components, expected);
  found.accessor = index;
  if (sparse != nullptr) find_replaced(*sparse, name, found);
  if (!view_index) return found;
  found.has_view = true;

  // Check that all elements lie in the buffer view
  const View view = find_view(*view_index);
  const std::uint64_t offset = unsigned_at(accessor, "byteOffset").value_or(0);
  const std::uint64_t element_bytes = gltf_number(found.type)->bytes * components;
  found.stride = unsigned_at(at("bufferViews", *view_index), "byteStride").value_or(element_bytes);
  if (found.stride < element_bytes) fail(name + " has elements that overlap");
  // This is (count - 1) * stride + element_bytes > view.length - offset without overflow
  if (found.count > 0 &&
      (offset > view.length || element_bytes > view.length - offset ||
       found.count - 1 > (view.length - offset - element_bytes) / found.stride)) {
    fail(name + " reaches past its bufferView");
  }
  found.buffer = view.buffer;
  found.offset = view.offset + offset;
  return found;
}

// Finds the elements of a sparse accessor that others take the place of (section 3.6.2.3).
void GltfDocument::find_replaced(const Json& sparse, const std::string& name, Elements& found) {
  Elements::Replaced& replaced = found.replaced;
  replaced.count = unsigned_at(sparse, "count").value_or(0);
  replaced.of = found.count;
  const Json* const indices = member(sparse, "indices");
  const Json* const values = member(sparse, "values");
  if (replaced.count == 0 || replaced.count > found.count || indices == nullptr ||
      values == nullptr) {
    fail(name + " is sparse without a count, indices and values of it");
  }
  const auto place = [&](const Json& part, std::uint64_t bytes, std::uint64_t& buffer,
                         std::uint64_t& offset) {
    const auto view_index = unsigned_at(part, "bufferView");
    if (!view_index) fail(name + " is sparse, but its indices or values have no bufferView");
    const View view = find_view(*view_index);
    const std::uint64_t from = unsigned_at(part, "byteOffset").value_or(0);
    if (from > view.length || replaced.count > (view.length - from) / bytes)
      fail(name + " is sparse, and its indices or values reach past their bufferView");
    buffer = view.buffer;
    offset = view.offset + from;
  };
  replaced.index_type = unsigned_at(*indices, "componentType").value_or(0);
  const std::uint64_t type = replaced.index_type;
  if (type != kGltfUint8 && type != kGltfUint16 && type != kGltfUint32)
    fail(name + " is sparse, and its indices are of no unsigned type");
  place(*indices, gltf_number(type)->bytes, replaced.index_buffer, replaced.index_offset);
  place(*values, gltf_number(found.type)->bytes * found.components, replaced.value_buffer,
        replaced.value_offset);
}

/// Reads the elements that take the place of others, one after another.
class GltfDocument::Replacement {
 public:
  Replacement(const GltfDocument& document, const Elements& of)
      : document_(document),
        of_(of),
        index_bytes_(of.replaced.count > 0 ? gltf_number(of.replaced.index_type)->bytes : 0),
        value_bytes_(gltf_number(of.type)->bytes * of.components) {
    do {
      advance();
    } while (at_ < of.first);
  }

  /// Returns the bytes of an element, or null when nothing takes its place.
  /// @param index  in the accessor; must ascend from call to call
  [[nodiscard]] const std::byte* find(std::uint64_t index) {
    if (at_ < index) advance();
    return at_ == index ? value_ : nullptr;
  }

 private:
  static constexpr std::uint64_t kAtOnce = 1 << 10;

  // Goes on to the next one.
  void advance() {
    const Elements::Replaced& replaced = of_.replaced;
    if (done_ == replaced.count) {
      at_ = std::numeric_limits<std::uint64_t>::max();
      return;
    }
    const std::uint64_t k = done_ % kAtOnce;
    if (k == 0) {
      const std::uint64_t count = std::min(kAtOnce, replaced.count - done_);
      indices_.resize(count * index_bytes_);
      values_.resize(count * value_bytes_);
      const auto read = [&](std::uint64_t buffer, std::uint64_t offset,
                            std::vector<std::byte>& to) {
        document_.buffers_[buffer]->part(offset, to.size()).read(0, to);
      };
      read(replaced.index_buffer, replaced.index_offset + done_ * index_bytes_, indices_);
      read(replaced.value_buffer, replaced.value_offset + done_ * value_bytes_, values_);
    }
    const auto index = static_cast<std::uint64_t>(
        load_gltf_number(&indices_[k * index_bytes_], replaced.index_type));
    if ((done_ > 0 && index <= at_) || index >= replaced.of) {
      document_.fail("accessor " + std::to_string(of_.accessor) +
                     " is sparse, and its indices do not ascend or lie behind its end");
    }
    at_ = index;
    value_ = &values_[k * value_bytes_];
    ++done_;
  }

  const GltfDocument& document_;
  const Elements& of_;
  std::uint64_t index_bytes_, value_bytes_;
  std::uint64_t done_ = 0;                   // that were read
  std::uint64_t at_ = 0;                     // index of the last one
  const std::byte* value_ = nullptr;         // its bytes
  std::vector<std::byte> indices_, values_;  // of some
};

void GltfDocument::read(const Elements& elements,
                        const std::function<void(std::span<const double>)>& take) const {
  constexpr std::uint64_t kBlockBytes = 1 << 18;
  const GltfNumber number = *gltf_number(elements.type);
  const std::uint64_t element_bytes = number.bytes * elements.components;
  const std::uint64_t stride = elements.has_view ? elements.stride : element_bytes;
  const std::uint64_t at_once = std::max<std::uint64_t>(1, kBlockBytes / stride);
  Replacement replacement(*this, elements);
  std::vector<std::byte> bytes;
  std::array<double, 4> values{};
  for (std::uint64_t first = 0; first < elements.count; first += at_once) {
    const std::uint64_t count = std::min(at_once, elements.count - first);
    bytes.resize((count - 1) * stride + element_bytes);
    if (elements.has_view) {
      buffers_[elements.buffer]
          ->part(elements.offset + first * stride, bytes.size())
          .read(0, bytes);
    }
    for (std::uint64_t i = 0; i < count; ++i) {
      const std::byte* from = replacement.find(elements.first + first + i);
      if (from == nullptr) from = &bytes[i * stride];
      for (std::size_t k = 0; k < elements.components; ++k) {
        const double value = load_gltf_number(from + k * number.bytes, elements.type);
        values[k] = elements.normalised ? std::max(-1.0, value / number.scale) : value;
      }
      take(std::span(values).first(elements.components));
    }
  }
}

}  // namespace ptc
