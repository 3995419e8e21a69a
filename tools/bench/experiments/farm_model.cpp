#include "tools/bench/experiments/farm_model.h"

#include <algorithm>
#include <array>
#include <functional>
#include <limits>
#include <queue>
#include <utility>
#include <vector>

namespace ptc::bench {
namespace {

// Bytes of the file of a plan. A task takes 496, as measured with 9,009 of them. An input of the
// city takes 127, one with 12 channels 3,066; the model assumes 250.
constexpr double kTaskBytes = 496, kInputBytes = 250;

double tasks_of(const FarmLoad& load) {
  const std::uint64_t joined = load.parts + 1;  // the parts, and the task that joins them
  return static_cast<double>(load.routes + (1 + load.waves + (load.lit ? 1 : 0)) * joined +
                             load.ranges + 1);
}

/// The tasks of a stage, which are alike.
struct Stage {
  std::uint64_t tasks = 1;
  double cpu_seconds = 0, bytes = 0, opened = 0;  // of one task
};

/// How long a stage would take if nothing but one thing took time.
struct Limits {
  double cpu = 0, node = 0, store = 0, files = 0, scheduler = 0, longest = 0;
};

/// Says whether a task is one of the slow ones; they are spread evenly.
bool is_slow(std::uint64_t task, double share) {
  const auto slow_until = [share](std::uint64_t tasks) {
    return static_cast<std::uint64_t>(static_cast<double>(tasks) * share + 0.5);
  };
  return slow_until(task + 1) > slow_until(task);
}

/// Returns what a task takes beside moving its bytes, seconds.
double fixed_seconds(const Stage& stage, const FarmHardware& hardware, bool slow) {
  return stage.cpu_seconds * (slow ? hardware.slow_factor : 1) +
         stage.opened * hardware.open_seconds;
}

/// Plays a stage: a task begins when the scheduler and a core are free, moves its bytes beside the
/// others that move theirs, and then computes.
class StageRun {
 public:
  StageRun(const Stage& stage, const FarmHardware& hardware) : stage_(stage), hardware_(hardware) {}

  /// Returns when the last task ends, seconds.
  double end() {
    std::uint64_t ended = 0;
    while (ended < stage_.tasks) {
      // Find what comes next
      const double moved = moving_.empty() ? kNever : now_ + (moving_.top().until - each_) / rate();
      const double computed = computing_.empty() ? kNever : computing_.top();
      const bool may_begin = begun_ < stage_.tasks && begun_ - ended < cores();
      const double begins =
          may_begin ? std::max(now_, static_cast<double>(begun_ + 1) / hardware_.starts) : kNever;
      const double next = std::min({moved, computed, begins});
      if (!moving_.empty()) each_ += (next - now_) * rate();
      now_ = next;
      // Take it
      if (next == begins) {
        moving_.push({.until = each_ + stage_.bytes, .task = begun_++});
      } else if (next == moved) {
        const bool slow = is_slow(moving_.top().task, hardware_.slow_share);
        moving_.pop();
        computing_.push(now_ + fixed_seconds(stage_, hardware_, slow));
      } else {
        computing_.pop();
        ++ended;
      }
    }
    return now_;
  }

 private:
  static constexpr double kNever = std::numeric_limits<double>::infinity();
  struct Moving {
    double until = 0;  // bytes that each has moved by then which has moved from the start
    std::uint64_t task = 0;
    bool operator>(const Moving& other) const { return until > other.until; }
  };

  [[nodiscard]] std::uint64_t cores() const { return hardware_.nodes * hardware_.cores; }
  /// Bytes a second of each task that moves some now. These are spread evenly over the machines.
  [[nodiscard]] double rate() const {
    const auto tasks = static_cast<double>(moving_.size());
    const double on_node = std::max(1.0, tasks / static_cast<double>(hardware_.nodes));
    return std::min(hardware_.node_bytes / on_node, hardware_.store_bytes / tasks);
  }

