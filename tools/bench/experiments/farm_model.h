// A model of a farm that runs a plan: how long its stages take on more machines than there are
// here.
//
//   scheduler   starts tasks one after another, `starts` a second
//   core        runs one task: opens files, reads, computes, writes
//   machine     its cores share `node_bytes` a second of the net
//   file system all machines share `store_bytes` a second of it
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

namespace ptc::bench {

/// What the tasks of a plan take of the core that they run on.
struct TaskCosts {
  double route_seconds = 0, part_seconds = 0;     ///< of CPU, a point
  double join_seconds = 0;                        ///< of CPU, a part
  double light_seconds = 0, bounce_seconds = 0;   ///< of CPU, a point
  double shade_seconds = 0, collect_seconds = 0;  ///< of CPU, a point
  double batch_points = 0;    ///< that are lit together: a part has foreign ones at its ends
  double start_seconds = 0;   ///< of CPU, to start the program of a task
  double listed_seconds = 0;  ///< of CPU, to read the plan, for each task in it
  double source_bytes = 0;    ///< of the input, a point
  double row_bytes = 0;       ///< between route and part, a point
  double stored_bytes = 0;    ///< of the container, a point
  double edge_bytes = 0;      ///< that the join reads, a part
  double shade_bytes = 0;     ///< of the result of a range, a point
};

/// The machines and what they share.
struct FarmHardware {
  std::uint64_t nodes = 1, cores = 16;  ///< machines, and tasks that run on each
  double node_bytes = 1.25e9;           ///< a second: 10 Gbit/s
  double store_bytes = 2e10;            ///< a second
  double open_seconds = 1e-3;           ///< to look for a file, or to open it
  double starts = 4.8;                  ///< tasks a second; Slurm started 200 empty ones in 42 s
  double slow_share = 0.02;             ///< of the tasks
  double slow_factor = 3;               ///< of the time of these
};

/// What is built, and what of its points.
struct FarmLoad {
  std::uint64_t points = 0, routes = 1, parts = 1;
  bool lit = false;          ///< each part by the whole scene
  std::uint64_t waves = 0;   ///< bounces that all points get before they are shaded
  std::uint64_t ranges = 1;  ///< in which the points are shaded
  bool collected = false;    ///< in one file; otherwise each range has a file of its own
};

/// What a run takes.
struct FarmTimes {
  /// Seconds until a stage ends, after the one before. Light and bounces include their joins.
  double route = 0, part = 0, join = 0, light = 0, bounce = 0, shade = 0, collect = 0;
  double cpu_seconds = 0;  ///< of all tasks
  double moved_bytes = 0;  ///< over the file system
  double opened = 0;       ///< files that are looked for or opened
  std::string limit;       ///< what most of the time is due to

  [[nodiscard]] double built() const noexcept { return route + part + join; }
  [[nodiscard]] double total() const noexcept { return built() + light + bounce + shade + collect; }
};

/// Plays a run: tasks of a stage start in their order, on the core that is free first.
/// @pre no number is zero where something is divided by it
[[nodiscard]] FarmTimes play(const FarmLoad& load, const TaskCosts& costs,
                             const FarmHardware& hardware);

/// Returns the bytes of a plan, which has a text for each input and for each task.
[[nodiscard]] double plan_bytes(const FarmLoad& load) noexcept;

}  // namespace ptc::bench
