// Cuts a mesh into patches of surface, and spreads points evenly over each.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <utility>
#include <vector>

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "engine/io/mesh/mesh.h"
#include "engine/scene/sampling/spacing_field.h"
#include "engine/scene/sampling/sub_triangle.h"

namespace ptc {

/// A point that stands for a small share of the surface.
struct SurfacePoint {
  std::uint32_t triangle = 0;  ///< index in Mesh::triangles
  glm::vec2 uv{0};             ///< barycentric coordinates as RayScene::surface() takes them
  glm::vec3 position{0};       ///< relative to Mesh::origin
  glm::vec3 normal{0};         ///< unit, geometric normal of the triangle
  std::uint32_t kind = 0;      ///< bit 0: emits; bit 1: double-sided
  double area = 0;             ///< of the surface that it stands for, one side only
};

/// The points of one patch, and the number of surfels that they are to become.
struct SurfacePatch {
  std::vector<SurfacePoint> points;
  std::uint64_t first = 0;    ///< number of surfels of all patches before this one
  std::uint64_t surfels = 0;  ///< number of surfels; the two sides of a material count as one
  double area = 0;            ///< of the surface; both sides of double-sided materials count
};

/// Returns the finest spacing that any point of a part of a triangle asks for.
/// @param origin  that of the mesh
[[nodiscard]] double spacing_of(const SubTriangle& shape, const SpacingField& field,
                                const glm::dvec3& origin);

/// Cuts a triangle into pieces that are a few spacings wide.
/// @param origin  that of the mesh
/// @param take    gets each piece and its path, as SurfacePatches::Piece has it
void cut_into_pieces(const SubTriangle& triangle, const SpacingField& field,
                     const glm::dvec3& origin,
                     const std::function<void(const SubTriangle&, std::uint32_t path)>& take);

/// Returns the piece of a triangle to which a path leads.
[[nodiscard]] SubTriangle piece_of(const SubTriangle& triangle, std::uint32_t path);

/// Returns the place of a piece on the Z-curve through a box, a number of 63 bits. The box has 2^21
/// cells along its widest side.
/// @param offset  of the centre of the piece from the low corner of the box
[[nodiscard]] std::uint64_t piece_place(const glm::dvec3& offset, double widest);

/// Returns the number of surfels of all patches whose weights add up to this.
[[nodiscard]] std::uint64_t surfels_of(double weight) noexcept;

/// The surface of a mesh as a line along which wanted surfels are counted, cut into stretches.
///
/// Triangles are halved until they are a few spacings wide, and these pieces are sorted along the
/// Z-curve, so that a stretch is a compact patch whatever the tessellation. The weight of a piece
/// is its area over its spacing squared: the number of surfels that are wanted there.
///
///     pieces    |--|-|---|--|-----|-|--|--|---|-|--|    along the Z-curve, as long as their weight
///     patches   |----------------|--------------|--     about `surfels` each
///
/// Memory: 8 bytes for each piece; 24 while they are sorted.
/// Threads: const members may be called concurrently.
class SurfacePatches {
 public:
  /// Cuts and sorts the surface.
  /// @param mesh, field  must outlive this
  /// @param surfels      wanted in one patch, roughly
  /// @param first        the first triangle that counts
  SurfacePatches(const Mesh& mesh, const SpacingField& field, double surfels,
                 std::uint32_t first = 0);

  /// A part of a triangle. Below its leading 1, the path has a bit for each halving, the first one
  /// on top: 0b1 is the whole triangle, 0b110 the first half of the second half.
  struct Piece {
    std::uint32_t triangle;
    std::uint32_t path;
  };
  /// Makes a single patch of pieces that cut_into_pieces() has made.
  /// @param mesh, field  must outlive this
  /// @param pieces       along the Z-curve
  /// @param before       weight of all patches before this one
  /// @param weight       of these pieces
  SurfacePatches(const Mesh& mesh, const SpacingField& field, std::vector<Piece> pieces,
                 double before, double weight)
      : mesh_(mesh),
        field_(field),
        pieces_(std::move(pieces)),
        begins_{0, pieces_.size()},
        weights_{before, before + weight} {}

  /// Returns the number of patches.
  [[nodiscard]] std::size_t size() const noexcept { return begins_.size() - 1; }
  /// Returns the number of surfels of all patches together.
  [[nodiscard]] std::uint64_t surfels() const noexcept;

  /// Spreads points evenly over a patch.
  ///
  /// Cuts the patch into parts narrower than a spacing, sorts them by kind, by the axis that they
  /// face, and along the Z-curve, and sets points at equal steps of the weight.
  /// @param patch              below size()
  /// @param points_per_surfel  number of points for each surfel
  /// @return  the points in that order, without those where nothing stops light; their areas, times
  ///          the opacity there, add up to what one side of the patch stops
  [[nodiscard]] SurfacePatch spread(std::size_t patch, unsigned points_per_surfel) const;

 private:
  /// Sorts the pieces along the Z-curve.
  void sort_along_curve();
  /// Joins successive pieces to patches of `surfels` surfels.
  void join(double surfels);
  /// Returns the shape of a piece, cut again from its triangle.
  [[nodiscard]] SubTriangle shape_of(const Piece& piece) const;
  const Mesh& mesh_;
  const SpacingField& field_;
  std::vector<Piece> pieces_;
  std::vector<std::size_t> begins_;  ///< index of the first piece of each patch, then of the end
  std::vector<double> weights_;      ///< weight of all patches before each, then the total
};

}  // namespace ptc
