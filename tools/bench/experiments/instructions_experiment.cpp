// The experiment `ptcbench instructions`: the gather on each instruction set that the machine has.
#include <hwy/targets.h>

#include "engine/parallel/thread_pool.h"
#include "engine/shade/reference/brute_force.h"
#include "tools/bench/experiments/experiment.h"
#include "tools/bench/references/methods.h"
#include "tools/bench/references/reference.h"

namespace ptc::bench {
namespace {

constexpr char kInstructionsReading[] =
    "Shading of points of the procedural city, in blocks of neighbours, on each instruction set in "
    "turn: occlusion and irradiance at the default setting, all pages in memory. Errors are root "
    "mean square (RMS) over the mean of rays at the same discs. The difference is the RMS "
    "difference of irradiance from that of the best instruction set, over its mean.";

/// What `ptcbench instructions` measures.
struct InstructionOptions {
  std::uint64_t points = 2'000'000;  ///< points of the city
  std::uint64_t receivers = 20'000;  ///< receivers among these points
  unsigned checked = 300;            ///< receivers whose error is measured
  unsigned reference_rays = 16384;   ///< rays per checked receiver and half of the reference
  unsigned repeats = 5;
};

/// One instruction set.
struct InstructionRow {
  std::string instructions;
  std::uint64_t surfels = 0;
  unsigned threads = 0;
  std::size_t receivers = 0;
  Spread us, wall_us;                            ///< CPU time and wall time per receiver
  double occlusion_rms = 0, irradiance_rms = 0;  ///< against rays
  double difference = 0;                         ///< RMS from the best instruction set
};

const Columns<InstructionRow>& instructions_columns() {
  using R = InstructionRow;
  static const Columns<R> columns{
      {"instructions", {"instructions"}, &R::instructions},
      {"surfels", {"surfels"}, &R::surfels},
      {"threads", {"threads"}, &R::threads},
      {"receivers", {"receivers"}, &R::receivers},
      {"us_per_receiver", {"CPU us/receiver", "{:.1f}"}, &R::us},
      {"wall_us_per_receiver", {"wall us/receiver", "{:.1f}"}, &R::wall_us},
      {"ao_rms", percent("occlusion RMS %"), &R::occlusion_rms},
      {"e_rms", percent("irradiance RMS %"), &R::irradiance_rms},
      {"difference", percent("irradiance difference %", "{:.2g}"), &R::difference}};
  return columns;
}

/// Restricts all gathers to one instruction set during its lifetime.
class OnlyInstructions {
 public:
  explicit OnlyInstructions(std::int64_t target) { choose(target); }
  ~OnlyInstructions() { choose(0); }
  OnlyInstructions(const OnlyInstructions&) = delete;
  OnlyInstructions& operator=(const OnlyInstructions&) = delete;

 private:
  static void choose(std::int64_t target) {
    hwy::SetSupportedTargetsForTest(target);
    hwy::GetChosenTarget().DeInit();
  }
};

Report measure(const InstructionOptions& options, const Bench& bench) {
  // Build the scene, choose receivers, trace the reference
  const ThreadPool executor(bench.run.threads);
  const BenchScene scene(
      {.name = "city"},
      {.points = options.points, .shaded_width = 0, .own_points = options.receivers}, bench.work,
      bench.run, bench.progress);
  const ReceiverSet& set = scene.sets().front();
  const Checked checked = choose_checked(scene, set, options.checked);
  const DiscRays oracle(scene.surfels(), Sides::both, {});
  const Reference reference = make_reference(
      set, checked, {.half = options.reference_rays},
      [&](const Receiver& r, unsigned rays, std::uint64_t seed) {
        return oracle.trace(r, rays, seed);
      },
      executor);
  const ContainerReader& container = scene.container();
  PageCache cache(container, {.memory_bytes = PageCache::bytes_for(container, executor.threads(),
                                                                   container.page_count()),
                              .threads = executor.threads()});
  // Shade on each instruction set in turn
  const std::vector<std::int64_t> targets = hwy::SupportedAndGeneratedTargets();
  std::vector<Costs> costs(targets.size());
  std::vector<std::vector<Shading>> results(targets.size());
  const auto method = make_gather(container, scene.lights().sky, set, checked, {}, cache, executor);
  bench.progress.begin("instruction sets", options.repeats * targets.size(), "runs");
  for (unsigned repeat = 0; repeat < options.repeats; ++repeat) {
    for (std::size_t i = 0; i < targets.size(); ++i) {
      const OnlyInstructions only(targets[i]);
      costs[i].add(method->run());
      results[i] = method->result().checked;
      bench.progress.advance(1);
    }
  }
  bench.progress.end();
  // Compare with the reference and with the best instruction set
  std::vector<InstructionRow> rows;
  for (std::size_t i = 0; i < targets.size(); ++i) {
    const std::vector<float> irradiance = irradiance_of(results[i]);
    rows.push_back(
        {.instructions = hwy::TargetName(targets[i]),
         .surfels = container.superblock().points,
         .threads = executor.threads(),
         .receivers = method->receivers(),
         .us = costs[i].cpu_us(method->receivers()),
         .wall_us = costs[i].wall_us(method->receivers()),
         .occlusion_rms = relative_rms(occlusion_of(results[i]), occlusion_of(reference.mean)),
         .irradiance_rms = relative_rms(irradiance, irradiance_of(reference.mean)),
         .difference = relative_rms(irradiance, irradiance_of(results.front()))});
  }
  return {.name = "instructions",
          .title = "Time per receiver on each instruction set",
          .reading = kInstructionsReading,
          .runs = options.repeats,
          .tables = {tabulate<InstructionRow>({.name = "rows"}, instructions_columns(), rows)}};
}

}  // namespace

Experiment make_instructions_experiment() {
  const auto options = std::make_shared<InstructionOptions>();
  const auto declare = [options](Declaration& d) {
    d.city_points(options->points, "2M", 50'000);
    d.block_receivers(options->receivers, "20k", 8'192);
    d.checked(options->checked, 100);
    d.repeats(options->repeats, 2);
    d.quick(options->reference_rays, 1024);
  };
  return {.name = "instructions",
          .purpose =
              "Time per receiver on each instruction set that the machine has, and how far their "
              "results differ",
          .quick = "A few seconds: 50k points, 8k receivers, 100 of them checked, 2 runs",
          .declare = declare,
          .run = [options](const Bench& bench) { return measure(*options, bench); }};
}

}  // namespace ptc::bench
