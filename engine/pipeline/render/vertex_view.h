// What the vertices of a mesh show of the surface around them, for baking.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "engine/pipeline/render/primary.h"

namespace ptc {

/// The surface at the vertices of a mesh, seen along its normals. The pixels of a picture are the
/// vertices, row after row; what is left of the last row shows nothing.
///
///        +-------+         A sample of a vertex lies in the corner of one of its triangles, which
///       / \ x   /          come by turns, as often as their angles say. It lies a little inside,
///      /   \   /           so that it does not look through the gap that discs leave along an
///      edge.
///     +-----o +
///
/// Memory: bytes_for().   Threads: at() may be called concurrently.
class VertexView : public PrimaryView {
 public:
  /// @param scene, light  must outlive the view
  /// @param width   vertices in a row
  /// @param side    samples along the side of a pixel
  /// @param radius  of the surfels, scene units; receivers lie 0.6 of it inside their triangle, or
  ///                in its middle
  /// @param lift    height of receivers above the mesh, scene units
  VertexView(const RayScene& scene, const DirectLight& light, const LightSampling& sampling,
             unsigned width, unsigned side, float radius, float lift);

  [[nodiscard]] std::optional<PrimaryHit> at(unsigned x, unsigned y) const override;

  /// Returns the bytes that a view takes beside the mesh and its rays.
  [[nodiscard]] static std::uint64_t bytes_for(const Mesh& mesh) noexcept;

 private:
  /// Returns the corner in which a sample of a vertex lies: three times its triangle, and its
  /// number there.
  [[nodiscard]] std::uint32_t corner_of(std::uint64_t vertex, unsigned sample) const;

  const RayScene& scene_;
  const DirectLight& light_;
  LightSampling sampling_;
  unsigned width_, side_;
  float radius_, lift_;
  std::vector<std::uint32_t> first_;    ///< index in corners_, for each vertex, and the end
  std::vector<std::uint32_t> corners_;  ///< vertex after vertex
};

}  // namespace ptc
