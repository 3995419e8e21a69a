// The plan of a build on many machines: what is built, where it is cut, and the tasks.
//
//   make_plan()      inputs --> bounds, sample --> frame, cuts          plan.json
//   route.0 ...      an input --> its points by range                   scene.parts/route.0
//   part.0 ...       a range of all inputs --> sorted, built            scene.parts/0.ptcx, its
//   join             edges of all parts --> the top of the tree         scene.ptcx
//   tune             pilots --> settings that meet the error            scene.parts/tune
//   shade.0 ...      a range of the scene's points --> their light      scene.parts/shade.0
//   collect          the light of all ranges --> shaded points          shaded.ply
//                    (where ranges have files of their own: nothing)
//   frame.0 ...      the scene, its bounces --> a picture               turn.0001.exr
//
// A scene that is lit is built under another name first, and so is one for each bounce but the
// last:
//
//   part.0 ...  join           as above                      scene.parts/unlit.0.ptcx, unlit.ptcx
//   light.0 ...                a part, lit by the scene      scene.parts/0.ptcx, its edges
//   join_light                 edges of all lit parts        scene.ptcx
//   bounce_1.0 ...             a part, lit once more         scene.parts/bounce_1.0.ptcx, its edges
//   join_bounce_1              edges of all these parts      scene.parts/bounce_1.ptcx
//
// Every task is one command line. It can be run again at any time, publishes what it makes by
// rename, and leaves a mark when it is done, by which it does nothing the next time.
#pragma once

#include <array>
#include <compare>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "engine/base/progress.h"
#include "engine/pipeline/build/attributes.h"
#include "engine/pipeline/build/build_container.h"
#include "engine/pipeline/farm/input_state.h"
#include "engine/pipeline/farm/range_file.h"
#include "engine/pipeline/light/light_container.h"
#include "engine/pipeline/render/shots.h"
#include "engine/pipeline/shade/shade_container.h"
#include "engine/scene/procedural/city.h"
#include "format/morton.h"
#include "format/schema.h"

namespace ptc {

/// The kinds of tasks, in the order in which they run.
enum class TaskKind {
  route,
  part,
  join,
  light,
  join_light,
  bounce,
  join_bounce,
  tune,
  shade,
  collect,
  frame
};

/// All kinds.
inline constexpr std::array kTaskKinds{
    TaskKind::route,      TaskKind::part,    TaskKind::join,        TaskKind::light,
    TaskKind::join_light, TaskKind::bounce,  TaskKind::join_bounce, TaskKind::tune,
    TaskKind::shade,      TaskKind::collect, TaskKind::frame};

/// Returns the name of a kind, "route".
[[nodiscard]] const char* name_of(TaskKind kind) noexcept;

/// Tasks that may run at the same time: those of one kind, and of one bounce.
struct TaskStep {
  TaskKind kind = TaskKind::route;
  unsigned wave = 0;  ///< number of the bounce, from 1 on; 0 for other kinds

  /// Returns its name, "part" or "bounce_2".
  [[nodiscard]] std::string name() const;
  auto operator<=>(const TaskStep&) const = default;
};

/// One task of a plan.
struct FarmTask {
  TaskStep step;
  std::size_t number = 0;                      ///< among the tasks of its step
  std::vector<std::string> command;            ///< from the program on
  std::optional<TaskStep> after;               ///< all its tasks must be done before
  std::vector<std::filesystem::path> inputs;   ///< "route.*" stands for the files of all routes
  std::vector<std::filesystem::path> outputs;  ///< at least one
  std::uint64_t memory_bytes = 0;              ///< the cap that it is given
  std::uint64_t disk_bytes = 0;                ///< of its outputs, about
  double seconds = 0;                          ///< expected, on one core

  /// Returns its name in the plan, "part.3".
  [[nodiscard]] std::string name() const;
};

/// What a task of the kind route takes: a cloud of the plan, as it was measured, or a share of it,
/// or some blocks of the city.
struct FarmInput {
  std::filesystem::path path;     ///< empty: the city
  CityBlocks blocks;              ///< of the city
  std::uint64_t first = 0;        ///< number in the file of the first point of a share
  std::uint64_t points = 0;       ///< of the share; of the city, about
  std::vector<Channel> channels;  ///< in the order of its rows
  std::vector<bool> taken;        ///< as for AttributePlan::add_input()
};

inline constexpr std::size_t kMaxParts = 10'000;     ///< of a plan
inline constexpr std::size_t kMaxRanges = 10'000;    ///< of the points of a plan, to shade
inline constexpr std::size_t kMaxTasks = 1'000'000;  ///< of a plan

/// How the points of the scene are shaded, when they are.
struct FarmShading {
  /// File of points; with a mark for a number in its name, as frame_name() takes it, a file for
  /// each range.
  std::filesystem::path target;
  ShadeRequest request;    ///< settings; the scene is that of the plan
  std::size_t ranges = 0;  ///< 0: one for each million points
};

/// Pictures of the scene, when there are: one, or the frames of a sequence. They are rendered by a
/// program, whose options this library does not know.
struct FarmFrames {
  std::vector<std::string> options;  ///< without scene, frames and resources
  std::filesystem::path directory;   ///< in which it runs
  /// Files of a picture, at least one; of a sequence as for frame_name().
  std::vector<std::filesystem::path> targets;
  std::optional<FrameRange> range;  ///< empty: one picture
  /// The number of bounces, and the gather and the lift of those that light all points.
  LightingRequest lighting;
  double seconds = 120;  ///< expected for a picture, on one core; a plan keeps it by task

