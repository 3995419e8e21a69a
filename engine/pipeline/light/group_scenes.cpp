#include "engine/pipeline/light/group_scenes.h"

#include <algorithm>

#include <fmt/format.h>

#include "engine/base/error.h"
#include "engine/pipeline/temporary_container.h"

namespace ptc {

std::vector<std::string> groups_of(const LightingRequest& request, const LightRig& rig,
                                   bool emits) {
  const auto excludes = [](bool given, const char* field) {
    if (!given) return;
    throw RequestError(field, fmt::format("`light_groups` excludes `{}`: ask for it in a run "
                                          "without groups",
                                          field));
  };
  excludes(request.error.has_value(), "error");
  excludes(request.estimate, "estimate");
  excludes(request.glossy.roughness.has_value(), "glossy.roughness");
  excludes(!request.shadows.empty(), "shadows");
  excludes(request.check.receivers > 0, "check");
  excludes(request.tolerate_damage, "tolerate_damage");
  std::vector<std::string> groups = light_groups(rig, emits);
  require_request(std::ranges::any_of(groups, [](const std::string& g) { return !g.empty(); }),
                  "light_groups",
                  "no light of the scene is in a group: name groups where the lights are given");
  return groups;
}

RelitScene::RelitScene(const LightingRequest& request, const LightRig& rig, bool emission,
                       const LightSampling& sampling, const std::filesystem::path& target,
                       StageSeconds& seconds, Progress& progress)
    : path_(temporary_container_path(roomiest_temp_dir(request.run, target))), name_(path_) {
  LightRequest lighting{{.scene = request.scene,
                         .gather = request.gather,
                         .lift = request.lift,
                         .back_end = request.back_end,
                         .run = request.run}};
  lighting.gather.around = {};
  lighting.light_sampling = sampling;
  lighting.lights = rig;
  lighting.emission = emission;
  const LightReport report = light_container(lighting, path_, progress);
  seconds.insert(seconds.end(), report.seconds.begin(), report.seconds.end());
}

void add_costs(LightingReport& report, const LightingReport& group) {
  report.receivers = group.receivers;
  report.bounces = group.bounces;
  report.shade_cpu_seconds += group.shade_cpu_seconds;
  report.bounce_cpu_seconds += group.bounce_cpu_seconds;
  report.glossy_cpu_seconds += group.glossy_cpu_seconds;
  report.lamp_cpu_seconds += group.lamp_cpu_seconds;
  report.gather.add(group.gather);
  report.cache = group.cache;
  for (const auto& [stage, seconds] : group.seconds) {
    const auto known =
        std::ranges::find(report.seconds, stage, [](const auto& s) { return s.first; });
    if (known == report.seconds.end()) {
      report.seconds.emplace_back(stage, seconds);
    } else {
      known->second += seconds;
    }
  }
}

void add_run(LightingReport& report, const LightingReport& run) {
  const std::uint64_t receivers = report.receivers + run.receivers;
  add_costs(report, run);
  report.receivers = receivers;
  report.settings = run.settings;
  if (run.exposure) report.exposure = run.exposure;
  // Tell of the one that is farthest from what was asked
  if (run.tuning && (!report.tuning || report.tuning->met)) report.tuning = run.tuning;
  if (run.mirrors) report.mirrors = run.mirrors;
  if (run.estimate) report.estimate = run.estimate;
  if (run.damage && (!report.damage || report.damage->pages.empty())) report.damage = run.damage;
  if (!run.check || run.check->receivers == 0) return;
  if (!report.check) {
    report.check = run.check;
    return;
  }
  CheckReport& check = *report.check;
  const auto before = static_cast<double>(check.receivers),
             more = static_cast<double>(run.check->receivers);
  check.discs = pooled(check.discs, before, run.check->discs, more);
  if (check.mesh && run.check->mesh)
    check.mesh = pooled(*check.mesh, before, *run.check->mesh, more);
  check.receivers += run.check->receivers;
}

}  // namespace ptc
