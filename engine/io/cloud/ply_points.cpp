// Reads clouds from PLY.
//
// A PLY header names the properties of a vertex in any order. Each record becomes packed bytes, by
// the shortest way that its encoding allows, and a PointLayout converts them:
//
//   little-endian    as it lies in the file
//   big-endian       copied, the bytes of each number reversed
//   text, or lists   read by value (PlyRecord), then stored; lists are passed over
//
// In text, a property of type float may have more digits than a float holds. Those of the surfel
// are therefore stored as double.
#include <algorithm>
#include <array>
#include <utility>

#include "engine/io/cloud/formats.h"
#include "engine/io/cloud/packed_number.h"
#include "engine/io/cloud/ply.h"
#include "engine/io/cloud/ply_types.h"
#include "engine/io/cloud/record_source.h"

namespace ptc {
namespace {

ChannelType channel_type(PlyType type) {
  constexpr std::array kTypes = {ChannelType::i8,  ChannelType::u8,  ChannelType::i16,
                                 ChannelType::u16, ChannelType::i32, ChannelType::u32,
                                 ChannelType::f32, ChannelType::f64};
  return kTypes[static_cast<std::size_t>(type)];
}

class PlySource : public RecordSource {
 public:
  explicit PlySource(const std::filesystem::path& path) : reader_(path) {
    vertex_ = reader_.find("vertex");
    if (vertex_ == nullptr) refuse_file(path, "the PLY file has no vertices");
    const bool binary = reader_.encoding() != PlyEncoding::ascii && !vertex_->has_list();
    way_ = !binary                                            ? Way::values
           : reader_.encoding() == PlyEncoding::little_endian ? Way::as_stored
                                                              : Way::reversed;
    add_fields();
    set_layout(PointLayout(path, fields_,
                           {.owner = "the PLY vertices",
                            .whole_triples = true,
                            .float_colours = FloatColours::linear}));
  }

  [[nodiscard]] PointFileInfo info() const {
    PointFileInfo info;
    info.count = vertex_->count;
    layout().describe(info);
    for (const PlyProperty& property : vertex_->properties) {
      if (property.length_type)
        info.notes.push_back("The property '" + property.name + "' is a list and is left out.");
    }
    for (const PlyElement& element : reader_.elements()) {
      const bool known =
          element.name == "vertex" || element.name == "face" || element.name == "tristrips";
      if (known || element.count == 0) continue;
      info.notes.push_back("The element '" + element.name + "' with " +
                           std::to_string(element.count) + " records is left out.");
    }
    return info;
  }

 private:
  enum class Way { as_stored, reversed, values };

  // Lists the scalar properties and where they lie in a packed record.
  void add_fields() {
    const bool text = reader_.encoding() == PlyEncoding::ascii;
    std::size_t offset = 0;
    for (std::size_t i = 0; i < vertex_->properties.size(); ++i) {
      const PlyProperty& property = vertex_->properties[i];
      if (property.length_type) continue;
      RecordField field = make_field(property.name, channel_type(property.type), offset);
      if (text && property.type == PlyType::float32 && is_surfel_name(property.name)) {
        field.channel.type = ChannelType::f64;
      }
      offset += field.channel.component_bytes();
      fields_.push_back(std::move(field));
      properties_.push_back(i);
    }
    packed_.resize(offset);
  }

  const std::byte* next_record() override {
    if (done_ == vertex_->count) return nullptr;
    if (done_ == 0) skip_before_vertices();
    ++done_;
    if (way_ == Way::as_stored) return reader_.read_bytes(*vertex_, record_);
    if (way_ == Way::reversed) {
      const std::byte* const bytes = reader_.read_bytes(*vertex_, record_);
      for (const RecordField& field : fields_) {
        const std::size_t end = field.offset + field.channel.component_bytes();
        std::reverse_copy(bytes + field.offset, bytes + end, packed_.data() + field.offset);
      }
    } else {
      reader_.read(*vertex_, record_);
      for (std::size_t i = 0; i < fields_.size(); ++i) {
        // The reader has checked that the value is one of the type.
        static_cast<void>(store_number(record_.scalars[properties_[i]], fields_[i].channel.type,
                                       packed_.data() + fields_[i].offset));
      }
    }
    return packed_.data();
  }

  void fail_record(const std::string& rule) const override { reader_.fail(record_, rule); }

  void skip_before_vertices() {
    for (const PlyElement* e = reader_.elements().data(); e != vertex_; ++e) reader_.skip(*e);
  }

  // Reads the rest along with the last points, so that no caller can stop before it is checked.
  void finish_block() override {
    if (done_ < vertex_->count || ended_) return;
    if (done_ == 0) skip_before_vertices();
    const PlyElement* const end = reader_.elements().data() + reader_.elements().size();
    for (const PlyElement* e = vertex_ + 1; e != end; ++e) reader_.skip(*e);
    reader_.require_end();
    ended_ = true;
  }

  PlyReader reader_;
  const PlyElement* vertex_ = nullptr;   // an element of reader_
  Way way_ = Way::values;                // from a record of the file to a packed one
  std::vector<RecordField> fields_;      // of a packed record
  std::vector<std::size_t> properties_;  // by field: its index among the properties
  std::vector<std::byte> packed_;        // the record that was read last, unless it is as stored
  PlyRecord record_;                     // kept between calls
  std::uint64_t done_ = 0;               // records that were read
  bool ended_ = false;                   // everything behind the vertices was read
};

}  // namespace

PointFile open_ply(const std::filesystem::path& path) {
  return open_source<PlySource>(path);
}

}  // namespace ptc
