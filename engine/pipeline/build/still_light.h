// The light of what stands still in a scene where other things move (spec/shading.md#still-parts).
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "engine/base/executor.h"
#include "engine/base/stream.h"
#include "engine/io/mesh/mesh.h"
#include "engine/scene/light/direct_light.h"
#include "engine/scene/ray_scene.h"
#include "format/point_record.h"

namespace ptc {

/// Corrects the light of surfels that were sampled and lit without what moves.
///
///        lamp               The rays of a surfel are cast at what moves first. Where none of them
///          \  \    .-.      meets it, the surfel keeps its light, to the last bit. Else the light
///           \  `--( x )     becomes the share of it that the rays bring which nothing stops, of
///       _____\_____`-'_     those that what stands still lets through.
///        same    shaded
///
/// Light of emitters that move is added. A surfel that lies inside of what moves is left out.
///
/// Memory: the mesh, and rays at both of its parts.   Threads: const members may be called
/// concurrently.
class StillLight {
 public:
  /// @param whole     what stands still, then what moves
  /// @param first     the first triangle of what moves
  /// @param lights    of the scene
  /// @param sampling  rays of each surfel
  StillLight(Mesh whole, std::uint32_t first, const LightRig& lights,
             const LightSampling& sampling);

  /// Returns the points of what stands still in the light of the moment.
  /// @param still     without what moves; must outlive the result, as this and the executor must
  [[nodiscard]] std::unique_ptr<PointStream> light(PointStream& still, const Frame& frame,
                                                   const Executor& executor) const;

 private:
  class Points;
  struct Place;
  enum class Fate : std::uint8_t { same, changed, buried };

  /// What may change at a surfel, and the number of places that are looked at.
  struct Reach {
    bool lamps = false;  ///< light of lamps, of emitters that stand still, and of a sky with a map
    bool sky = false;    ///< light of an even sky
    bool adds = false;   ///< what emitters that move give
    unsigned places = 0;
  };
  /// The light of lamps: irradiance without what moves, W/m^2, and the share of it that is left.
  struct Lamps {
    glm::vec3 alone{0}, left{1};
    bool change = false;
  };

  [[nodiscard]] Fate light(PointRecord& record, const Frame& frame, std::uint64_t number) const;
  [[nodiscard]] Reach reach_of(const Surfel& surfel) const;
  [[nodiscard]] bool may_shade_lamps(const glm::dvec3& position, double reach) const;
  void find_places(const Surfel& surfel, unsigned count, std::vector<Place>& places) const;
  [[nodiscard]] Lamps lamps_at(std::span<const Place> places, std::uint64_t seed) const;
  [[nodiscard]] float taken_sky(const Place& at, std::size_t places, std::uint64_t seed) const;
  [[nodiscard]] glm::vec3 added_at(const Place& at, std::uint64_t seed) const;

  Mesh moving_mesh_, still_mesh_;
  RayScene moving_, still_;
  DirectLight light_;             ///< of what stands still
  DirectLight moving_light_;      ///< of what moves alone: its emitters
  LightSampling of_place_;        ///< rays; none at an even sky
  glm::vec3 even_sky_{0};         ///< radiance of a sky without a map that lit the surfels
  glm::dvec3 middle_{0};          ///< of a ball around what moves, scene units
  double radius_ = 0;             ///< of the ball
  bool lit_by_surfaces_ = false;  ///< emitters stand still, whose rays may go anywhere
};

/// Cuts the triangles of a mesh from one on off, with their vertices. Both meshes keep all
/// materials.
/// @pre the vertices of those triangles follow all others, and the mesh knows no objects
[[nodiscard]] Mesh cut_mesh(Mesh& mesh, std::uint32_t first);

}  // namespace ptc
