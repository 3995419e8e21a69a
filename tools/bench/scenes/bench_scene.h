// A scene that is measured: its container, the surfels and the mesh that rays need, and the sets of
// receivers that are shaded.
#pragma once

#include <array>
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

/// The words that name scenes without a file.
inline constexpr std::array kSceneWords{"fractal", "window", "city", "cornell", "box-lamp", "ajar"};

/// The choice of a scene: one of kSceneWords, or the file of a mesh or a cloud.
struct SceneChoice {
  std::string name;  ///< name in charts and files: the word, or the file's name without ending
  std::filesystem::path file;                 ///< empty where the scene is a word
  std::vector<std::filesystem::path> more{};  ///< further files of the same scene
  bool backdrop = false;                      ///< the mesh stands on a ground before a wall
  unsigned layers = 0;                        ///< above 0: make_layers() of this many sheets
};

/// Parses the choice of one scene.
/// @param text  a word, or a path, to which "+backdrop" may be appended
/// @throws RequestError when a word has a backdrop, or the text names no scene
[[nodiscard]] SceneChoice parse_scene(const std::string& text);
/// Parses the choices of several scenes. Where names are equal, the later ones end in "-2", "-3"
/// and so on.
/// @throws RequestError as parse_scene()
[[nodiscard]] std::vector<SceneChoice> parse_scenes(const std::vector<std::string>& texts);

/// What a pixel of the camera's picture shows in addition to the light that is gathered.
struct Pixel {
  std::size_t receiver = 0;  ///< index into ReceiverSet::receivers, or ReceiverSet::kNone
  glm::vec3 albedo{0};       ///< share of the arriving light that the surface reflects, 0 to 1
  glm::vec3 direct{0};       ///< emission, and reflected light of suns and lamps
};

/// The sets of receivers: what the pixels of a picture see, points of the scene in blocks of
/// neighbours, and points that lie far apart.
inline constexpr std::array kSets{"camera", "points", "sparse"};

/// The receivers of one kind: what the pixels of a picture see, or points of the scene itself, in
/// blocks of neighbours or far apart.
struct ReceiverSet {
  std::string name;  ///< one of kSets
  std::vector<Receiver> receivers;
  /// The Pixel::receiver of a pixel that sees nothing.
  static constexpr std::size_t kNone = ~std::size_t{0};
  /// The pixels of a window in the middle of the camera's picture, row by row from the top; empty
  /// for other sets.
  std::vector<Pixel> window;
  unsigned window_width = 0, window_height = 0;  ///< pixels
};

/// How large a scene is, and which receivers it has. Lengths of pictures are pixels.
struct SceneOptions {
  std::uint64_t points = 2'000'000;    ///< surfels wanted of a mesh or the city; clouds stay whole
  unsigned width = 640, height = 360;  ///< pixels of the camera's picture
  unsigned shaded_width = 640,
           shaded_height = 360;  ///< part in the picture's middle that is shaded; 0: none
  unsigned window_width = 128, window_height = 72;  ///< part in its middle for FLIP
  std::uint64_t own_points = 100'000;   ///< receivers among the scene's points, in blocks
  std::uint64_t sparse_points = 3'000;  ///< receivers that are spread evenly over its points
  float lift = 0.15F;                   ///< value of ShadeRequest::lift
  bool rays = true;                     ///< load the surfels and the mesh, which rays need
  Profile profile = Profile::compact;   ///< profile of the container
  int levels_per_stream = 1;            ///< value of BuildOptions::levels_per_stream
  std::uint8_t page_shift = 16;         ///< value of BuildRequest::page_shift
};

/// The request for build_container(), together with what belongs to a procedural scene.
struct SceneRequest {
  BuildRequest build;
  LitScene lit;  ///< mesh, light and camera; empty for the city and files
};

/// Translates a choice of scene into the request for its build.
[[nodiscard]] SceneRequest request_scene(const SceneChoice& choice, const SceneOptions& options,
                                         const RunOptions& run);

/// Builds a scene's container.
/// @param target  path of the container
/// @return  the scene's mesh (empty for a cloud) with the light and the camera that belong to it
/// @throws DataError, RequestError, std::system_error as build_container()
[[nodiscard]] LitScene build_scene(const SceneChoice& choice, const SceneOptions& options,
                                   const std::filesystem::path& target, const RunOptions& run,
                                   Progress& progress);

/// A scene with its container, its surfels, its mesh and its receivers, ready to be measured.
///
/// Memory: the surfels and the mesh whole, where SceneOptions::rays asks for them.
class BenchScene {
 public:
  /// Builds the container, loads what rays need and finds the receivers.
  /// @param work  a directory with room for the container, which has no name there once it is open
  /// @throws DataError, RequestError, std::system_error as build_container()
  BenchScene(const SceneChoice& choice, const SceneOptions& options,
             const std::filesystem::path& work, const RunOptions& run, Progress& progress);

  [[nodiscard]] const std::string& name() const noexcept { return name_; }
  [[nodiscard]] const ContainerReader& container() const noexcept { return *container_; }
  /// The surfels in the container's order; empty without SceneOptions::rays.
  [[nodiscard]] const std::vector<Surfel>& surfels() const noexcept { return surfels_; }
  /// The mesh that was sampled; empty for a cloud.
  [[nodiscard]] const Mesh& mesh() const noexcept { return lit_.mesh; }
  [[nodiscard]] const LightRig& lights() const noexcept { return lit_.lights; }
  /// Distance between neighbouring surfels, scene units.
  [[nodiscard]] double spacing() const;
  /// The receivers of the camera, where they are asked for, and then those of the scene's points,
  /// in blocks and far apart.
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
