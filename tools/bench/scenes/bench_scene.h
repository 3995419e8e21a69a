// A scene that is measured: its container, what rays need of it, and who receives light.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "engine/base/executor.h"
#include "engine/io/mesh/mesh.h"
#include "engine/ptc.h"
#include "engine/shade/shading.h"
#include "engine/store/reader.h"
#include "tools/bench/scenes/procedural.h"

namespace ptc::bench {

/// Which scene: "fractal", "window", "city", or a mesh's or cloud's file.
struct SceneChoice {
  std::string name;  ///< in charts and their files: the word, or the file's name without ending
  std::filesystem::path file;  ///< empty for the words
  bool backdrop = false;       ///< the mesh stands on a ground before a wall
  unsigned layers = 0;         ///< of make_layers(), instead of a word or a file
};
/// @param text  a word, or a path with "+backdrop" appended where wanted
/// @throws RequestError when a word has a backdrop, or there is neither word nor path
[[nodiscard]] SceneChoice parse_scene(const std::string& text);
/// Likewise; where names are equal the later ones end in "-2", "-3" and so on.
[[nodiscard]] std::vector<SceneChoice> parse_scenes(const std::vector<std::string>& texts);

/// What a pixel of the camera's picture shows besides the light that is gathered.
struct Pixel {
  std::size_t receiver = 0;
  glm::vec3 albedo{0};
  glm::vec3 direct{0};
};

/// Receivers of one kind.
struct ReceiverSet {
  std::string name;  ///< "camera" or "points"
  std::vector<Receiver> receivers;
  /// Of the camera: a window in the middle of those pixels, row by row; receiver is kNone where
  /// nothing is seen.
  static constexpr std::size_t kNone = ~std::size_t{0};
  std::vector<Pixel> window;
  unsigned window_width = 0, window_height = 0;
};

struct SceneOptions {
  std::uint64_t points = 2'000'000;    ///< surfels wanted; clouds have as many as they have
  unsigned width = 640, height = 360;  ///< of the camera's picture
  unsigned shaded_width = 640,
           shaded_height = 360;  ///< in its middle, whose pixels are receivers; 0: none
  unsigned window_width = 128, window_height = 72;  ///< in the middle of that, to compare pictures
  std::uint64_t own_points = 100'000;               ///< of the scene's points as receivers, in runs
  float lift = 0.15F;                               ///< as ShadeRequest::lift
  bool rays = true;                    ///< surfels and mesh are loaded, which rays need
  Profile profile = Profile::compact;  ///< of the container
  int levels_per_stream = 1;           ///< as BuildOptions::levels_per_stream
  std::uint8_t page_shift = 16;        ///< as BuildRequest::page_shift
};

/// What build_container() is asked for, and what belongs to a procedural scene.
struct SceneRequest {
  BuildRequest build;
  LitScene lit;  ///< mesh, light and camera of a procedural scene but the city; else empty
};
[[nodiscard]] SceneRequest request_scene(const SceneChoice& choice, const SceneOptions& options,
                                         const RunOptions& run);

/// Builds a scene's container.
/// @return  its mesh (empty for a cloud), the light and the camera that belong to it
/// @throws DataError, RequestError, std::system_error as build_container()
[[nodiscard]] LitScene build_scene(const SceneChoice& choice, const SceneOptions& options,
                                   const std::filesystem::path& target, const RunOptions& run,
                                   Progress& progress);

/// Builds the container, loads what rays need, finds the receivers.
class BenchScene {
 public:
  /// @param work  a directory with room for the container, which has no name there once it is open
  /// @throws DataError, RequestError, std::system_error as build_container()
  BenchScene(const SceneChoice& choice, const SceneOptions& options,
             const std::filesystem::path& work, const RunOptions& run, Progress& progress);

  [[nodiscard]] const std::string& name() const noexcept { return name_; }
  [[nodiscard]] const ContainerReader& container() const noexcept { return *container_; }
  [[nodiscard]] const std::vector<Surfel>& surfels() const noexcept { return surfels_; }
  /// Empty for a cloud.
  [[nodiscard]] const Mesh& mesh() const noexcept { return lit_.mesh; }
  [[nodiscard]] const LightRig& lights() const noexcept { return lit_.lights; }
  [[nodiscard]] double spacing() const;
  [[nodiscard]] const std::vector<ReceiverSet>& sets() const noexcept { return sets_; }

 private:
  void add_camera(const SceneOptions& options, const Executor& executor, Progress& progress);
  void add_points(const SceneOptions& options);

  std::string name_;
  LitScene lit_;
  std::unique_ptr<ContainerReader> container_;
  std::vector<Surfel> surfels_;
  std::vector<ReceiverSet> sets_;
};

}  // namespace ptc::bench
