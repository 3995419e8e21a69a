// What the calls of pipeline.h share: stage clocks, memory left, temporaries, the record in the
// meta page.
#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "engine/pipeline/pipeline.h"
#include "engine/shade/lost_pages.h"
#include "engine/store/reader.h"

namespace ptc {

/// Times one stage and tells its progress, from construction to destruction.
class Stage {
 public:
  Stage(StageSeconds& seconds, Progress& progress, std::string name, std::uint64_t total,
        const char* unit);
  ~Stage();
  Stage(const Stage&) = delete;
  Stage& operator=(const Stage&) = delete;

 private:
  StageSeconds& seconds_;
  Progress& progress_;
  std::string name_;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

/// What is left of a cap for a stage. @throws std::invalid_argument naming the least cap that works
[[nodiscard]] std::uint64_t memory_left(const RunOptions& run, std::uint64_t taken,
                                        std::uint64_t least, const char* what_for);

/// What an open container takes.
[[nodiscard]] std::uint64_t open_bytes(const ContainerReader& container) noexcept;

/// The same for the page cache of a gather, whose threads take kGatherBytes each, from an open
/// scene.
[[nodiscard]] std::uint64_t cache_bytes_left(const RunOptions& run, std::uint64_t taken,
                                             const ContainerReader& scene, unsigned threads,
                                             BackEnd back_end, const char* what_for);

/// Damage is tolerated by a gather from the scene itself, for which no ray and no earlier bounce
/// reads every point.
/// @throws std::invalid_argument when it is to be tolerated and something else is asked for
void check_damage_request(bool tolerate, unsigned bounces, const std::optional<double>& error,
                          const CheckRequest& check);

/// What there is to tell of lost pages.
[[nodiscard]] DamageReport damage_report(const ContainerReader& scene, const LostPages& lost,
                                         const DamageCounts& stand_ins);

/// Where temporary files go: the given directories, else the target's.
[[nodiscard]] std::vector<std::filesystem::path> temp_dirs(const RunOptions& run,
                                                           const std::filesystem::path& target);
/// The one of them with most room, for a file that is not spread.
[[nodiscard]] std::filesystem::path roomiest_temp_dir(const RunOptions& run,
                                                      const std::filesystem::path& target);

/// A container for the time of one run. Its name goes as soon as it is open: however the run ends
/// from then on, nothing is left.
/// @param write  writes the container to the path that it is given, or throws and leaves nothing
[[nodiscard]] std::unique_ptr<ContainerReader> make_temporary(
    const std::filesystem::path& directory,
    const std::function<void(const std::filesystem::path&)>& write);

/// The lights that a container was built with; none when it does not say.
[[nodiscard]] LightRig recorded_lights(const ContainerReader& container);
/// Emissive triangles lit the surfels: what these emit is in the radiance of those around them.
[[nodiscard]] bool lit_by_emitters(const ContainerReader& container);
/// Spacing of the surfels: recorded, else the square root of area over points.
[[nodiscard]] double surfel_spacing(const ContainerReader& container);

/// Where light is wanted at a surfel. @param lift  in its radii
[[nodiscard]] Receiver lifted(const Surfel& surfel, float lift);

/// Sky as a gather takes it; empty for a black one.
[[nodiscard]] std::function<glm::vec3(const glm::vec3&)> sky_function(const Sky& sky);

/// Bytes of a mesh and of what Embree keeps of it.
/// @param rays  of the mesh, or null
[[nodiscard]] std::uint64_t mesh_bytes(const Mesh& mesh, const RayScene* rays);

// Keys of the meta page's text.
inline constexpr const char* kLightsKey = "lights";
inline constexpr const char* kEmittersKey = "emitters";
inline constexpr const char* kCameraKey = "camera";
inline constexpr const char* kSpacingKey = "spacing";
inline constexpr const char* kInputsKey = "inputs";
inline constexpr const char* kRoundingKey =
    "rounding";  ///< its text is kRounding when points were rounded

/// Part of a cap that buffers outside the large budgets take: open pages, blocks, receivers.
inline constexpr std::uint64_t kBufferBytes = std::uint64_t{32} << 20;
/// Least that the sort of a build is given.
inline constexpr std::uint64_t kLeastSort = std::uint64_t{48} << 20;
/// What a thread that gathers takes besides: direction buffers and lists of its receiver cells, 14
/// MiB at the most seen (receivers 80 surfels apart in a city of 20 million).
inline constexpr std::uint64_t kGatherBytes = std::uint64_t{16} << 20;

}  // namespace ptc
