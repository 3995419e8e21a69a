// A mesh cut into patches of surface, and points spread evenly over each.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "engine/io/mesh/mesh.h"
#include "engine/scene/sampling/spacing_field.h"
#include "engine/scene/sampling/sub_triangle.h"

namespace ptc {

/// A point that stands for a small share of the surface.
struct SurfacePoint {
  std::uint32_t triangle = 0;
  glm::vec2 uv{0};         ///< barycentric, as RayScene::surface()
  glm::vec3 position{0};   ///< relative to Mesh::origin
  glm::vec3 normal{0};     ///< unit, of the triangle
  std::uint32_t kind = 0;  ///< bit 0: emits; bit 1: double-sided
  double area = 0;         ///< one side's, of what it stands for
};

/// Points of one patch, and the surfels that they want.
struct SurfacePatch {
  std::vector<SurfacePoint> points;
  std::uint64_t first = 0;    ///< surfels of all patches before
  std::uint64_t surfels = 0;  ///< one for both sides
  double area = 0;            ///< of the surface, both sides of double-sided materials
};

/// The surface as a line along which wanted surfels are counted, cut into stretches.
///
/// Triangles are halved until they are a few spacings wide, and these pieces are sorted along the
/// Z-curve, so that a stretch is a compact patch whatever the tessellation. A piece's weight is its
/// area in units of its spacing, squared: the surfels wanted there.
/// Memory: 8 bytes a piece, 24 while they are sorted.
class SurfacePatches {
 public:
  /// @param surfels  wanted in one patch, roughly
  SurfacePatches(const Mesh& mesh, const SpacingField& field, double surfels);

  [[nodiscard]] std::size_t size() const noexcept { return begins_.size() - 1; }
  /// Surfels of all patches.
  [[nodiscard]] std::uint64_t surfels() const noexcept;

  /// Spreads `points_per_surfel` points for each surfel: cuts the patch into parts below a spacing,
  /// sorts them by kind, by the axis they face, and along the Z-curve, and sets points at equal
  /// steps of the weight. They come in that order, and their areas add up to the patch's.
  [[nodiscard]] SurfacePatch spread(std::size_t patch, unsigned points_per_surfel) const;

 private:
  // Which part of which triangle: below its leading 1, a bit for each halving, the first on top.
  struct Piece {
    std::uint32_t triangle;
    std::uint32_t path;
  };
  void cut(std::uint32_t triangle, const SubTriangle& shape, std::uint32_t path);
  void sort_along_curve();
  void join(double surfels);
  [[nodiscard]] SubTriangle shape_of(const Piece& piece) const;
  [[nodiscard]] double spacing_of(const SubTriangle& shape) const;
  [[nodiscard]] std::uint64_t surfels_before(std::size_t patch) const;
  const Mesh& mesh_;
  const SpacingField& field_;
  std::vector<Piece> pieces_;
  std::vector<std::size_t> begins_;  // first piece of each patch, and the end
  std::vector<double> weights_;      // of all patches before each, and the total
};

}  // namespace ptc