  /// Returns the number of pictures.
  [[nodiscard]] std::size_t count() const noexcept { return range ? range->count() : 1; }
};

struct FarmPlan;

/// Returns the command line of a task.
using TaskCommand =
    std::function<std::vector<std::string>(const FarmPlan& plan, const FarmTask& task)>;

/// What make_plan() may choose.
struct FarmOptions {
  TaskCommand command;
  std::size_t parts = 0;  ///< 0: as many as let the points of a part fit in memory
  std::uint64_t memory_bytes = std::uint64_t{1} << 30;  ///< the cap of each task
  /// Points of a container or the city that a task routes; 0: 4 million, or more where it would
  /// take more than 2,000 tasks to route all.
  std::uint64_t share_points = 0;
  std::size_t ranges = 0;  ///< of the curve in a part, at most; 0: as many as speed up its sort
  std::optional<LightRequest> lighting;  ///< as of FarmPlan
  std::optional<FarmShading> shading;
  std::optional<FarmFrames> frames;
};

/// A plan, as its file says it.
struct FarmPlan {
  std::filesystem::path file;   ///< the plan's own file
  std::filesystem::path scene;  ///< the scene that the last task writes
  std::uint64_t id = 0;         ///< hash of the file, which what tasks write names
  BuildRequest request;         ///< how points are stored, and which are taken
  std::vector<FarmInput> inputs;
  /// The states of the files of inputs and of their parts, before they were measured.
  std::map<std::filesystem::path, std::vector<InputState>> files;
  Frame frame;
  bool emits = false;
  std::uint64_t points = 0;     ///< expected
  Meta meta;                    ///< record of each part, complete
  std::vector<MortonKey> cuts;  ///< where parts begin, but for the first
  /// Where ranges begin, but for the first: all cuts are among them. A route sorts points into
  /// ranges, and a part sorts one range after another.
  std::vector<MortonKey> borders;
  /// How the points of the scene are lit anew, when they are: lights are given, the scene is that
  /// of the plan. A plan that was read has no picture of the sky, but its path.
  std::optional<LightRequest> lighting;
  std::optional<FarmShading> shading;  ///< with the number of ranges
  std::optional<FarmFrames> frames;
  std::vector<FarmTask> tasks;

  /// Returns the number of parts.
  [[nodiscard]] std::size_t parts() const noexcept { return cuts.size() + 1; }
  /// Returns the numbers of the first range of a part, and of the one behind its last.
  [[nodiscard]] std::array<std::size_t, 2> ranges_of(std::size_t part) const;
  /// Returns the folder of the parts, "scene.parts".
  [[nodiscard]] std::filesystem::path folder() const;
  /// Says whether an input is a share of a file that others have shares of.
  [[nodiscard]] bool is_divided(std::size_t input) const;
  /// Says whether each range that is shaded gets a file of points of its own.
  [[nodiscard]] bool has_tiles() const;
  /// Returns how many points are shaded, about. @pre shading
  [[nodiscard]] std::uint64_t shaded_points() const;
  /// Returns how many bounces tasks make of all points, for ranges that are shaded and for
  /// pictures.
  [[nodiscard]] unsigned waves() const noexcept;
  /// Says whether pictures are lit by bounces that tasks made: they have more than one, with the
  /// settings of those that the shading needs, if it does.
  [[nodiscard]] bool renders_bounces() const noexcept;
  /// Returns the settings of the bounces that tasks make. @pre waves() > 0
  [[nodiscard]] const LightingRequest& bounce_settings() const noexcept;
  /// Returns the scene of the plan with the light of all bounces but the last, which tasks have
  /// made.
  /// @param bounces  2 to waves() + 1
  [[nodiscard]] std::filesystem::path bounced(unsigned bounces) const;
  /// Returns the files of a picture. @pre frames
  [[nodiscard]] std::vector<std::filesystem::path> pictures(std::size_t number) const;
  /// Returns the first file that a task writes.
  [[nodiscard]] std::filesystem::path output(const TaskStep& step, std::size_t number) const;
  /// Returns the channels as the inputs have them.
  /// @throws DataError when they do not give the channels of the record
  [[nodiscard]] AttributePlan attributes() const;
  /// Returns what a point takes in a file of ranges.
  [[nodiscard]] RangeRow row() const;
};

/// Says whether two runs have as many bounces, and light the points alike before the last one.
[[nodiscard]] bool has_same_bounces(const LightingRequest& a, const LightingRequest& b);

/// Measures the inputs and plans the tasks. Points are read once.
/// @param request  what to build. Inputs are clouds and containers whose points have normals and
///                 radii and keep the light that they have, or the city
/// @throws RequestError for meshes, for points that lack normals or radii, for lamps of one input
///         that would light another where no lights are given, and for fields that a farm does not
///         take; when the scene or the plan is an input or a part of one, when one lies in the
///         folder of the parts, and for paths with control characters; DataError when an input
///         changes meanwhile; LimitError when the cap of the tasks is too small; as
///         build_container()
[[nodiscard]] FarmPlan make_plan(const BuildRequest& request, const std::filesystem::path& scene,
                                 const std::filesystem::path& file, const FarmOptions& options,
                                 Progress& progress);

/// Writes a plan to its file, and sets its identity.
/// @throws std::system_error
void write_plan(FarmPlan& plan);
/// Reads a plan. What a task takes, writes and runs follows from the plan, whatever its file says.
/// @param command  as for make_plan()
/// @throws DataError that names the file, also when its tasks are not those that the plan implies;
///         std::system_error
[[nodiscard]] FarmPlan read_plan(const std::filesystem::path& file, const TaskCommand& command);

}  // namespace ptc
