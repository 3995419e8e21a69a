// What a container's points and nodes take on the disk.
#pragma once

#include "engine/store/reader.h"

namespace ptc::bench {

/// Bytes of pages with headers and padding.
struct StoredBytes {
  double per_point = 0;  ///< of point pages, over all points
  double per_node = 0;   ///< of node pages, over all nodes
};

[[nodiscard]] StoredBytes stored_bytes(const ContainerReader& container);

}  // namespace ptc::bench
