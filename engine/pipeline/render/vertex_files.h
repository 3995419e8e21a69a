// The files of a mesh whose vertices were baked.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "engine/io/file/spool.h"
#include "engine/io/mesh/mesh.h"
#include "engine/pipeline/render/display.h"
#include "engine/pipeline/render/film.h"
#include "engine/pipeline/render/picture_files.h"

namespace ptc {

/// Writes a mesh with the light of its vertices.
///
///   .ply   positions, normals, texture coordinates s and t, red, green and blue as a picture of
///          the target's layer has them, and all layers as properties: radiance_r, occlusion, ...
///   .glb   positions, normals, texture coordinates, materials without their textures, and COLOR_0,
///          by which a renderer multiplies the base colour: the target's layer, linear, brightened
///          by the exposure and cut off at 1; irradiance is multiplied by colours of the vertices
///
/// Each is published whole or not at all.
class VertexFiles {
 public:
  /// @param targets    their names end in .ply or .glb; must outlive this
  /// @param mesh       whose vertices are the pixels of the films; must outlive this
  /// @param exposure   stops by which light is brightened; empty: chosen for all targets alike, so
  ///                   that at most one vertex in two hundred is too bright without a curve
  /// @param directory  of temporary files
  /// @throws RequestError when a .glb would take 4 GiB or more; std::system_error
  VertexFiles(std::span<const PictureTarget> targets, const Mesh& mesh,
              std::optional<float> exposure, const std::filesystem::path& directory);

  /// Takes the next vertices. What lies behind the last one is left out.
  /// @throws std::system_error
  void write(const Film& film);

  /// Writes and publishes the files. @pre all vertices are there
  /// @return the exposure that was chosen, stops; nothing where none was needed
  /// @throws std::system_error
  std::optional<float> publish();

  /// Returns the memory that writing takes.
  [[nodiscard]] static std::uint64_t bytes(std::span<const PictureTarget> targets,
                                           const Mesh& mesh) noexcept;

 private:
  std::span<const PictureTarget> targets_;
  const Mesh& mesh_;
  std::optional<float> exposure_;
  ExposureMeter meter_;
  std::uint64_t vertices_ = 0;                            ///< so far
  std::vector<std::unique_ptr<Spool<glm::vec3>>> shown_;  ///< of each target, vertex after vertex
  std::vector<ExrLayerType> layers_;
  Spool<float> values_;  ///< of all layers, vertex after vertex, if there is a .ply
  bool has_ply_ = false;
};

}  // namespace ptc
