// Writes USD crate files, version 0.8.0.
//
//   | "PXR-USDC" version 8, offset of the contents, 88 bytes in all
//   | columns, each: count u64 | values, at a multiple of 8
//   | small values: extent, names of the properties ...
//   | TOKENS | STRINGS | FIELDS | FIELDSETS | PATHS | SPECS | contents: name, begin and size of
//   each
//
// A layer is a list of specs, one for the layer itself, one for each prim and one for each
// attribute. A spec is a path and a set of fields; a field is a name and a value. Names are numbers
// of tokens. A value has 64 bits, of which the lower 48 are where it lies, or itself:
//
//   63 array | 62 inlined | 61 compressed | 56 .. 60 zero | 48 .. 55 type | 0 .. 47 offset or value
//
// Source: AOUSD Core Specification 1.0, crate file format.
#include <algorithm>
#include <array>
#include <cstring>
#include <map>
#include <string>
#include <string_view>

#include <lz4.h>

#include "engine/io/cloud/formats.h"
#include "engine/io/cloud/usd_points.h"
#include "engine/io/file/file.h"

namespace ptc {
namespace {

using Bytes = std::vector<std::byte>;

constexpr std::uint64_t kBootBytes = 88;
constexpr std::uint64_t kArray = std::uint64_t{1} << 63;
constexpr std::uint64_t kInlined = std::uint64_t{1} << 62;

// The numbers of the types of values that this writer uses.
enum class CrateType : std::uint64_t {
  integer = 3,
  uint = 4,
  int64 = 5,
  uint64 = 6,
  float32 = 8,
  float64 = 9,
  token = 11,
  vec2d = 19,
  vec2f = 20,
  vec2i = 22,
  vec3d = 23,
  vec3f = 24,
  vec3i = 26,
  vec4d = 27,
  vec4f = 28,
  vec4i = 30,
  token_vector = 41,
  specifier = 42,
  variability = 44
};

// The numbers of the kinds of specs.
enum class SpecType : std::int32_t { attribute = 1, prim = 6, layer = 7 };

std::uint64_t value_of(CrateType type, std::uint64_t flags, std::uint64_t payload) {
  return flags | static_cast<std::uint64_t>(type) << 48 | payload;
}

CrateType crate_type(const UsdColumn& column) {
  using enum CrateType;
  constexpr std::array<CrateType, 4> kFloats{float32, vec2f, vec3f, vec4f};
  constexpr std::array<CrateType, 4> kDoubles{float64, vec2d, vec3d, vec4d};
  constexpr std::array<CrateType, 4> kIntegers{integer, vec2i, vec3i, vec4i};
  switch (column.number) {
    case ChannelType::f32:
      return kFloats[column.numbers - 1];
    case ChannelType::f64:
      return kDoubles[column.numbers - 1];
    case ChannelType::u32:
      return uint;
    case ChannelType::u64:
      return uint64;
    case ChannelType::i64:
      return int64;
    default:
      return kIntegers[column.numbers - 1];
  }
}

void append(Bytes& out, std::span<const std::byte> bytes) {
  out.insert(out.end(), bytes.begin(), bytes.end());
}

// Compresses bytes: the number of further chunks, which is 0, and a block of LZ4.
Bytes compressed(std::span<const std::byte> bytes) {
  const int size = static_cast<int>(bytes.size());
  Bytes out(1 + static_cast<std::size_t>(LZ4_compressBound(size)));
  const int written = LZ4_compress_default(reinterpret_cast<const char*>(bytes.data()),
                                           reinterpret_cast<char*>(out.data() + 1), size,
                                           static_cast<int>(out.size() - 1));
  out.resize(1 + static_cast<std::size_t>(written));
  return out;
}

// Appends integers in their compressed form with its size in front. Each is stored as its
// difference from the one before:
//
//   most frequent difference i32 | codes, 2 bits each, the first in the lowest bits | differences
//
// Code 0 stands for the most frequent difference; 1, 2 and 3 say that it follows in 1, 2 or 4
// bytes. This writer takes 0 and 3 only: its lists are short.
void append_integers(Bytes& out, std::span<const std::int32_t> values) {
  // Find the most frequent difference
  std::vector<std::int32_t> steps;
  std::map<std::int32_t, std::size_t> frequency;
  std::uint32_t before = 0;
  for (const std::int32_t value : values) {
    steps.push_back(static_cast<std::int32_t>(static_cast<std::uint32_t>(value) - before));
    before = static_cast<std::uint32_t>(value);
    ++frequency[steps.back()];
  }
  std::int32_t common = 0;
  std::size_t most = 0;
  for (const auto& [step, count] : frequency) {
    if (count <= most) continue;
    common = step;
    most = count;
  }
  // Encode them
  Bytes plain;
  append_value(plain, common);
  const std::size_t codes = plain.size();
  plain.resize(codes + (steps.size() + 3) / 4);
  for (std::size_t i = 0; i < steps.size(); ++i) {
    if (steps[i] == common) continue;
    plain[codes + i / 4] |= static_cast<std::byte>(3 << 2 * (i % 4));
    append_value(plain, steps[i]);
  }
  const Bytes packed = compressed(plain);
  append_value(out, std::uint64_t{packed.size()});
  append(out, packed);
}

// The lists of a crate file in the making.
class Crate {
 public:
  // Returns the number of a token.
  std::int32_t token(const std::string& text) {
    const auto [entry, is_new] =
        numbers_.try_emplace(text, static_cast<std::int32_t>(tokens_.size()));
    if (is_new) tokens_.push_back(text);
    return entry->second;
  }
  // Begins a spec of the next path in the order of the tree: the layer, the prim, its attributes.
  void begin_spec(SpecType type, const std::string& name) {
    if (!sets_.empty()) sets_.push_back(-1);
    spec_sets_.push_back(static_cast<std::int32_t>(sets_.size()));
    spec_types_.push_back(static_cast<std::int32_t>(type));
    const std::int32_t number = type == SpecType::layer ? 0 : token(name);
    names_.push_back(type == SpecType::attribute ? -number : number);
  }
  // Adds a field to the spec that was begun last.
  void add_field(const std::string& name, std::uint64_t value) {
    sets_.push_back(static_cast<std::int32_t>(values_.size()));
    fields_.push_back(token(name));
    values_.push_back(value);
  }
  // Adds a field whose value is a token.
  void add_field(const std::string& name, const std::string& text) {
    const auto number = static_cast<std::uint64_t>(token(text));
    add_field(name, value_of(CrateType::token, kInlined, number));
  }
  // Returns all sections and their contents, which begin at `offset`, and sets `contents` to where
  // the contents lie.
  [[nodiscard]] Bytes finish(std::uint64_t offset, std::uint64_t& contents) const;

