// The gather of one receiver, written to be read.
//
//     stack = root
//     while the stack is not empty
//       pop a node
//       of its children, drop what lies below the horizon
//       draw a cluster whose bounding sphere is below the solid angle
//       push every other one, or draw its points
//     sum up the pixels
//
// This is the gather of Kontkanen, Tabellion and Overbeck 2011 with exact discs in place of their
// splats. The kernels in engine/shade/kernels do the same for cells of receivers with vector
// instructions; gather_clusters.cpp has the pictures of a cluster and its disc.
#include "engine/shade/reference/plain_gather.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include <glm/geometric.hpp>

#include "engine/base/numbers.h"
#include "engine/io/cloud/record.h"
#include "engine/shade/reference/plain_cluster.h"
#include "format/node_layout.h"
#include "format/point_page.h"
#include "format/scalar.h"

namespace ptc {
namespace {

std::uint32_t pack(const glm::vec3& colour) {
  return encode_rgbe({colour.r, colour.g, colour.b});
}

/// Tells whether all surfels of a cluster lie about in one plane and look along its mean normal or
/// against it.
bool is_sheet(const ClusterShape& shape) {
  const float length = glm::length(shape.mean);
  return length > kDirected && length <= kFlat && shape.thickness < kSheet * shape.radius;
}

/// Appends the disc of a cluster to the queue.
void draw_cluster(const GroupView& group, int i, const Cluster& c, const GatherOptions& options,
                  DiscQueue& queue) {
  const glm::vec3 toward = -glm::normalize(c.to);
  const ClusterShape shape{c.mean, c.area, c.radius, c.thickness};
  const glm::vec3 from = seen_from(shape, toward);
  const Front front = front_of(group, i, c, from);
  const float back = front.area - glm::dot(c.mean, from);
  const float projected = options.sides == Sides::both ? std::max(front.area, back) : front.area;
  if (!(c.area * projected > 0)) return;
  const Splat splat = make_splat(shape, toward, c.area * projected, options.inflation);
  const float over = lit_area(splat, front.area, projected);
  const glm::vec3 colour = over > 0 ? front.radiance / over : glm::vec3(0);
  queue.push(c.to, splat.normal, splat.radius, pack(colour));
}

}  // namespace

glm::vec3 seen_from(const ClusterShape& shape, const glm::vec3& toward) {
  if (!is_sheet(shape)) return toward;
  return std::copysign(1 / glm::length(shape.mean), glm::dot(shape.mean, toward)) * shape.mean;
}

Splat make_splat(const ClusterShape& shape, const glm::vec3& toward, float projected,
                 float inflation) {
  const float length = glm::length(shape.mean);
  if (length > kFlat)
    return {shape.mean / length, std::min(shape.radius, std::sqrt(shape.area / 2)), true};
  if (is_sheet(shape))
    return {seen_from(shape, toward), std::min(shape.radius, std::sqrt(projected / 2)), false};
  // Take the disc that has the silhouette of an ellipsoid about the mean normal, or of a ball where
  // there is no direction.
  Splat splat{.normal = toward};
  float foreshortened = 1;
  if (length > kDirected) {
    const glm::vec3 axis = shape.mean / length;
    const float cosine = glm::dot(axis, toward);
    const float slim = std::min(1.0F, kSlim * shape.thickness / shape.radius);
    const float lean = std::sqrt(1 - slim * slim);
    foreshortened = std::sqrt(lean * lean * cosine * cosine + slim * slim);
    const float turn = std::copysign(lean, cosine);
    splat.normal = turn * axis + (foreshortened - turn * cosine) * toward;
  }
  const float seen = projected * inflation / (kPi * foreshortened);
  splat.radius = std::sqrt(std::min(seen, kSolid * shape.radius * shape.radius));
  return splat;
}

float height_of_top(const glm::vec3& to, const glm::vec3& normal, float radius,
                    const glm::vec3& slab_normal, float thickness) {
  const float height = glm::dot(to, normal);
  const float cosine = glm::dot(slab_normal, normal);
  const float tilt = std::sqrt(std::max(0.0F, 1 - cosine * cosine));
  return height + std::min(radius, thickness + radius * tilt);
}

Shading PlainGather::shade(const Receiver& receiver, const DirectionGrid& grid) {
  // Draw the cut through the octree.
  grid_ = &grid;
  buffer_.clear();
  queue_.size = 0;
  stack_.assign(1, scene_.view().root());
  WalkLimit limit(scene_.view());
  while (!stack_.empty()) {
    const ChildRef next = stack_.back();
    stack_.pop_back();
    if (next.interior) {
      limit.take_group();
      visit_group(next, receiver);
    } else {
      limit.take_points(next.point_count);
      visit_points(next, receiver);
    }
  }
  // Draw the rest of the queue, and sum up the pixels.
  buffer_.draw(grid, queue_, options_.sides);
  ++counts_.receivers;
  return buffer_.resolve(grid, receiver.normal);
}

void PlainGather::visit_group(const ChildRef& reference, const Receiver& receiver) {
  ++counts_.groups;
  const PinnedGroup pinned = scene_.group(reference.page, reference.slot);
  const GroupView& group = *pinned;
  for (int i = 0; i < group.size(); ++i) {
    const Cluster c = read_cluster(group, i, scene_.view().frame(), receiver.position);
    const glm::vec3 slab = c.flatness > 0 ? c.mean / c.flatness : glm::vec3(0);
    if (height_of_top(c.to, receiver.normal, c.radius, slab, c.thickness) <= 0) continue;
    if (kPi * c.radius * c.radius >= options_.solid_angle * glm::dot(c.to, c.to)) {
      stack_.push_back(group.child(i));
      continue;
    }
    ++counts_.clusters;
    draw_cluster(group, i, c, options_, queue_);
    if (!queue_.full()) continue;
    buffer_.draw(*grid_, queue_, options_.sides);
    queue_.size = 0;
  }
}

void PlainGather::visit_points(const ChildRef& run, const Receiver& receiver) {
  const std::uint32_t per_page = scene_.view().points_per_page();
  for (std::uint64_t k = run.first_point; k < run.first_point + run.point_count; ++k) {
    const PageGuard page = scene_.points(k);
    const PointPage points(page.payload(), page.record_count(), scene_.view().point_bytes());
    const Surfel surfel =
        to_surfel(points[static_cast<std::uint32_t>(k % per_page)], scene_.view().frame());
    const glm::vec3 to(surfel.position - receiver.position);
    if (!(surfel.radius > 0) ||
        height_of_top(to, receiver.normal, surfel.radius, surfel.normal, 0) <= 0)
      continue;
    ++counts_.surfels;
    queue_.push(to, surfel.normal, surfel.radius, pack(surfel.outgoing()));
    if (!queue_.full()) continue;
    buffer_.draw(*grid_, queue_, options_.sides);
    queue_.size = 0;
  }
}

}  // namespace ptc