  const Stage& stage_;
  const FarmHardware& hardware_;
  double now_ = 0, each_ = 0;  // each_: bytes that a task would have moved since the start
  std::uint64_t begun_ = 0;
  std::priority_queue<Moving, std::vector<Moving>, std::greater<>> moving_;
  std::priority_queue<double, std::vector<double>, std::greater<>> computing_;  // their ends
};

void add_bounds(Limits& sum, const Stage& stage, const FarmHardware& hardware) {
  const auto tasks = static_cast<double>(stage.tasks);
  const auto nodes = static_cast<double>(hardware.nodes);
  const double cores = nodes * static_cast<double>(hardware.cores);
  const bool some_slow = hardware.slow_share * tasks >= 0.5;
  sum.cpu += tasks * stage.cpu_seconds / cores;
  sum.node += tasks * stage.bytes / (nodes * hardware.node_bytes);
  sum.store += tasks * stage.bytes / hardware.store_bytes;
  sum.files += tasks * stage.opened * hardware.open_seconds / cores;
  sum.scheduler += tasks / hardware.starts;
  sum.longest += fixed_seconds(stage, hardware, some_slow) +
                 stage.bytes / std::min(hardware.node_bytes, hardware.store_bytes);
}

std::string limit_of(const Limits& bounds) {
  const std::array<std::pair<double, const char*>, 6> all{{{bounds.cpu, "computing"},
                                                           {bounds.node, "net of the machines"},
                                                           {bounds.store, "file system"},
                                                           {bounds.files, "opening files"},
                                                           {bounds.scheduler, "scheduler"},
                                                           {bounds.longest, "the longest tasks"}}};
  return std::ranges::max_element(all)->second;
}

}  // namespace

FarmTimes play(const FarmLoad& load, const TaskCosts& costs, const FarmHardware& hardware) {
  const auto points = static_cast<double>(load.points);
  const auto routes = static_cast<double>(load.routes), parts = static_cast<double>(load.parts);
  const auto ranges = static_cast<double>(load.ranges);
  const double plan = plan_bytes(load);  // which each task reads
  const double start = costs.start_seconds + costs.listed_seconds * tasks_of(load);
  FarmTimes times;
  Limits bounds;
  const auto add = [&](double& seconds, const Stage& stage) {
    seconds += StageRun(stage, hardware).end();
    const auto tasks = static_cast<double>(stage.tasks);
    times.cpu_seconds += tasks * stage.cpu_seconds;
    times.moved_bytes += tasks * stage.bytes;
    times.opened += tasks * stage.opened;
    add_bounds(bounds, stage, hardware);
  };
  // Adds a task for each part of a scene that is there. It reads its own points, about as much of
  // the nodes around them, and writes the points; another one joins the parts.
  // The batches at the ends of its points are lit whole.
  const double lit = points + (parts - 1) * costs.batch_points;
  const auto add_parts = [&](double& seconds, double point_seconds, double scenes) {
    add(seconds, {.tasks = load.parts,
                  .cpu_seconds = start + lit / parts * point_seconds,
                  .bytes = plan + points / parts * 3 * costs.stored_bytes + costs.edge_bytes,
                  .opened = 4 + scenes * parts});
    add(seconds, {.cpu_seconds = start + parts * costs.join_seconds,
                  .bytes = plan + parts * costs.edge_bytes,
                  .opened = 4 + 2 * parts});
  };

  // Build the scene
  add(times.route, {.tasks = load.routes,
                    .cpu_seconds = start + points / routes * costs.route_seconds,
                    .bytes = plan + points / routes * (costs.source_bytes + costs.row_bytes),
                    .opened = 4});
  add(times.part,
      {.tasks = load.parts,
       .cpu_seconds = start + points / parts * costs.part_seconds,
       .bytes = plan + points / parts * (costs.row_bytes + costs.stored_bytes) + costs.edge_bytes,
       .opened = 4 + 3 * routes});  // the mark of each, its table, its points of one range
  add(times.join, {.cpu_seconds = start + parts * costs.join_seconds,
                   .bytes = plan + parts * costs.edge_bytes,
                   .opened = 4 + 2 * parts + routes});  // and it removes the files of the routes

  // Light and shade it
  if (load.lit) add_parts(times.light, costs.light_seconds, 1);
  for (std::uint64_t wave = 0; wave < load.waves; ++wave)  // with the light of the one before
    add_parts(times.bounce, costs.bounce_seconds, wave == 0 ? 1 : 2);
  add(times.shade, {.tasks = load.ranges,
                    .cpu_seconds = start + points / ranges * costs.shade_seconds,
                    .bytes = plan + points / ranges * (2 * costs.stored_bytes + costs.shade_bytes),
                    .opened = 4 + (load.waves == 0 ? 1 : 2) * parts});
  Stage collect{.cpu_seconds = start, .bytes = plan, .opened = 4 + ranges};
  if (load.collected) {
    collect.cpu_seconds += points * costs.collect_seconds;
    collect.bytes += points * (costs.stored_bytes + 2 * costs.shade_bytes);
    collect.opened += parts + ranges;
  }
  add(times.collect, collect);
  times.limit = limit_of(bounds);
  return times;
}

double plan_bytes(const FarmLoad& load) noexcept {
  return kTaskBytes * tasks_of(load) + kInputBytes * static_cast<double>(load.routes);
}

}  // namespace ptc::bench
