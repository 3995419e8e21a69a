// Measures which numbers of points a format really rounds.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include <glm/vec3.hpp>

#include "engine/base/surfel.h"
#include "engine/io/cloud/display_colour.h"
#include "engine/io/cloud/point_rows.h"
#include "engine/io/cloud/point_writer.h"
#include "engine/io/cloud/rounding.h"

namespace ptc {

/// Measures PointWriteInfo::rounding over all points of a file.
class RoundingSurvey {
 public:
  /// @param info  its channels, texts and quantities of the surfel count
  RoundingSurvey(OutputFormat format, const PointWriteInfo& info);
  /// Measures points with whole rows of the channels.
  void add(std::span<const Surfel> surfels, std::span<const std::byte> rows);
  /// Returns what was measured.
  [[nodiscard]] const Rounding& rounding() const noexcept { return rounding_; }

 private:
  /// A channel that was not seen to be rounded yet.
  struct Watched {
    RowChannel row;
    Narrowing into;
  };
  /// The steps of a LAS file.
  struct Steps {
    glm::dvec3 scale;
    glm::dvec3 offset;
  };

  void add_position(const glm::dvec3& position);
  void add_rows(std::span<const std::byte> rows);

  bool floats_;                 // the format may round positions to floats
  bool decimals_;               // the format may round positions to steps
  bool normals_;                // the format packs normals
  bool albedos_;                // the format packs colours
  std::optional<Steps> steps_;  // of the LAS file that the points came from
  DisplayColour colour_;
  std::size_t row_bytes_;
  std::vector<Watched> watched_;
  Rounding rounding_;
};

}  // namespace ptc
