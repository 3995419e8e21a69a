#include "tools/bench/experiments/accuracy_report.h"

#include <cmath>

#include <fmt/format.h>

#include "tools/bench/experiments/accuracy_chart.h"
#include "tools/bench/report/report_files.h"

namespace ptc::bench {
namespace {

using Json = nlohmann::ordered_json;

Json facts_of(const AccuracyRow& row) {
  Json facts{{"scene", row.scene},
             {"set", row.set},
             {"job", name_of(row.job)},
             {"method", row.method},
             {"setting", row.setting},
             {"receivers", row.receivers},
             {"us_per_receiver", number(row.us_per_receiver.median)},
             {"us_low", number(row.us_per_receiver.low)},
             {"us_high", number(row.us_per_receiver.high)},
             {"ao_rms", number(row.occlusion.rms)},
             {"e_rms", number(row.irradiance.rms)},
             {"bias", number(row.error().bias)},
             {"p99", number(row.error().percentile_99)},
             {"flip", number(row.flip)},
             {"ao_rms_mesh", number(row.occlusion_rms_mesh)},
             {"e_rms_mesh", number(row.irradiance_rms_mesh)},
             {"speedup_discs", number(row.speedup_discs)},
             {"speedup_mesh", number(row.speedup_mesh)}};
  const auto each = [&](std::uint64_t count) {
    return row.counts.receivers > 0 ? Json(static_cast<double>(count) / 1000) : Json(nullptr);
  };
  facts["groups"] = each(row.counts.groups);
  facts["surfel_blocks"] = each(row.counts.surfel_blocks);
  facts["clusters"] = each(row.counts.clusters);
  facts["surfels"] = each(row.counts.surfels);
  facts["retests"] = each(row.counts.retests);
  return facts;
}

Json facts_of(const ReferenceNote& note, const SceneAccuracy& scene) {
  return {{"scene", note.scene},
          {"set", note.set},
          {"surfels", scene.surfels},
          {"triangles", scene.triangles},
          {"receivers", note.receivers},
          {"rays", note.rays},
          {"ao_mean", number(note.occlusion_mean)},
          {"e_mean", number(note.irradiance_mean)},
          {"ao_noise", number(note.occlusion_noise)},
          {"e_noise", number(note.irradiance_noise)},
          {"ao_floor", number(note.occlusion_floor)},
          {"e_floor", number(note.irradiance_floor)}};
}

}  // namespace

nlohmann::ordered_json facts_of(const std::vector<SceneAccuracy>& scenes) {
  Json rows = Json::array(), references = Json::array();
  for (const SceneAccuracy& scene : scenes) {
    for (const AccuracyRow& row : scene.rows) rows.push_back(facts_of(row));
    for (const ReferenceNote& note : scene.references) references.push_back(facts_of(note, scene));
  }
  return {{"rows", rows}, {"references", references}};
}

void write_reports(const std::filesystem::path& directory,
                   const std::vector<SceneAccuracy>& scenes) {
  const Json facts = facts_of(scenes);
  write_tables(directory / "accuracy", facts);
  for (const SceneAccuracy& scene : scenes)
    write_figures(directory / ("accuracy-" + scene.name()), chart_of(scene));
  write_figures(directory / "accuracy", chart_of(scenes));
}

std::string accuracy_text(const std::vector<SceneAccuracy>& scenes) {
  std::string text = fmt::format(
      "{:<10} {:<7} {:<10} {:<32} {:>9} {:>8} {:>8} {:>8} {:>8} {:>8} {:>8}\n", "scene", "set",
      "job", "setting", "us", "RMS %", "bias %", "p99 %", "FLIP", "x discs", "x mesh");
  for (const SceneAccuracy& scene : scenes) {
    for (const AccuracyRow& row : scene.rows) {
      const ErrorStatistics& e = row.error();
      text += fmt::format(
          "{:<10} {:<7} {:<10} {:<32} {:>9.1f} {:>8.2f} {:>+8.2f} {:>8.1f} {:>8} {:>8} {:>8}\n",
          row.scene, row.set, name_of(row.job),
          row.method == "ptcx" ? row.setting : row.method + ", " + row.setting,
          row.us_per_receiver.median, 100 * e.rms, 100 * e.bias, 100 * e.percentile_99,
          or_dash(row.flip, "{:.4f}"), or_dash(row.speedup_discs, "{:.1f}x"),
          or_dash(row.speedup_mesh, "{:.1f}x"));
    }
    for (const ReferenceNote& note : scene.references) text += note_text(note, scene) + "\n";
  }
  return text;
}

}  // namespace ptc::bench
