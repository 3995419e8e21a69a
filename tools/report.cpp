// What a run measured, in two forms: facts_of() makes JSON for machines, X_text() and X_line() make
// lines for people. A summary has one line for the result and one for the stages; each further line
// is indented by two blanks and belongs to one option:
//
//   lit.ply: 600 receivers, 0.31 s, 99.10 % cache hits
//     open 0.01 s, shade 0.30 s
//     error: 2 % asked, 1.61 % [1.32, 1.94] measured at 512 pilot ...       --error
//     against rays at the surfels: ...                                      --check
//
// Keys of the JSON are stable: scripts read them. Times are in seconds of wall time unless the key
// says CPU, sizes in bytes, errors as shares of a mean unless they are absolute.
#include "tools/report.h"

#include <algorithm>
#include <numeric>

#include <fmt/format.h>

#include "engine/base/progress_text.h"
#include "format/text.h"
#include "tools/option_text.h"

namespace ptc {

using nlohmann::ordered_json;

namespace {

ordered_json facts_of(const CheckError& error) {
  return {{"occlusion_rms", error.occlusion_rms},
          {"occlusion_bias", error.occlusion_bias},
          {"occlusion_mean", error.occlusion_mean},
          {"occlusion_noise", error.occlusion_noise},
          {"irradiance_rms", error.irradiance_rms},
          {"irradiance_bias", error.irradiance_bias},
          {"irradiance_mean", error.irradiance_mean},
          {"irradiance_noise", error.irradiance_noise},
          {"sky_mean", error.sky_mean},
          {"relative", error.relative()}};
}

ordered_json facts_of(const GatherOptions& gather) {
  return {{"solid_angle", gather.solid_angle},
          {"parallax", gather.parallax},
          {"resolution", gather.resolution},
          {"inflation", gather.inflation}};
}

ordered_json facts_of(const EstimateWorth& worth) {
  return {{"rank", worth.rank},
          {"top_tenth", worth.top_tenth},
          {"bottom_tenth", worth.bottom_tenth},
          {"top_third", worth.top_third},
          {"bottom_third", worth.bottom_third},
          {"rms", worth.rms},
          {"within_twice", worth.within_twice}};
}

ordered_json facts_of(const SurfelTrial& trial) {
  return {{"count", trial.count},
          {"adapts", trial.adapts},
          {"points", trial.points},
          {"bytes", trial.bytes},
          {"measured", facts_of(trial.found.error)},
          {"low", trial.found.low},
          {"high", trial.found.high},
          {"cpu_seconds", trial.cpu_seconds}};
}

/// An error with its bounds: "2.31 % [2.05, 2.60]".
std::string bounded_text(double error, double low, double high) {
  return fmt::format("{:.2f} % [{:.2f}, {:.2f}]", 100 * error, 100 * low, 100 * high);
}

ordered_json facts_of(const EstimateReport& estimate) {
  return {{"pilots", estimate.pilots}, {"cpu_seconds", estimate.cpu_seconds}};
}

std::string worth_line(const char* of, const EstimateWorth& worth) {
  return fmt::format(
      "  estimates of {}: rank correlation {:.2f} with the error, RMS {:.2f} times that of the "
      "error; RMS error {:.2f} times the overall one in the top tenth of estimates, {:.2f} times "
      "in the bottom tenth; {:.1f} % of errors within twice the estimate\n",
      of, worth.rank, worth.rms, worth.top_tenth, worth.bottom_tenth, 100 * worth.within_twice);
}

std::string check_line(const char* against, const CheckError& error) {
  return fmt::format(
      "  against rays at the {}: occlusion RMS error {:.4f}, bias {:+.4f}; irradiance RMS error "
      "{:.2f} %, bias {:+.2f} %; error {:.2f} %\n",
      against, error.occlusion_rms, error.occlusion_bias, 100 * error.irradiance_rms,
      100 * error.irradiance_bias, 100 * error.relative());
}

}  // namespace

ordered_json facts_of(const TuningReport& tuning) {
  return {{"asked", tuning.asked},
          {"met", tuning.met},
          {"setting", tuning.setting},
          {"settings", tuning.settings},
          {"solid_angle", tuning.gather.solid_angle},
          {"parallax", tuning.gather.parallax},
          {"resolution", tuning.gather.resolution},
          {"inflation", tuning.gather.inflation},
          {"receiver_rays", tuning.receiver_rays},
          {"measured", facts_of(tuning.measured)},
          {"low", tuning.low},
          {"high", tuning.high},
          {"pilots", tuning.pilots},
          {"rays", tuning.rays},
          {"shaded", tuning.shaded},
          {"ray_cpu_seconds", tuning.ray_cpu_seconds},
          {"shade_cpu_seconds", tuning.shade_cpu_seconds}};
}

std::string tuning_text(const TuningReport& tuning) {
  const GatherOptions& g = tuning.gather;
  const std::string setting =
      fmt::format("{} sr, {} rad, {} pixels", g.solid_angle, g.parallax, g.resolution);
  const std::string with_bounds = bounded_text(tuning.measured.relative(), tuning.low, tuning.high);
  if (tuning.receiver_rays > 0) {
    return fmt::format(
        "  error: {:.4g} % asked, {} measured at {} pilot receivers, shaded by {} rays "
        "each, which take less time than the gather\n",
        100 * tuning.asked, with_bounds, tuning.pilots, tuning.receiver_rays);
  }
  if (tuning.met) {
    return fmt::format(
        "  error: {:.4g} % asked, {} measured at {} pilot receivers with {} (setting {} of "
        "{})\n",
        100 * tuning.asked, with_bounds, tuning.pilots, setting, tuning.setting + 1,
        tuning.settings);
  }
  // The finest setting is not met when a resample of the pilots in 20 is above what is asked
  // (spec/shading.md#error), even where their own error is below.
  if (tuning.measured.relative() <= tuning.asked) {
    return fmt::format(
        "  error: {:.4g} % asked cannot be confirmed: the finest setting ({}) has {} at {} "
        "pilot receivers, but these scatter so much that more than 1 in 20 resamples of a half of "
        "them are above {:.4g} %\n",
        100 * tuning.asked, setting, with_bounds, tuning.pilots, 100 * tuning.asked);
  }
  return fmt::format(
      "  error: {:.4g} % asked is below the floor: the finest setting ({}) has {} at {} "
      "pilot receivers, whose rays are off by {:.2f} %\n",
      100 * tuning.asked, setting, with_bounds, tuning.pilots,
      100 * tuning.measured.relative_noise());
}

ordered_json container_facts(const Superblock& superblock) {
  const FileHeader& header = superblock.header;
  return {{"format_version", fmt::format("{}.{}", header.major, header.minor)},
          {"points", superblock.points},
          {"nodes", superblock.nodes},
          {"node_groups", superblock.node_groups},
          {"levels", superblock.levels},
          {"bounds", {{"low", superblock.bounds_low}, {"high", superblock.bounds_high}}},
          {"pages", superblock.page_count},
          {"page_size", std::uint64_t{1} << header.page_shift},
          {"bytes", {{"file", superblock.file_bytes}}}};
}

ordered_json facts_of(const BuildSpace& space) {
  return {{"temp_bytes", space.temp_bytes},
          {"temp_free_bytes", space.temp_free_bytes},
          {"output_bytes", space.output_bytes},
          {"output_free_bytes", space.output_free_bytes}};
}

ordered_json facts_of(const SortStatistics& sort) {
  return {
      {"points", sort.points}, {"spilled_bytes", sort.spilled_bytes}, {"buckets", sort.buckets}};
}

ordered_json facts_of(const CacheStatistics& cache) {
  return {{"lookups", cache.lookups},         {"local_hits", cache.local_hits},
          {"shared_hits", cache.shared_hits}, {"misses", cache.misses},
          {"hit_rate", cache.hit_rate()},     {"evictions", cache.evictions},
          {"bytes_read", cache.bytes_read},   {"frames", cache.frames},
          {"peak_frames", cache.peak_frames}, {"wait_seconds", cache.wait_seconds}};
}

ordered_json facts_of(const GatherCounts& counts) {
  return {{"receivers", counts.receivers}, {"cells", counts.cells},
          {"groups", counts.groups},       {"surfel_blocks", counts.surfel_blocks},
          {"clusters", counts.clusters},   {"surfels", counts.surfels},
          {"retests", counts.retests},     {"rays", counts.rays}};
}

ordered_json facts_of(const StageSeconds& seconds) {
  ordered_json json = ordered_json::object();
  for (const auto& [stage, time] : seconds) json[stage] = json.value(stage, 0.0) + time;
  json["total"] = total_seconds(seconds);
  return json;
}

ordered_json facts_of(const CheckReport& check) {
  ordered_json facts{{"receivers", check.receivers},
                     {"rays", check.rays},
                     {"discs", facts_of(check.discs)},
                     {"disc_microseconds", check.disc_microseconds}};
  if (check.estimate) {
    facts["estimate"] = {{"occlusion", facts_of(check.estimate->occlusion)},
                         {"irradiance", facts_of(check.estimate->irradiance)}};
  }
  if (check.reflection) facts["reflection"] = facts_of(*check.reflection);
  if (check.mesh) {
    facts["mesh"] = facts_of(*check.mesh);
    facts["mesh_microseconds"] = check.mesh_microseconds;
  }
  return facts;
}

/// The mean over all receivers of a run of the bound on the change of their occlusion.
double mean_bound(const LightingReport& report) {
  const double sum =
      static_cast<double>(report.damage->stand_ins.bounds) * DamageCounts::kBoundUnit;
  return report.receivers == 0 ? 0 : sum / static_cast<double>(report.receivers);
}

ordered_json damage_facts(const LightingReport& report) {
  const DamageReport& damage = *report.damage;
  ordered_json pages = ordered_json::array();
  for (const auto& [page, why] : damage.pages) pages.push_back({{"page", page}, {"text", why}});
  return {{"pages", pages},
          {"points", damage.points},
          {"node_pages", damage.node_pages},
          {"stand_ins", damage.stand_ins.stand_ins},
          {"receivers", damage.stand_ins.receivers},
          {"max_bound", damage.stand_ins.max_bound},
          {"mean_bound", mean_bound(report)}};
}

std::string damage_text(const LightingReport& report) {
  const DamageReport& damage = *report.damage;
  if (damage.pages.empty()) return "  no page that was needed is damaged\n";
  const std::string& first = damage.pages.begin()->second;
  const std::size_t count = damage.pages.size();
  const std::string pages = count == 1 ? "1 page" : fmt::format("{} pages, the first", count);
  std::string text = fmt::format(
      "  damaged: {}: {}; {} points left out\n"
      "  {} receivers see stand-ins for them: their occlusion changes by at most {:.4f}, the mean "
      "over all receivers by at most {:.6f}\n",
      pages, printable(first), damage.points, damage.stand_ins.receivers,
      damage.stand_ins.max_bound, mean_bound(report));
  if (damage.node_pages > 0) {
    text += fmt::format(
        "  {} of the pages hold nodes, which ptcverify --salvage builds again from the points\n",
        damage.node_pages);
  }
  return text;
}

ordered_json facts_of(const LightingReport& report) {
  ordered_json facts{{"receivers", report.receivers},
                     {"bounces", report.bounces},
                     {"shade_cpu_seconds", report.shade_cpu_seconds},
                     {"bounce_cpu_seconds", report.bounce_cpu_seconds},
                     {"glossy_cpu_seconds", report.glossy_cpu_seconds},
                     {"lamp_cpu_seconds", report.lamp_cpu_seconds},
                     {"settings", facts_of(report.settings)},
                     {"gather", facts_of(report.gather)},
                     {"cache", facts_of(report.cache)}};
  if (report.tuning) facts["tuning"] = facts_of(*report.tuning);
  if (report.mirrors) {
    facts["mirrors"] = {{"rays", report.mirrors->rays},
                        {"noise", report.mirrors->noise},
                        {"met", report.mirrors->met}};
  }
  if (report.estimate) facts["estimate"] = facts_of(*report.estimate);
  if (report.check) facts["check"] = facts_of(*report.check);
  if (report.damage) facts["damage"] = damage_facts(report);
  if (report.exposure) facts["exposure"] = *report.exposure;
  facts["seconds"] = facts_of(report.seconds);
  return facts;
}

ordered_json facts_of(const LightReport& report) {
  return {{"points", report.points},
          {"emitters", report.emitters},
          {"shadow_rays", report.rays},
          {"ray_cpu_seconds", report.ray_cpu_seconds},
          {"sky_cpu_seconds", report.sky_cpu_seconds},
          {"gather", facts_of(report.gather)},
          {"cache", facts_of(report.cache)},
          {"seconds", facts_of(report.seconds)}};
}

ordered_json facts_of(const SurfelChoice& choice) {
  ordered_json facts{{"asked", choice.asked}, {"met", choice.met}};
  facts.update(facts_of(choice.taken));
  facts["trials"] = ordered_json::array();
  for (const SurfelTrial& trial : choice.trials) facts["trials"].push_back(facts_of(trial));
  return facts;
}

std::string choice_text(const SurfelChoice& choice) {
  const BoundedError& found = choice.taken.found;
  return fmt::format(
      "  error: {:.4g} % asked{}, {} measured against the meshes with {} {} surfels, {} trials\n",
      100 * choice.asked,
      choice.met                              ? ""
      : found.error.relative() > choice.asked ? " and not met"
                                              : " and not confirmed",
      bounded_text(found.error.relative(), found.low, found.high), choice.taken.points,
      choice.taken.adapts ? "adapted" : "even", choice.trials.size());
}

ordered_json facts_of(const SimplificationChoice& choice) {
  const auto facts_of_trial = [](const SimplificationTrial& trial) {
    return ordered_json{{"merging", trial.merging},
                        {"rounding", trial.rounding},
                        {"points", trial.points},
                        {"bytes", trial.bytes},
                        {"error", trial.found.error.relative()},
                        {"low", trial.found.low},
                        {"high", trial.found.high},
                        {"light_error", trial.light_error},
                        {"albedo_error", trial.albedo_error}};
  };
  ordered_json facts{{"asked", choice.asked}, {"met", choice.met}};
  facts.update(facts_of_trial(choice.taken));
  facts["trials"] = ordered_json::array();
  for (const SimplificationTrial& trial : choice.trials)
    facts["trials"].push_back(facts_of_trial(trial));
  return facts;
}

std::string choice_text(const SimplificationChoice& choice) {
  const SimplificationTrial& taken = choice.taken;
  return fmt::format(
      "  tolerance: {:.4g} % asked{}, light that arrives {} off, light that leaves {:.2f} %, "
      "albedo {:.2f} %, {} trials\n",
      100 * choice.asked, choice.met ? "" : " and not met",
      bounded_text(taken.found.error.relative(), taken.found.low, taken.found.high),
      100 * taken.light_error, 100 * taken.albedo_error, choice.trials.size());
}

std::string light_text(const std::string& output, const LightReport& report) {
  std::string text =
      fmt::format("{}: {} points, {} shadow rays, {:.2f} s\n{}", output, report.points, report.rays,
                  total_seconds(report.seconds), stages_text(report.seconds));
  if (report.emitters > 0) text += fmt::format("  {} surfels emit light\n", report.emitters / 2);
  return text;
}

std::string shade_text(const std::string& output, const LightingReport& report) {
  std::string text = fmt::format("{}: {} receivers, {:.2f} s, {:.2f} % cache hits\n{}", output,
                                 report.receivers, total_seconds(report.seconds),
                                 100 * report.cache.hit_rate(), stages_text(report.seconds));
  if (report.damage) text += damage_text(report);
  if (report.exposure) text += fmt::format("  shown at {:+.1f} stops\n", *report.exposure);
  if (report.tuning) text += tuning_text(*report.tuning);
  if (const auto& mirrors = report.mirrors) {
    text += fmt::format("  reflections: {:.2f} % measured at pilot receivers with {} rays each\n",
                        100 * mirrors->noise, mirrors->rays);
  }
  if (!report.check) return text;
  text += check_line("surfels", report.check->discs);
  if (const auto& estimate = report.check->estimate) {
    text += worth_line("occlusion", estimate->occlusion) +
            worth_line("irradiance", estimate->irradiance);
  }
  if (const auto& reflection = report.check->reflection) {
    text += fmt::format(
        "  reflections against more rays: occlusion RMS error {:.4f}; radiance RMS error {:.2f} %, "
        "bias {:+.2f} %\n",
        reflection->occlusion_rms, 100 * reflection->irradiance_rms,
        100 * reflection->irradiance_bias);
  }
  if (report.check->mesh) text += check_line("mesh", *report.check->mesh);
  return text;
}

double total_seconds(const StageSeconds& seconds) {
  return std::accumulate(seconds.begin(), seconds.end(), 0.0,
                         [](double sum, const auto& stage) { return sum + stage.second; });
}

std::string bytes_text(std::uint64_t bytes) {
  const std::string count = format_count(static_cast<double>(bytes));
  return count.find(' ') == std::string::npos ? count + " B" : count + "B";
}

std::string stages_text(const StageSeconds& seconds) {
  std::string text;
  for (const auto& [stage, time] : seconds) {
    text += fmt::format("{}{} {:.2f} s", text.empty() ? "  " : ", ", stage, time);
  }
  return text.empty() ? text : text + "\n";
}

Outcome render_files(const RenderRequest& request,
                     const std::vector<std::filesystem::path>& outputs,
                     const std::vector<PictureTarget>& layers, Progress& progress) {
  std::vector<PictureTarget> targets = layers;
  for (const auto& output : outputs) targets.push_back({.path = output});
  const LightingReport report = render_picture(request, targets, progress);
  std::vector<std::string> names;
  for (const PictureTarget& target : targets) names.push_back(target.path.string());
  // Outputs stand behind layers in `targets`; the summary names them first.
  std::vector<std::string> told = names;
  std::ranges::rotate(told, told.begin() + static_cast<std::ptrdiff_t>(layers.size()));
  nlohmann::ordered_json facts{{"outputs", names}};
  std::string subject = join(told, ", ");
  if (request.sequence) {
    const std::size_t frames = request.sequence->frames.count();
    facts["frames"] = frames;
    subject += fmt::format(" ({} frame{})", frames, frames == 1 ? "" : "s");
  }
  facts.update(facts_of(report));
  return {facts, shade_text(subject, report)};
}

}  // namespace ptc
