// Draco: a library decodes the streams, and this file sees to it that a small stream cannot make it
// take much memory.
//
//   stream   | header | metadata | connectivity                 | attributes             |
//            | 11     | left out | counts, symbols of triangles | descriptions, numbers  |
//                                  ^                              ^
//                                  checked before the library     checked before it decodes
//                                  reads them                     the numbers
//
// The library allocates by these counts before it looks for the bytes behind them. So they are
// compared with those of the accessors, for which the caller has room. Metadata, which nobody needs
// here, is taken out of the stream beforehand, because it may be nested.
#include "engine/io/mesh/gltf_draco.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <exception>
#include <limits>
#include <type_traits>
#include <utility>

#include <draco/compression/mesh/mesh_edgebreaker_decoder.h>
#include <draco/compression/mesh/mesh_sequential_decoder.h>
#include <draco/mesh/mesh.h>

#include "engine/base/error.h"
#include "engine/io/mesh/gltf_numbers.h"

namespace ptc {
namespace {

constexpr std::size_t kMaxComponents = 4;
constexpr std::size_t kHeaderBytes = 11;
constexpr std::uint8_t kMetadataFlag = 0x80;  // in the last byte of the header

// A rule that a stream breaks. It passes through the library, which cleans up.
struct Refusal {
  const char* rule;
};

// Reads a stream from front to back.
class StreamCursor {
 public:
  explicit StreamCursor(std::span<const std::byte> left) : left_(left) {}

  [[nodiscard]] std::size_t left() const noexcept { return left_.size(); }
  std::uint8_t u8() {
    skip(1, "the stream ends too early");
    return last_;
  }
  // Reads an integer of 7 bits in each byte, the lowest ones first.
  std::uint32_t varint() {
    std::uint64_t value = 0;
    for (unsigned shift = 0; shift < 35; shift += 7) {
      const std::uint8_t byte = u8();
      value |= std::uint64_t{byte & 0x7fU} << shift;
      if ((byte & 0x80U) != 0) continue;
      if (value > std::numeric_limits<std::uint32_t>::max()) break;
      return static_cast<std::uint32_t>(value);
    }
    throw Refusal{"a number of the stream does not fit in 32 bits"};
  }
  void skip(std::size_t bytes, const char* rule = "metadata reaches past the end of the stream") {
    if (bytes > left_.size()) throw Refusal{rule};
    if (bytes > 0) last_ = std::to_integer<std::uint8_t>(left_[bytes - 1]);
    left_ = left_.subspan(bytes);
  }

 private:
  std::span<const std::byte> left_;
  std::uint8_t last_ = 0;
};

// Skips an element of metadata: entries, each a name and a value, then elements with names.
void skip_metadata(StreamCursor& from) {
  for (std::uint64_t elements = 1; elements > 0;) {
    --elements;
    for (std::uint32_t entries = from.varint(); entries > 0; --entries) {
      from.skip(from.u8());
      from.skip(from.varint());
    }
    elements += from.varint();
    if (elements > 0) from.skip(from.u8());
  }
}

// Takes the metadata out of a stream: an element for each of some attributes, and one for all.
void remove_metadata(std::vector<std::byte>& stream) {
  std::byte& flags = stream[kHeaderBytes - 1];
  if ((flags & std::byte{kMetadataFlag}) == std::byte{0}) return;
  flags &= ~std::byte{kMetadataFlag};
  StreamCursor from(std::span<const std::byte>(stream).subspan(kHeaderBytes));
  for (std::uint32_t attributes = from.varint(); attributes > 0; --attributes) {
    static_cast<void>(from.varint());
    skip_metadata(from);
  }
  skip_metadata(from);
  stream.erase(stream.begin() + kHeaderBytes,
               stream.end() - static_cast<std::ptrdiff_t>(from.left()));
}

// A mesh of so many attributes at most.
class BoundedMesh : public draco::Mesh {
 public:
  explicit BoundedMesh(std::size_t attributes) : attributes_(attributes) {}

