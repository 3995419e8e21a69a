// The one place where fields of requests (engine/pipeline) meet options: errors of the engine name
// the field in backquotes, the programs print the option.
#include "tools/field_names.h"

#include <algorithm>
#include <array>

namespace ptc {
namespace {

struct FieldName {
  std::string_view field;
  std::string_view option;
};

constexpr std::array kFields{
    FieldName{"append", "--append"},
    FieldName{"backdrop", "--backdrop"},
    FieldName{"one_sided", "--one-sided"},
    FieldName{"bounces", "--bounces"},
    FieldName{"camera", "--camera"},
    FieldName{"camera_name", "--camera-name"},
    FieldName{"check", "--check"},
    FieldName{"check.rays", "--check-rays"},
    FieldName{"checkpoint_points", "--checkpoint"},
    FieldName{"city_points", "--city"},
    FieldName{"channels", "--channels"},
    FieldName{"classes", "--class"},
    FieldName{"colour_from", "--colour-from"},
    FieldName{"count", "--count"},
    FieldName{"crop", "--crop"},
    FieldName{"error", "--error"},
    FieldName{"estimate", "--estimate"},
    FieldName{"eye", "--eye"},
    FieldName{"format", "--format"},
    FieldName{"gather.around.cone", "--cone"},
    FieldName{"gather.around.diagonals", "--preset"},
    FieldName{"gather.around.distance", "--distance"},
    FieldName{"gather.around.falloff", "--falloff"},
    FieldName{"gather.inflation", "--inflation"},
    FieldName{"gather.parallax", "--parallax"},
    FieldName{"gather.resolution", "--resolution"},
    FieldName{"gather.solid_angle", "--solid-angle"},
    FieldName{"glossy.rays", "--glossy-rays"},
    FieldName{"glossy.roughness", "--glossy"},
    FieldName{"level", "--level"},
    FieldName{"lift", "--lift"},
    FieldName{"light_groups", "--light-groups"},
    FieldName{"original_order", "--original-order"},
    FieldName{"page_shift", "--page-size"},
    FieldName{"profile", "--profile"},
    FieldName{"remove_duplicates", "--remove-duplicates"},
    FieldName{"resume", "--resume"},
    FieldName{"run.memory_bytes", "--memory"},
    FieldName{"run.temp_dirs", "--temp"},
    FieldName{"run.threads", "--threads"},
    FieldName{"samples", "--samples"},
    FieldName{"sampling.adapts", "--adapt"},
    FieldName{"sampling.camera", "--camera"},
    FieldName{"sampling.count", "--points"},
    FieldName{"sampling.finest", "--finest"},
    FieldName{"sampling.lights.area_rays", "--area-rays"},
    FieldName{"sampling.pixels_per_surfel", "--pixels-per-surfel"},
    FieldName{"sampling.spacing", "--spacing"},
    FieldName{"selection.every", "--every"},
    FieldName{"sequence.frames", "--frames"},
    FieldName{"sequence.frames_per_second", "--fps"},
    FieldName{"shadows", "--shadow"},
    FieldName{"size", "--size"},
    FieldName{"sky", "--sky"},
    FieldName{"task_memory", "--task-memory"},
    FieldName{"texture.margin", "--margin"},
    FieldName{"tolerance", "--tolerance"},
    FieldName{"tolerate_damage", "--tolerate-damage"},
    FieldName{"tree.leaf_points", "--leaf"},
    FieldName{"tree.levels_per_stream", "--levels-per-stream"},
};

}  // namespace

std::string_view option_of(std::string_view field) noexcept {
  const auto found = std::ranges::find(kFields, field, &FieldName::field);
  return found == kFields.end() ? std::string_view() : found->option;
}

std::string with_options(std::string_view message) {
  std::string text;
  while (!message.empty()) {
    const std::size_t open = message.find('`');
    const std::size_t close = open == message.npos ? open : message.find('`', open + 1);
    if (close == message.npos) break;
    const std::string_view option = option_of(message.substr(open + 1, close - open - 1));
    // Unless the text between them is a field, the second quote may open the next pair.
    const std::size_t end = option.empty() ? close : close + 1;
    text += option.empty() ? message.substr(0, end) : message.substr(0, open);
    text += option;
    message.remove_prefix(end);
  }
  return text.append(message);
}

}  // namespace ptc
