// The bytes that points and nodes of a container take on the disk.
#pragma once

#include "engine/store/reader.h"

namespace ptc::bench {

/// Bytes per item, page headers and padding included.
struct StoredBytes {
  double per_point = 0;  ///< bytes of all point pages over points
  double per_node = 0;   ///< bytes of all node pages over nodes
};

/// Adds up the pages in the directory of a container.
[[nodiscard]] StoredBytes stored_bytes(const ContainerReader& container);

}  // namespace ptc::bench