  void SetAttribute(int id, std::unique_ptr<draco::PointAttribute> attribute) override {
    if (id < 0 || static_cast<std::size_t>(id) >= attributes_)
      throw Refusal{"it holds more attributes than its primitive"};
    if (attribute->num_components() < 1 || attribute->num_components() > kMaxComponents)
      throw Refusal{"an attribute has more than 4 numbers"};
    draco::Mesh::SetAttribute(id, std::move(attribute));
  }

 private:
  std::size_t attributes_;
};

// A decoder of the library that checks counts before they are used.
template <typename Decoder>
class BoundedDecoder : public Decoder {
 public:
  explicit BoundedDecoder(const DracoMesh::Shape& shape) : shape_(shape) {}

 protected:
  bool DecodeConnectivity() override {
    const draco::DecoderBuffer& from = *this->buffer();
    StreamCursor cursor(std::as_bytes(
        std::span(from.data_head(), static_cast<std::size_t>(from.remaining_size()))));
    if constexpr (std::is_same_v<Decoder, draco::MeshEdgebreakerDecoder>) {
      const std::uint64_t vertices = cursor.varint(), triangles = cursor.varint();
      const std::size_t seamed = cursor.u8();  // attributes with points of their own at a vertex
      const std::uint64_t symbols = cursor.varint(), splits = cursor.varint();
      require(triangles == shape_.triangles, kTriangles);
      require(vertices <= 3 * triangles && symbols <= triangles && splits <= symbols,
              "its connectivity has more parts than triangles");
      require(seamed < shape_.attributes, kAttributes);
    } else {
      require(cursor.varint() == shape_.triangles, kTriangles);
    }
    return Decoder::DecodeConnectivity();
  }

  bool CreateAttributesDecoder(std::int32_t id) override {
    require(id >= 0 && static_cast<std::size_t>(id) < shape_.attributes,
            "it has more decoders than attributes");
    return Decoder::CreateAttributesDecoder(id);
  }

  bool DecodeAllAttributes() override {
    require(this->point_cloud()->num_points() == shape_.points, kPoints);
    return Decoder::DecodeAllAttributes();
  }

 private:
  static constexpr char kTriangles[] = "it has another number of triangles than its accessor";
  static constexpr char kPoints[] = "it has another number of points than its accessors";
  static constexpr char kAttributes[] = "it holds more attributes than its primitive";

  static void require(bool holds, const char* rule) {
    if (!holds) throw Refusal{rule};
  }

