#include "engine/pipeline/scene_record.h"

#include <cmath>
#include <cstdlib>

namespace ptc {

LightRig recorded_lights(const ContainerReader& container) {
  const auto& text = container.meta().text;
  const auto found = text.find(kLightsKey);
  return found == text.end() ? LightRig{} : light_rig_from_json(found->second);
}

bool lit_by_emitters(const ContainerReader& container) {
  return container.meta().text.contains(kEmittersKey);
}

double surfel_spacing(const ContainerReader& container) {
  const auto& text = container.meta().text;
  if (const auto found = text.find(kSpacingKey); found != text.end()) {
    const double spacing = std::strtod(found->second.c_str(), nullptr);
    if (std::isfinite(spacing) && spacing > 0) return spacing;
  }
  const Superblock& superblock = container.superblock();
  return superblock.points == 0
             ? 0
             : std::sqrt(superblock.area / static_cast<double>(superblock.points));
}

}  // namespace ptc