 private:
  [[nodiscard]] Bytes token_section() const;
  [[nodiscard]] Bytes field_section() const;
  [[nodiscard]] Bytes path_section() const;
  [[nodiscard]] Bytes spec_section() const;

  std::map<std::string, std::int32_t> numbers_;
  std::vector<std::string> tokens_;
  std::vector<std::int32_t> fields_;  // tokens
  std::vector<std::uint64_t> values_;
  std::vector<std::int32_t> sets_;  // numbers of fields, -1 behind those of each spec
  std::vector<std::int32_t> spec_sets_;
  std::vector<std::int32_t> spec_types_;
  std::vector<std::int32_t> names_;  // of the paths: tokens, negative for attributes
};

Bytes Crate::token_section() const {
  std::string text;
  for (const std::string& token : tokens_) text += token + '\0';
  const Bytes packed = compressed(std::as_bytes(std::span(text)));
  Bytes section;
  append_value(section, std::uint64_t{tokens_.size()});
  append_value(section, std::uint64_t{text.size()});
  append_value(section, std::uint64_t{packed.size()});
  append(section, packed);
  return section;
}

Bytes Crate::field_section() const {
  Bytes section;
  append_value(section, std::uint64_t{fields_.size()});
  append_integers(section, fields_);
  const Bytes packed = compressed(std::as_bytes(std::span(values_)));
  append_value(section, std::uint64_t{packed.size()});
  append(section, packed);
  return section;
}

// The tree of paths in depth-first order. Its jumps say what follows a path: -1 its child, 0 its
// sibling, -2 neither.
Bytes Crate::path_section() const {
  std::vector<std::int32_t> numbers(names_.size()), jumps(names_.size(), 0);
  for (std::size_t i = 0; i < numbers.size(); ++i) numbers[i] = static_cast<std::int32_t>(i);
  jumps[0] = jumps[1] = -1;
  jumps.back() = -2;
  Bytes section;
  append_value(section, std::uint64_t{names_.size()});  // paths
  append_value(section, std::uint64_t{names_.size()});  // those of the tree
  append_integers(section, numbers);
  append_integers(section, names_);
  append_integers(section, jumps);
  return section;
}

Bytes Crate::spec_section() const {
  std::vector<std::int32_t> paths(names_.size());
  for (std::size_t i = 0; i < paths.size(); ++i) paths[i] = static_cast<std::int32_t>(i);
  Bytes section;
  append_value(section, std::uint64_t{paths.size()});
  append_integers(section, paths);
  append_integers(section, spec_sets_);
  append_integers(section, spec_types_);
  return section;
}

Bytes Crate::finish(std::uint64_t offset, std::uint64_t& contents) const {
  // Make the sections that are no class of their own
  Bytes strings, sets;
  append_value(strings, std::uint64_t{0});
  std::vector<std::int32_t> ended = sets_;
  ended.push_back(-1);
  append_value(sets, std::uint64_t{ended.size()});
  append_integers(sets, ended);

  // Put the sections one behind another, and note where they are
  const std::array<std::pair<std::string_view, Bytes>, 6> sections{{{"TOKENS", token_section()},
                                                                    {"STRINGS", strings},
                                                                    {"FIELDS", field_section()},
                                                                    {"FIELDSETS", sets},
                                                                    {"PATHS", path_section()},
                                                                    {"SPECS", spec_section()}}};
  Bytes out, list;
  append_value(list, std::uint64_t{sections.size()});
  for (const auto& [name, bytes] : sections) {
    std::array<char, 16> padded{};
    std::ranges::copy(name, padded.begin());
    append(list, std::as_bytes(std::span(padded)));
    append_value(list, offset + out.size());
    append_value(list, std::uint64_t{bytes.size()});
    append(out, bytes);
  }
  contents = offset + out.size();
  append(out, list);
  return out;
}

class UsdcWriter : public UsdWriter {
 public:
  UsdcWriter(const std::filesystem::path& target, const PointWriteInfo& info)
      : UsdWriter(info, kBootBytes, sizeof(std::uint64_t)), file_(target) {}

