#include "engine/pipeline/render/vertex_view.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <glm/geometric.hpp>

#include "engine/base/error.h"

namespace ptc {
namespace {

/// Returns the angle of a triangle at one of its corners, radians.
double angle_at(const Mesh& mesh, std::uint32_t corner) {
  const auto& triangle = mesh.triangles[corner / 3];
  const auto place = [&](std::uint32_t k) {
    return glm::dvec3(mesh.positions[triangle[(corner % 3 + k) % 3]]);
  };
  const glm::dvec3 a = place(1) - place(0), b = place(2) - place(0);
  return std::atan2(glm::length(glm::cross(a, b)), glm::dot(a, b));
}

}  // namespace

VertexView::VertexView(const RayScene& scene, const DirectLight& light,
                       const LightSampling& sampling, unsigned width, unsigned side, float radius,
                       float lift)
    : scene_(scene),
      light_(light),
      sampling_(sampling),
      width_(width),
      side_(side),
      radius_(radius),
      lift_(lift) {
  const Mesh& mesh = scene.mesh();
  require_request(mesh.triangles.size() <= UINT32_MAX / 3, "meshes",
                  "the meshes have more than 1,431,655,765 triangles");
  first_.resize(mesh.positions.size() + 1);
  for (const auto& triangle : mesh.triangles) {
    for (const std::uint32_t vertex : triangle) ++first_[vertex + 1];
  }
  for (std::size_t i = 1; i < first_.size(); ++i) first_[i] += first_[i - 1];
  corners_.resize(3 * mesh.triangles.size());
  std::vector<std::uint32_t> next(first_.begin(), first_.end() - 1);
  for (std::uint32_t i = 0; i < corners_.size(); ++i)
    corners_[next[mesh.triangles[i / 3][i % 3]]++] = i;
}

std::uint64_t VertexView::bytes_for(const Mesh& mesh) noexcept {
  return sizeof(std::uint32_t) * (2 * mesh.positions.size() + 3 * mesh.triangles.size() + 2);
}

std::uint32_t VertexView::corner_of(std::uint64_t vertex, unsigned sample) const {
  const auto begin = corners_.begin() + first_[vertex], end = corners_.begin() + first_[vertex + 1];
  const Mesh& mesh = scene_.mesh();
  double sum = 0;
  for (auto corner = begin; corner != end; ++corner) sum += angle_at(mesh, *corner);
  double rest = sum * (sample + 0.5) / (side_ * side_);
  for (auto corner = begin; corner != end; ++corner) {
    rest -= angle_at(mesh, *corner);
    if (rest < 0) return *corner;
  }
  return *(end - 1);
}

std::optional<PrimaryHit> VertexView::at(unsigned x, unsigned y) const {
  const Mesh& mesh = scene_.mesh();
  const std::uint64_t vertex = std::uint64_t{y / side_} * width_ + x / side_;
  if (vertex >= mesh.positions.size() || first_[vertex] == first_[vertex + 1]) return std::nullopt;
  const unsigned sample = y % side_ * side_ + x % side_;
  const std::uint32_t corner = corner_of(vertex, sample);
  const auto& triangle = mesh.triangles[corner / 3];
  const glm::vec3 middle =
      (mesh.positions[triangle[0]] + mesh.positions[triangle[1]] + mesh.positions[triangle[2]]) /
      3.0F;
  const auto step = static_cast<float>(
      baked_step(static_cast<double>(glm::distance(middle, mesh.positions[vertex])), radius_));
  std::array<float, 3> weights{step / 3, step / 3, step / 3};
  weights[corner % 3] = 1 - 2 * step / 3;
  const SurfaceHit surface = scene_.surface(corner / 3, weights[1], weights[2]);
  return seen_of_mesh(scene_, light_, sampling_, surface, -surface.geometric_normal, lift_,
                      vertex << 32 | sample);
}

}  // namespace ptc