  DracoMesh::Shape shape_;
};

template <typename Decoder>
void decode(const std::vector<std::byte>& stream, const DracoMesh::Shape& shape,
            draco::Mesh& mesh) {
  draco::DecoderBuffer buffer;
  buffer.Init(reinterpret_cast<const char*>(stream.data()), stream.size());
  const draco::DecoderOptions options;
  BoundedDecoder<Decoder> decoder(shape);
  if (!decoder.Decode(options, &buffer, &mesh).ok() || mesh.num_faces() != shape.triangles ||
      mesh.num_points() != shape.points) {
    throw Refusal{"the stream is damaged"};
  }
}

// Returns the componentType of a type of the library; 0 for types that glTF does not have.
std::uint64_t component_type(draco::DataType type) {
  switch (type) {
    case draco::DT_INT8:
      return kGltfInt8;
    case draco::DT_UINT8:
      return kGltfUint8;
    case draco::DT_INT16:
      return kGltfInt16;
    case draco::DT_UINT16:
      return kGltfUint16;
    case draco::DT_UINT32:
      return kGltfUint32;
    case draco::DT_FLOAT32:
      return kGltfFloat;
    default:
      return 0;
  }
}

}  // namespace

std::uint64_t DracoMesh::peak_bytes(std::uint64_t stream_bytes, const Shape& shape) noexcept {
  // Twice what libdraco 1.5.5 was measured to take of grids of a million triangles
  return stream_bytes + shape.triangles * (96 + 64 * shape.attributes) +
         shape.points * (16 + 64 * shape.attributes);
}

DracoMesh::DracoMesh(std::vector<std::byte> stream, const Shape& shape, std::string name)
    : name_(std::move(name)) {
  constexpr std::array<char, 8> kStart{'D', 'R', 'A', 'C', 'O', 2, 2, 1};  // version 2.2, a mesh
  if (stream.size() < kHeaderBytes || std::memcmp(stream.data(), kStart.data(), 8) != 0)
    fail("it is not a mesh of Draco's bitstream 2.2");
  auto mesh = std::make_unique<BoundedMesh>(shape.attributes);
  try {
    remove_metadata(stream);
    if (stream[kStart.size()] == std::byte{draco::MESH_EDGEBREAKER_ENCODING}) {
      decode<draco::MeshEdgebreakerDecoder>(stream, shape, *mesh);
    } else {
      decode<draco::MeshSequentialDecoder>(stream, shape, *mesh);
    }
  } catch (const Refusal& refusal) {
    fail(refusal.rule);
  } catch (const std::exception&) {  // sizes that the library did not check
    fail("the stream is damaged");
  }
  mesh_ = std::move(mesh);
}

DracoMesh::~DracoMesh() = default;
DracoMesh::DracoMesh(DracoMesh&&) noexcept = default;
DracoMesh& DracoMesh::operator=(DracoMesh&&) noexcept = default;

void DracoMesh::fail(const std::string& rule) const {
  throw DataError(name_ + ": Draco: " + rule);
}

void DracoMesh::read(std::uint64_t id, const Reading& reading,
                     const std::function<void(std::span<const double>)>& take) const {
  const std::string name = "attribute " + std::to_string(id);
  const draco::PointAttribute* const attribute =
      id > std::numeric_limits<std::uint32_t>::max()
          ? nullptr
          : mesh_->GetAttributeByUniqueId(static_cast<std::uint32_t>(id));
  if (attribute == nullptr) fail(name + " does not exist");
  const std::uint64_t type = component_type(attribute->data_type());
  const std::optional<GltfNumber> number = gltf_number(type);
  if (!number || attribute->num_components() != reading.components)
    fail(name + " has other numbers than its accessor");
  const bool normalised =
      type != kGltfFloat &&
      (reading.normalised || (reading.may_normalise && attribute->normalized()));
  const std::size_t bytes = number->bytes * reading.components;

  // The library does not promise that each point has a value inside the buffer
  const std::size_t size = attribute->buffer() == nullptr ? 0 : attribute->buffer()->data_size();
  const bool mapped =
      attribute->is_mapping_identity() || attribute->indices_map_size() == mesh_->num_points();
  std::array<double, kMaxComponents> values{};
  for (std::uint32_t point = 0; point < mesh_->num_points(); ++point) {
    const std::uint64_t value =
        mapped ? attribute->mapped_index(draco::PointIndex(point)).value() : size;
    const auto offset = static_cast<std::uint64_t>(attribute->byte_offset()) +
                        value * static_cast<std::uint64_t>(attribute->byte_stride());
    if (value >= attribute->size() || offset > size || bytes > size - offset)
      fail(name + " lacks values");
    const auto* const from =
        reinterpret_cast<const std::byte*>(attribute->buffer()->data() + offset);
    for (std::size_t k = 0; k < reading.components; ++k) {
      const double loaded = load_gltf_number(from + k * number->bytes, type);
      values[k] = normalised ? std::max(-1.0, loaded / number->scale) : loaded;
    }
    take(std::span(values).first(reading.components));
  }
}

void DracoMesh::read_corners(const std::function<void(std::uint64_t)>& take) const {
  for (std::uint32_t i = 0; i < mesh_->num_faces(); ++i) {
    for (const draco::PointIndex& point : mesh_->face(draco::FaceIndex(i))) take(point.value());
  }
}

}  // namespace ptc