 private:
  void store(std::uint64_t offset, std::span<const std::byte> bytes) override {
    file_.write_at(offset, bytes);
  }

  void end() override {
    // Complete the columns
    flush();
    const std::uint64_t count = announced();
    for (const UsdColumn& column : columns())
      file_.write_at(column.begin - sizeof count, std::as_bytes(std::span(&count, 1)));

    // Describe them
    begin_ = (std::max(columns_end(), file_.size()) + 7) / 8 * 8;
    describe_layer();
    describe_prim();
    for (const UsdColumn& column : columns()) describe_column(column);
    describe_extent();
    if (stage().translation) describe_translation();

    // Write the sections, and the head that leads to them
    std::uint64_t contents = 0;
    const Bytes sections = crate_.finish(begin_ + values_.size(), contents);
    file_.write_at(begin_, values_);
    file_.write_at(begin_ + values_.size(), sections);
    Bytes boot;
    for (const char c : std::string_view("PXR-USDC")) append_value(boot, c);
    append_value(boot, std::uint64_t{0x000800});  // version 0.8.0, the lowest byte first
    append_value(boot, contents);
    boot.resize(kBootBytes);
    file_.write_at(0, boot);
    file_.publish();
  }

  void describe_layer() {
    crate_.begin_spec(SpecType::layer, "");
    crate_.add_field("upAxis", std::string(1, stage().up));
    crate_.add_field("defaultPrim", "points");
    if (stage().metres_per_unit) {
      crate_.add_field("metersPerUnit",
                       value_of(CrateType::float64, 0, keep(*stage().metres_per_unit)));
    }
    crate_.add_field("primChildren", names_value({"points"}));
  }
  void describe_prim() {
    std::vector<std::string> names;
    for (const UsdColumn& column : columns()) names.push_back(column.name);
    names.emplace_back("extent");
    if (stage().translation) names.insert(names.end(), {"xformOp:translate", "xformOpOrder"});
    crate_.begin_spec(SpecType::prim, "points");
    crate_.add_field("specifier", value_of(CrateType::specifier, kInlined, 0));  // def
    crate_.add_field("typeName", "Points");
    crate_.add_field("properties", names_value(names));
  }
  void describe_column(const UsdColumn& column) {
    crate_.begin_spec(SpecType::attribute, column.name);
    crate_.add_field("typeName", column.type + "[]");
    const std::uint64_t at = announced() == 0 ? 0 : column.begin - sizeof(std::uint64_t);
    crate_.add_field("default", value_of(crate_type(column), kArray, at));
    if (column.source != UsdSource::position) crate_.add_field("interpolation", "vertex");
  }
  void describe_extent() {
    const std::vector<glm::vec3> box = extent();
    const std::uint64_t at = keep(std::uint64_t{box.size()});
    for (const glm::vec3& corner : box) append_value_of(corner);
    crate_.begin_spec(SpecType::attribute, "extent");
    crate_.add_field("typeName", "float3[]");
    crate_.add_field("default", value_of(CrateType::vec3f, kArray, at));
  }
  void describe_translation() {
    const glm::dvec3& by = *stage().translation;
    const std::uint64_t at = keep(by.x);
    append_value(values_, by.y);
    append_value(values_, by.z);
    crate_.begin_spec(SpecType::attribute, "xformOp:translate");
    crate_.add_field("typeName", "double3");
    crate_.add_field("default", value_of(CrateType::vec3d, 0, at));
    const std::uint64_t order = keep(std::uint64_t{1});
    append_value(values_, crate_.token("xformOp:translate"));
    crate_.begin_spec(SpecType::attribute, "xformOpOrder");
    crate_.add_field("typeName", "token[]");
    crate_.add_field("variability", value_of(CrateType::variability, kInlined, 1));  // uniform
    crate_.add_field("default", value_of(CrateType::token, kArray, order));
  }

  // Keeps a value outside of the fields, at a multiple of 8. @return where it lies
  template <typename T>
  std::uint64_t keep(T value) {
    values_.resize((values_.size() + 7) / 8 * 8);
    const std::uint64_t at = begin_ + values_.size();
    append_value(values_, value);
    return at;
  }
  void append_value_of(const glm::vec3& v) {
    for (int i = 0; i < 3; ++i) append_value(values_, v[i]);
  }
  // Returns the value that is a list of names.
  std::uint64_t names_value(const std::vector<std::string>& names) {
    const std::uint64_t at = keep(std::uint64_t{names.size()});
    for (const std::string& name : names) append_value(values_, crate_.token(name));
    return value_of(CrateType::token_vector, 0, at);
  }

  OutputFile file_;
  Crate crate_;
  Bytes values_;             // what lies behind the columns
  std::uint64_t begin_ = 0;  // where that begins
};

}  // namespace

std::unique_ptr<PointWriter> create_usdc(const std::filesystem::path& target,
                                         const PointWriteInfo& info) {
  return std::make_unique<UsdcWriter>(target, info);
}

}  // namespace ptc
