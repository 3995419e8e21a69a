// Discs that wait to be drawn: columns, so that several are set up at once.
#pragma once

#include <cstdint>

#include <glm/vec3.hpp>

namespace ptc {

/// Oriented discs relative to the receiver that they are drawn for, in any unit whose fourth powers
/// are floats.
struct DiscQueue {
  static constexpr int kCapacity = 1024;
  static constexpr int kLanes = 8;       ///< a push may write so many
  static constexpr int kReadLanes = 16;  ///< a reader reads so many at once

  alignas(64) float x[kCapacity + kReadLanes];
  float y[kCapacity + kReadLanes];
  float z[kCapacity + kReadLanes];
  float nx[kCapacity + kReadLanes];  ///< unit
  float ny[kCapacity + kReadLanes];
  float nz[kCapacity + kReadLanes];
  float radius[kCapacity + kReadLanes];
  std::uint32_t rgbe[kCapacity + kReadLanes];  ///< colour of the front; the back is black
  int size = 0;

  [[nodiscard]] bool full() const noexcept { return size > kCapacity - kLanes; }

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
