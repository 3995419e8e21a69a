#include "engine/pipeline/shade/receivers.h"

#include <algorithm>
#include <utility>

#include <fmt/format.h>

#include "engine/pipeline/shade/shading_channels.h"

namespace ptc {

std::vector<std::uint8_t> groups_without_shading(const ContainerReader& container) {
  std::vector<std::uint8_t> groups(container.groups().begin(), container.groups().end());
  std::erase_if(
      groups, [&](std::uint8_t group) { return holds_shading(container.meta().channels, group); });
  return groups;
}

std::vector<Pilot> pilots_of(const ContainerReader& container, std::uint64_t wanted, float lift) {
  const PilotPlan plan = plan_pilots(wanted, Shader::kBlock);
  const std::uint64_t blocks = (wanted + Shader::kBlock - 1) / Shader::kBlock;
  const std::vector<std::uint8_t> groups = rise_groups(container.meta().channels);
  std::vector<Pilot> pilots;
  std::vector<Surfel> surfels(std::min<std::uint64_t>(Shader::kBlock, wanted));
  std::vector<std::byte> rows;
  for (std::size_t i = 0; i < plan.blocks; ++i) {
    // The middle one of each share of all blocks
    const std::uint64_t number = (2 * i + 1) * blocks / (2 * plan.blocks);
    PointCursor cursor(container, groups, wanted, number * Shader::kBlock);
    std::vector<Receiver> block(cursor.next(surfels, &rows));
    if (block.empty()) continue;
    Lifting(container.header().frame, cursor.channels(), lift)
        .place(std::span(surfels).first(block.size()), rows, block);
    add_pilots(pilots, std::move(block), 0, plan.stretches, 1);
  }
  return pilots;
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
