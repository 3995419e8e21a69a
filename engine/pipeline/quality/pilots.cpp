#include "engine/pipeline/quality/pilots.h"

namespace ptc {

PilotPlan plan_pilots(std::uint64_t receivers) {
  constexpr std::uint64_t kMinPilots = 64, kMaxPilots = 128;
  constexpr std::uint64_t kMinLength = 64, kMaxLength = 256;  // receivers of a pilot
  constexpr std::uint64_t kMinStride = 16;  // a small run has fewer pilots instead of shorter ones
  constexpr std::uint64_t kShare = 16;      // one in 16 receivers is in a pilot
  if (receivers == 0) return {};
  const std::uint64_t room =
      std::max(std::min<std::uint64_t>(receivers, 2), receivers / kMinStride);
  const std::uint64_t count =
      std::min(std::clamp(receivers / (kShare * kMaxLength), kMinPilots, kMaxPilots), room);
  const std::uint64_t stride = receivers / count;
  const std::uint64_t length = std::clamp(stride / kShare, kMinLength, kMaxLength);
  return {.count = static_cast<std::size_t>(count),
          .stride = stride,
          .receivers = static_cast<std::size_t>(std::min(stride, length))};
}

std::vector<Receiver> compared_of(std::span<const Pilot> pilots) {
  std::vector<Receiver> compared;
  for (const Pilot& pilot : pilots) {
    for (std::size_t k = 0; k < pilot.compared(); ++k) {
      compared.push_back(pilot.receivers[pilot.compared_at(k)]);
    }
  }
  return compared;
}

}  // namespace ptc
