#include "engine/octree/node_state.h"

#include <algorithm>
#include <cmath>
#include <type_traits>

namespace ptc {

void save_child(const NodeChild& child, StateWriter& state) {
  state.put(static_cast<std::uint8_t>(child.ref.interior));
  state.put(child.ref.page);
  state.put(child.ref.slot);
  state.put(child.ref.first_point);
  state.put(child.ref.point_count);
  const NodeSummary& node = child.node;
  for (const double value : node.mean) state.put(value);
  for (const double value : {node.radius, node.area, node.thickness}) state.put(value);
  for (const double value : node.facing) state.put(value);
  for (const auto& flux : node.flux) state.put(flux);
  state.put(static_cast<std::uint8_t>(node.emits));
  for (const auto& power : node.power) state.put(power);
  state.put(node.greatest);
  for (const float value : node.cone_axis) state.put(value);
  state.put(node.cone_cos);
}

NodeChild load_child(StateReader& state, const KnowsPage& knows, std::uint64_t points) {
  NodeChild child;
  child.ref.interior = state.get<std::uint8_t>() != 0;
  child.ref.page = state.get<std::uint32_t>();
  child.ref.slot = state.get<std::uint16_t>();
  child.ref.first_point = state.get_count(points);
  child.ref.point_count = state.get<std::uint32_t>();
  state.require(child.ref.interior ? knows(child.ref.page)
                                   : child.ref.point_count <= points - child.ref.first_point,
                "the tree's state refers to a group or to points that do not exist");
  const auto load_number = [&](auto& value) {
    value = state.get<std::remove_reference_t<decltype(value)>>();
    state.require(std::isfinite(value), "a sum in the tree's state is not finite");
  };
  NodeSummary& node = child.node;
  std::ranges::for_each(node.mean, load_number);
  for (double* value : {&node.radius, &node.area, &node.thickness}) load_number(*value);
  std::ranges::for_each(node.facing, load_number);
  for (auto& flux : node.flux) std::ranges::for_each(flux, load_number);
  node.emits = state.get<std::uint8_t>() != 0;
  for (auto& power : node.power) std::ranges::for_each(power, load_number);
  load_number(node.greatest);
  std::ranges::for_each(node.cone_axis, load_number);
  load_number(node.cone_cos);
  return child;
}

}  // namespace ptc
