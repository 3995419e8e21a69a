#include "tools/bench/experiments/stored_bytes.h"

#include "engine/store/structure.h"

namespace ptc::bench {

StoredBytes stored_bytes(const ContainerReader& container) {
  std::uint64_t points = 0, nodes = 0;  // bytes
  for (const DirectoryEntry& entry : container.entries()) {
    if (entry.type == PageType::point) points += extent_bytes(entry.stored_bytes);
    if (entry.type == PageType::node) nodes += extent_bytes(entry.stored_bytes);
  }
  const Superblock& all = container.superblock();
  return {.per_point = static_cast<double>(points) / static_cast<double>(all.points),
          .per_node = static_cast<double>(nodes) / static_cast<double>(all.nodes)};
}

}  // namespace ptc::bench
