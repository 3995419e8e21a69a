// Quantisation of surfels as spec/points.md#point-page asks for.
#include "engine/io/cloud/record.h"

#include <algorithm>
#include <cmath>

#include "format/scalar.h"

namespace ptc {

PointRecord to_record(const Surfel& surfel, const Frame& frame) noexcept {
  PointRecord record;
  record.key =
      encode_morton(frame.to_lattice({surfel.position.x, surfel.position.y, surfel.position.z}));
  record.radius = surfel.radius;
  record.normal = encode_octahedral({surfel.normal.x, surfel.normal.y, surfel.normal.z});
  for (int c = 0; c < 3; ++c) {
    const auto k = static_cast<std::size_t>(c);
    record.radiance[k] = encode_half(surfel.radiance[c]);
    record.emission[k] = encode_half(surfel.emission[c]);
    record.albedo[k] =
        static_cast<std::uint8_t>(std::lround(std::clamp(surfel.albedo[c], 0.0F, 1.0F) * 255));
  }
  return record;
}

Surfel to_surfel(const PointRecord& record, const Frame& frame) noexcept {
  const std::array<double, 3> position = frame.to_position(decode_morton(record.key));
  const std::array<float, 3> normal = decode_octahedral(record.normal[0], record.normal[1]);
  Surfel surfel;
  for (int c = 0; c < 3; ++c) {
    const auto k = static_cast<std::size_t>(c);
    surfel.position[c] = position[k];
    surfel.normal[c] = normal[k];
    surfel.radiance[c] = decode_half(record.radiance[k]);
    surfel.emission[c] = decode_half(record.emission[k]);
    surfel.albedo[c] = static_cast<float>(record.albedo[k]) / 255;
  }
  surfel.radius = record.radius;
  return surfel;
}

}  // namespace ptc
