// Decodes surfels, and draws all of them for each receiver.
#include "engine/shade/reference/brute_force.h"

#include <string>

#include <glm/geometric.hpp>

#include "engine/base/error.h"
#include "engine/io/cloud/record.h"
#include "engine/store/point_scan.h"
#include "format/scalar.h"

namespace ptc {

std::vector<Surfel> load_surfels(const ContainerReader& container, std::uint64_t limit) {
  const std::uint64_t count = container.superblock().points;
  if (count > limit) {
    throw RequestError("limit",
                       container.path().string() + ": " + std::to_string(count) +
                           " points are too many for a reference in memory, whose limit is " +
                           std::to_string(limit));
  }
  std::vector<Surfel> surfels;
  surfels.reserve(static_cast<std::size_t>(count));
  append_surfels(container, container.point_pages(), surfels);
  return surfels;
}

void append_surfels(const ContainerReader& container, PageNumbers::Range pages,
                    std::vector<Surfel>& surfels) {
  PointScan scan(container, pages);
  while (scan.next()) {
    const PointPage points = scan.points();
    for (std::uint32_t i = 0; i < points.size(); ++i) {
      surfels.push_back(to_surfel(points[i], container.header().frame));
    }
  }
}

void shade_brute_force(std::span<const Surfel> surfels, std::span<const Receiver> receivers,
                       std::span<Shading> results, const DirectionGrid& grid, Sides sides,
                       const Executor& executor) {
  executor.for_each(receivers.size(), [&](std::size_t i, unsigned) {
    // Draw every surfel that reaches above the receiver's horizon, a queue at a time.
    DirectionBuffer buffer(grid.resolution());
    DiscQueue queue;
    for (const Surfel& s : surfels) {
      const glm::vec3 to(s.position - receivers[i].position);
      if (glm::dot(to, receivers[i].normal) + s.radius <= 0 || !(s.radius > 0)) continue;
      const glm::vec3 light = s.outgoing();
      queue.push(to, s.normal, s.radius, encode_rgbe({light.r, light.g, light.b}));
      if (!queue.full()) continue;
      buffer.draw(grid, queue, sides);
      queue.size = 0;
    }
    buffer.draw(grid, queue, sides);
    results[i] = buffer.resolve(grid, receivers[i].normal);
  });
}

}  // namespace ptc
