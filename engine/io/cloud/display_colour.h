// Internal to the point writers: the colour that a viewer shows of a point.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include <glm/vec3.hpp>

#include "engine/io/cloud/point_rows.h"
#include "engine/io/cloud/point_writer.h"

namespace ptc {

/// Finds the colour of each point: that of PointWriteInfo::colour_from, else the albedo. A colour
/// whose numbers a channel has as the scanner stored them, such as the channel `rgb`, is known to
/// the last bit. Where it is not known, points show their albedo.
///
/// Light has no upper limit, so colours of three components are compressed by their luminance Y to
/// Y / (1 + Y), in which black stays black and nothing reaches white (Reinhard et al. 2002, eq. 3).
class DisplayColour {
 public:
  explicit DisplayColour(const PointWriteInfo& info);

  /// Says whether points have a colour.
  [[nodiscard]] bool exists() const noexcept { return kind_ != Kind::none; }
  /// Returns the channel that has the numbers of the colour as they were stored, on the sRGB curve;
  /// null when there is none.
  [[nodiscard]] const RowChannel* stored() const noexcept {
    return kind_ == Kind::stored ? &*source_ : nullptr;
  }
  /// Says whether the numbers of stored(), which is not null, are bytes, even in wider fields.
  [[nodiscard]] bool stores_bytes() const noexcept;
  /// Says whether a point has an albedo that does not come from the numbers of stored().
  [[nodiscard]] bool is_recoloured(const Surfel& surfel, const std::byte* row) const;
  /// Says whether the colour takes the place of the albedo.
  [[nodiscard]] bool hides_albedo() const noexcept { return chosen_; }
  /// Returns the colour, linear, each component in [0, 1]: that of stored() where the point's
  /// albedo came from it. Its floats give the numbers of stored() back, those of 16 bits, too.
  [[nodiscard]] glm::vec3 linear(const Surfel& surfel, const std::byte* row) const;
  /// Returns the colour on the sRGB curve, 65535 for 1.
  [[nodiscard]] std::array<std::uint16_t, 3> srgb(const Surfel& surfel, const std::byte* row) const;
  /// Returns the colour on the sRGB curve in 8 bits: those of stored(), if its numbers are bytes
  /// and the point's albedo came from them.
  [[nodiscard]] std::array<std::uint8_t, 3> bytes(const Surfel& surfel, const std::byte* row) const;
  /// Returns channels without the one whose values bytes() has.
  [[nodiscard]] std::vector<RowChannel> without_bytes(std::vector<RowChannel> channels) const;
  /// Returns channels without the one whose values linear() has.
  [[nodiscard]] std::vector<RowChannel> without_stored(std::vector<RowChannel> channels) const;
  /// Returns the values of stored(), those of 8 bits 257-fold, so that 65535 is white. Points that
  /// come from a LAS file with bytes in its fields of 16 bits keep those. Where values are not
  /// known, the albedo takes their place.
  [[nodiscard]] std::array<std::uint16_t, 3> stored_values(const Surfel& surfel,
                                                           const std::byte* row) const;

 private:
  enum class Kind : std::uint8_t { none, albedo, stored, shown };

  /// Says whether the numbers of stored() are known of a point.
  [[nodiscard]] bool knows(const std::byte* row) const noexcept;
  /// Says whether the numbers of stored() are the colour of a point.
  [[nodiscard]] bool shows_stored(const Surfel& surfel, const std::byte* row) const;
  /// Returns the numbers of stored(), cut to white.
  [[nodiscard]] std::array<std::uint16_t, 3> stored_integers(const std::byte* row) const;
  [[nodiscard]] glm::vec3 stored_light(const std::byte* row) const;
  /// Returns which of stored_values() is white.
  [[nodiscard]] double stored_white() const noexcept;
  [[nodiscard]] glm::vec3 shown_light(const std::byte* row) const;

  Kind kind_ = Kind::none;
  bool chosen_;  // PointWriteInfo::colour_from names the source
  bool surfels_have_albedo_;
  bool bytes_stay_;                   // the points come from a LAS file
  std::optional<RowChannel> source_;  // of the kinds stored and shown
};

}  // namespace ptc
