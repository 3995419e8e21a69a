// Records of a sort that carry other values than those of a point.
#pragma once

#include <cstddef>

#include "format/point_record.h"

namespace ptc {

/// The bytes that a PointRecord holds behind its key.
inline constexpr std::size_t kRecordValueBytes = sizeof(PointRecord) - sizeof(MortonKey);

/// Returns where the values of a record begin, behind its key.
[[nodiscard]] inline std::byte* values_of(PointRecord& record) noexcept {
  return reinterpret_cast<std::byte*>(&record) + sizeof(MortonKey);
}

}  // namespace ptc
