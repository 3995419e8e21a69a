#include "engine/pipeline/shade/receivers.h"

#include <fmt/format.h>

#include "engine/pipeline/shade/shading_channels.h"

namespace ptc {

std::vector<std::uint8_t> groups_without_shading(const ContainerReader& container) {
  std::vector<std::uint8_t> groups(container.groups().begin(), container.groups().end());
  std::erase_if(
      groups, [&](std::uint8_t group) { return holds_shading(container.meta().channels, group); });
  return groups;
}

std::string settings_text(const ShadeRequest& request, const GatherOptions& g, unsigned rays) {
  std::string text = rays > 0 ? fmt::format("rays {}", rays)
                              : fmt::format("solid_angle {} parallax {} inflation {} resolution {}",
                                            g.solid_angle, g.parallax, g.inflation, g.resolution);
  text += fmt::format(" sides {} lift {}", g.sides == Sides::both ? "both" : "front", request.lift);
  const Surroundings& around = g.around;
  if (around.sphere) text += " sphere";
  if (around.cone < Surroundings{}.cone) text += fmt::format(" cone {}", around.cone);
  if (around.distance < Surroundings{}.distance)
    text += fmt::format(" distance {} falloff {}", around.distance, around.falloff);
  if (request.bounces != 1) text += fmt::format(" bounces {}", request.bounces);
  if (request.estimate) text += " estimates";
  if (request.glossy.roughness) text += fmt::format(" glossy {}", *request.glossy.roughness);
  return text;
}

}  // namespace ptc
