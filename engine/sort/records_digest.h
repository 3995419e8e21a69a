// A digest of records that does not depend on their order.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "format/checksum.h"
#include "format/point_record.h"

namespace ptc {

/// The digest of a set of records: the sum of their hashes, so that digests can be added.
using RecordsDigest = std::array<std::uint64_t, 2>;

/// Returns the digest of both sets together.
[[nodiscard]] inline RecordsDigest sum(const RecordsDigest& a, const RecordsDigest& b) noexcept {
  return {a[0] + b[0], a[1] + b[1]};
}

/// Returns the digest of records. The same set gives the same value.
[[nodiscard]] inline RecordsDigest digest_of(std::span<const PointRecord> records) noexcept {
  return xxh3_128_sum(std::as_bytes(records), sizeof(PointRecord));
}

}  // namespace ptc
