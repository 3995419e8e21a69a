// Attributes of particles by their names.
#include "engine/io/cloud/particle_names.h"

#include <algorithm>
#include <array>
#include <string>

namespace ptc {
namespace {

struct Known {
  std::string_view name;
  std::array<std::string_view, 3> parts;  // of the surfel; only the first for single numbers
};

constexpr std::array kKnown = std::to_array<Known>({
    {"P", {"x", "y", "z"}},
    {"position", {"x", "y", "z"}},
    {"N", {"nx", "ny", "nz"}},
    {"normal", {"nx", "ny", "nz"}},
    {"radius", {"radius"}},
    {"radiusPP", {"radius"}},
    {"pscale", {"radius"}},
    {"Cd", {"red", "green", "blue"}},
    {"_radiosity", {"radiance_r", "radiance_g", "radiance_b"}},
    {"Cs", {"radiance_r", "radiance_g", "radiance_b"}},
    {"Ci", {"radiance_r", "radiance_g", "radiance_b"}},
    {"radiance", {"radiance_r", "radiance_g", "radiance_b"}},
    {"emission", {"emission_r", "emission_g", "emission_b"}},
    {"_emission", {"emission_r", "emission_g", "emission_b"}},
    {"albedo", {"albedo_r", "albedo_g", "albedo_b"}},
    {"_albedo", {"albedo_r", "albedo_g", "albedo_b"}},
});

}  // namespace

void add_attribute(const Channel& attribute, std::size_t offset, std::vector<RecordField>& fields) {
  const auto taken = [&](std::string_view name) {
    return std::ranges::any_of(fields, [&](const auto& f) { return f.channel.name == name; });
  };
  const bool is_float = attribute.type == ChannelType::f32 || attribute.type == ChannelType::f64;
  const auto* const known = std::ranges::find(kKnown, attribute.name, &Known::name);
  const std::size_t parts = known == kKnown.end() ? 0 : known->parts[1].empty() ? 1 : 3;
  if (!is_float || parts != attribute.components || taken(known->parts[0])) {
    // Names of the surfel mean nothing here, except those above.
    fields.push_back({attribute, offset, true});
    return;
  }
  for (std::size_t i = 0; i < parts; ++i) {
    fields.push_back(
        make_field(known->parts[i], attribute.type, offset + i * attribute.component_bytes()));
  }
}

}  // namespace ptc
