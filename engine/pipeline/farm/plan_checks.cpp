#include "engine/pipeline/farm/plan_checks.h"

#include <algorithm>
#include <set>
#include <string>
#include <system_error>
#include <vector>

#include <fmt/format.h>

#include "engine/base/error.h"
#include "engine/io/file/file.h"
#include "engine/pipeline/build/build_record.h"
#include "engine/pipeline/farm/input_state.h"
#include "engine/pipeline/scene_record.h"

namespace ptc {
namespace {

/// Says whether two paths lead to one file, or to one name of a file that does not exist.
bool same_file(const std::filesystem::path& a, const std::filesystem::path& b) {
  std::error_code absent;
  return std::filesystem::equivalent(a, b, absent) || same_name(a, b);
}

/// Says whether a file lies in a folder or below it. A link counts where it lies and where it
/// leads.
bool lies_in(const std::filesystem::path& file, const std::filesystem::path& folder) {
  const std::filesystem::path top = std::filesystem::weakly_canonical(folder);
  const auto below = [&](const std::filesystem::path& path) {
    return std::mismatch(top.begin(), top.end(), path.begin(), path.end()).first == top.end();
  };
  return below(std::filesystem::weakly_canonical(file)) ||
         below(std::filesystem::weakly_canonical(directory_of(file)));
}

}  // namespace

void check_plan_request(const BuildRequest& request) {
  check_page_shift(request.page_shift);
  require_request(!request.mesh && !request.backdrop, "inputs",
                  "a farm builds clouds and containers: build meshes to a container first");
  require_request(request.append.empty() && !request.resume && !request.moment, "append",
                  "`append`, `resume` and moving scenes are for one machine");
  require_request(request.city_points == 0 || (request.inputs.empty() && !request.original_order),
                  "city_points", "`city_points` excludes files and the order of inputs");
  require_request(!request.lights, "lights",
                  "a farm builds points with the light that they have, and lights them in tasks of "
                  "their own");
}

bool has_control_characters(const std::filesystem::path& path) {
  return std::ranges::any_of(path.string(), [](char c) {
    const auto byte = static_cast<unsigned char>(c);
    return byte < 0x20 || byte == 0x7f;
  });
}

void check_plan_paths(const BuildRequest& request, const FarmPlan& plan) {
  std::vector<std::filesystem::path> named = request.inputs;
  named.push_back(plan.scene);
  named.push_back(plan.file);
  if (plan.shading) named.push_back(plan.shading->target);
  for (const std::filesystem::path& path : named) {
    if (has_control_characters(path))
      throw RequestError("inputs", path.string() + ": a path has no control characters in a farm");
  }
  std::set<std::string> tiles;
  for (std::size_t i = 0; plan.has_tiles() && i < kMaxRanges; ++i)
    tiles.insert(plan.output({TaskKind::shade}, i).filename().string());
  for (const std::filesystem::path& input : request.inputs) {
    for (const std::filesystem::path& file : files_of(input)) {
      const std::string what = file == input ? "an input" : "a part of " + input.string();
      const auto refuse = [&](const std::filesystem::path& target) {
        throw RequestError("inputs", fmt::format("{} would be written over {}, which is {}: choose "
                                                 "another name",
                                                 target.string(), file.string(), what));
      };
      if (same_file(file, plan.scene)) refuse(plan.scene);
      if (same_file(file, plan.file)) refuse(plan.file);
      if (plan.has_tiles()) {
        if (same_file(directory_of(file), directory_of(plan.shading->target)) &&
            tiles.contains(file.filename().string()))
          refuse(file);
      } else if (plan.shading && same_file(file, plan.shading->target)) {
        refuse(plan.shading->target);
      }
      if (lies_in(file, plan.folder())) refuse(plan.folder());
    }
  }
  if (same_file(plan.scene, plan.file))
    throw RequestError("inputs", plan.scene.string() + ": the scene and the plan are one file");
}

}  // namespace ptc
