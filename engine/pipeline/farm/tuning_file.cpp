#include "engine/pipeline/farm/tuning_file.h"

#include <cstdint>
#include <filesystem>
#include <type_traits>
#include <vector>

#include "engine/io/file/state_file.h"

namespace ptc {
namespace {

/// Calls visit(number) for each number of a tuning, in the order of the file.
template <class Tuning, class Visit>
void for_each_number(Tuning& tuning, const Visit& visit) {
  auto& gather = tuning.gather;
  visit(gather.solid_angle);
  visit(gather.parallax);
  visit(gather.inflation);
  visit(gather.resolution);
  visit(tuning.receiver_rays);
  visit(tuning.asked);
  visit(tuning.setting);
  visit(tuning.settings);
  auto& measured = tuning.measured;
  for (auto* error :
       {&measured.occlusion_rms, &measured.occlusion_bias, &measured.occlusion_mean,
        &measured.occlusion_noise, &measured.irradiance_rms, &measured.irradiance_bias,
        &measured.irradiance_mean, &measured.irradiance_noise, &measured.sky_mean})
    visit(*error);
  visit(tuning.low);
  visit(tuning.high);
  visit(tuning.rays);
  visit(tuning.shaded);
  visit(tuning.ray_cpu_seconds);
  visit(tuning.shade_cpu_seconds);
}

std::filesystem::path file_of(const FarmPlan& plan) {
  return plan.output({TaskKind::tune}, 0);
}

}  // namespace

void write_tuning(const FarmPlan& plan, const TuningReport& tuning) {
  StateWriter state;
  state.put(plan.id);
  state.put(static_cast<std::uint8_t>(tuning.met));
  state.put(static_cast<std::uint64_t>(tuning.pilots));
  for_each_number(tuning, [&](const auto& number) { state.put(number); });
  write_shared_state(file_of(plan), state.take());
}

TuningReport read_tuning(const FarmPlan& plan) {
  const std::vector<std::byte> bytes = read_state(file_of(plan));
  StateReader state(bytes, file_of(plan).string(), kStateOffset);
  state.require(state.get<std::uint64_t>() == plan.id, "the settings are those of another plan");
  TuningReport tuning;
  tuning.met = state.get<std::uint8_t>() != 0;
  tuning.pilots = static_cast<std::size_t>(state.get<std::uint64_t>());
  for_each_number(tuning, [&](auto& number) {
    number = state.get<std::remove_reference_t<decltype(number)>>();
  });
  state.end();
  return tuning;
}

}  // namespace ptc
