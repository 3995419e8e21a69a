// Discs that wait to be drawn. They lie in columns, so that vector instructions set up several at
// once.
#pragma once

#include <cstdint>

#include <glm/vec3.hpp>

namespace ptc {

/// A queue of oriented discs, relative to the viewpoint that they are drawn for. Lengths may be in
/// any unit in which the fourth powers of all lengths fit a float. Entries from `size` on may hold
/// anything.
///
/// Memory: 32.5 KiB.
struct DiscQueue {
  static constexpr int kCapacity = 1024;  ///< discs that the queue holds
  static constexpr int kLanes = 8;        ///< discs that a kernel may append at once
  static constexpr int kReadLanes = 16;   ///< discs that a reader may load at once

  alignas(64) float x[kCapacity + kReadLanes];  ///< centre
  float y[kCapacity + kReadLanes];
  float z[kCapacity + kReadLanes];
  float nx[kCapacity + kReadLanes];  ///< normal, unit
  float ny[kCapacity + kReadLanes];
  float nz[kCapacity + kReadLanes];
  float radius[kCapacity + kReadLanes];
  std::uint32_t rgbe[kCapacity + kReadLanes];  ///< radiance of the front; the back is black
  int size = 0;                                ///< discs in the queue

  /// Reports whether the queue has to be drawn before a kernel may append to it.
  [[nodiscard]] bool full() const noexcept { return size > kCapacity - kLanes; }

  /// Appends a disc.
  /// @param to      its centre
  /// @param normal  unit
  /// @param colour  radiance of its front, RGBE
  void push(const glm::vec3& to, const glm::vec3& normal, float r, std::uint32_t colour) noexcept {
    x[size] = to.x;
    y[size] = to.y;
    z[size] = to.z;
    nx[size] = normal.x;
    ny[size] = normal.y;
    nz[size] = normal.z;
    radius[size] = r;
    rgbe[size] = colour;
    ++size;
  }
};

}  // namespace ptc
