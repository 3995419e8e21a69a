// Internal to the point readers: what the fields of a packed record mean, and its conversion.
//
// A reader brings every record, whatever its encoding, into one packed form: little-endian numbers
// at fixed offsets. Names decide which numbers make the surfel; all others are copied as they are:
//
//   record   | x | y | z | intensity | red | green | blue | time |
//              \___|___/                \______|______/
//               Surfel                   Surfel and row
//   row      | rgb | intensity | time |
#pragma once

#include <array>
#include <cstddef>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "engine/base/surfel.h"
#include "engine/io/cloud/points.h"
#include "format/schema.h"

namespace ptc {

/// Refuses a file as a whole. @throws DataError "PATH: RULE"
[[noreturn]] void refuse_file(const std::filesystem::path& path, const std::string& rule);

/// A field of a packed record: consecutive numbers of one type.
struct RecordField {
  Channel channel;         ///< its name is that of the file
  std::size_t offset = 0;  ///< of the first number in the record, bytes
  bool plain = false;      ///< it is a channel, even if its name is one of the surfel
};

/// Makes a field of one number.
[[nodiscard]] RecordField make_field(std::string_view name, ChannelType type, std::size_t offset);

/// How the colours of a file that are floats become albedo.
enum class FloatColours {
  linear,    ///< linear values in [0, 1]; no channel repeats them
  srgb,      ///< sRGB values in [0, 1]; the channel `rgb` keeps them
  unbounded  ///< linear values that may exceed 1; they are clamped, and the channel `rgb` keeps
             ///< them
};

/// What a format says about its records.
struct LayoutRules {
  std::string owner;              ///< of the fields in errors, plural: "the PLY vertices"
  bool whole_triples = false;     ///< a file with nx, but without ny or nz is refused
  bool nan_is_no_normal = false;  ///< a normal with a NaN is unknown instead of invalid
  FloatColours float_colours = FloatColours::linear;
};

/// Says whether a field of this name may be part of the surfel.
[[nodiscard]] bool is_surfel_name(std::string_view name);

/// The conversion of packed records to surfels and rows of attributes.
class PointLayout {
 public:
  /// What became of a record.
  enum class Outcome { point, left_out, refused };

  /// Makes the conversion for records with these fields. Parts of the surfel are single numbers
  /// named x y z; nx ny nz or normal_x normal_y normal_z; radius or scalar_radius; radiance_r
  /// radiance_g radiance_b; emission_r emission_g emission_b; as floats albedo_r
  /// albedo_g albedo_b, else red green blue or diffuse_red diffuse_green diffuse_blue or, as
  /// integers of 8 or 16 bits, r g b. Integers of 8 or 16 bits rgb_r rgb_g rgb_b take the place of
  /// those colours.
  /// @throws DataError that names the file when it has no x, y and z
  PointLayout(const std::filesystem::path& path, std::span<const RecordField> fields,
              const LayoutRules& rules);

  /// Sets the channels and the members that say what surfels have.
  void describe(PointFileInfo& info) const;
  /// Returns the bytes of a row of attributes.
  [[nodiscard]] std::size_t row_bytes() const noexcept { return row_bytes_; }
  /// Takes colours in fields of 16 bits as those of 8 bits.
  void take_bytes_as_colours() noexcept;
  /// Converts a record. One without a place, whose position has a NaN, is left out; a normal of
  /// zero length is unknown and becomes 0.
  /// @param row   room for row_bytes() bytes
  /// @param rule  set to the rule that a refused record breaks
  [[nodiscard]] Outcome convert(const std::byte* record, Surfel& surfel, std::byte* row,
                                std::string& rule) const;

 private:
  struct Number {
    std::size_t offset = 0;
    ChannelType type = ChannelType::f32;
  };
  using Triple = std::array<Number, 3>;
  using Indices = std::array<std::size_t, 3>;  // of fields
  using Names = std::array<std::string_view, 3>;
  struct Copy {
    std::size_t from = 0;
    std::size_t to = 0;
    std::size_t bytes = 0;
  };
  enum class Curve : std::uint8_t { linear, clamped, srgb, srgb8, srgb16 };

  [[nodiscard]] std::optional<std::size_t> find(std::string_view name) const;
  [[nodiscard]] std::optional<Indices> find_triple(const Names& names);
  [[nodiscard]] std::optional<Triple> numbers(const std::optional<Indices>& indices) const;
  void find_colours(const LayoutRules& rules);
  void keep_colours(const Indices& fields, ColourSpace space);
  void add_rgb(const Indices& fields, ColourSpace space);
  void add_copy(const Number& from, std::size_t bytes);
  [[nodiscard]] static glm::dvec3 load(const std::byte* record, const Triple& at) noexcept;
  [[nodiscard]] static double albedo_of(double stored, Curve curve);

  std::filesystem::path path_;
  std::span<const RecordField> fields_;  // of the caller, while the constructor runs
  std::vector<bool> used_;               // by field: it is part of the surfel
  std::string owner_;
  bool whole_triples_ = false;
  bool nan_is_no_normal_ = false;
  Triple position_{};
  std::optional<Triple> normal_;
  std::optional<Number> radius_;
  std::optional<Triple> radiance_;
  std::optional<Triple> emission_;
  std::optional<Triple> albedo_;
  std::array<Curve, 3> curves_{};
  std::vector<Channel> channels_;
  std::vector<Copy> copies_;  // of the row, by ascending offset
  std::size_t row_bytes_ = 0;
};

}  // namespace ptc
