// The light that leaves a cluster.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>

#include "format/node_page.h"
#include "format/scalar.h"

namespace ptc {

/// Returns the mean radiance of the light that leaves a child of a group towards an axis, as rgbe:
/// what it reflects and, if wanted, what it emits.
/// @param axis  0 to 5: +x -x +y -y +z -z
[[nodiscard]] inline std::uint32_t outgoing_rgbe(const GroupView& group, int axis, int child,
                                                 bool emission = true) noexcept {
  const auto load = [&](const std::byte* column) {
    std::uint32_t rgbe;
    std::memcpy(&rgbe, column + 4 * std::ptrdiff_t{child}, sizeof rgbe);
    return rgbe;
  };
  const std::uint32_t reflected = load(group.radiance(axis));
  if (!group.emits() || !emission) return reflected;
  const std::array<float, 3> a = decode_rgbe(reflected),
                             b = decode_rgbe(load(group.emission(axis)));
  return encode_rgbe({a[0] + b[0], a[1] + b[1], a[2] + b[2]});
}

}  // namespace ptc
