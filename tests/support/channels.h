// The channels of shaded containers and the layers of pictures, and how they differ.
#pragma once

#include <algorithm>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfInputFile.h>
#include <catch2/catch.hpp>
#include <glm/common.hpp>
#include <glm/vec3.hpp>

#include "engine/pipeline/convert/container_source.h"
#include "format/scalar.h"

namespace ptc::test {

/// Values of the channels of up to three halves of a container, by name, with the points' own light
/// and albedo. A channel of one component has it in x.
inline std::map<std::string, std::vector<glm::vec3>> values_of(const std::filesystem::path& path) {
  std::map<std::string, std::vector<glm::vec3>> values;
  const ContainerReader container(path);
  ContainerSource source(container);
  std::vector<Surfel> surfels(1000);
  while (const std::size_t count = source.next(surfels)) {
    const std::byte* value = source.attributes().data();
    for (std::size_t i = 0; i < count; ++i) {
      values["own"].push_back(surfels[i].outgoing());
      values["albedo"].push_back(surfels[i].albedo);
      for (const Channel& channel : source.channels()) {
        glm::vec3 v(0);
        if (channel.type != ChannelType::half || channel.components > 3) {
          value += channel.component_bytes() * channel.components;
          continue;
        }
        for (int k = 0; k < channel.components; ++k, value += 2) {
          std::uint16_t half = 0;
          std::copy_n(value, 2, reinterpret_cast<std::byte*>(&half));
          v[k] = decode_half(half);
        }
        values[channel.name].push_back(v);
      }
    }
  }
  return values;
}

/// The greatest difference of two lists, over the greatest value.
inline double difference(const std::vector<glm::vec3>& a, const std::vector<glm::vec3>& b) {
  REQUIRE(a.size() == b.size());
  double worst = 0, most = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const glm::vec3 d = glm::abs(a[i] - b[i]);
    worst = std::max<double>(worst, std::max({d.x, d.y, d.z}));
    most = std::max<double>(most, std::max({b[i].x, b[i].y, b[i].z}));
  }
  REQUIRE(most > 0);
  return worst / most;
}

/// Reads a layer of a picture. @param layer  empty: the picture itself
inline std::vector<glm::vec3> read_layer(const std::filesystem::path& path,
                                         const std::string& layer) {
  Imf::InputFile file(path.c_str());
  const auto window = file.header().dataWindow();
  const auto width = static_cast<std::size_t>(window.max.x + 1),
             height = static_cast<std::size_t>(window.max.y + 1);
  std::vector<glm::vec3> pixels(width * height, glm::vec3(-1));
  Imf::FrameBuffer frame;
  for (std::size_t k = 0; k < 3; ++k) {
    frame.insert((layer.empty() ? "" : layer + ".") + "RGB"[k],
                 Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(&pixels[0][static_cast<int>(k)]),
                            sizeof(glm::vec3), sizeof(glm::vec3) * width));
  }
  file.setFrameBuffer(frame);
  file.readPixels(0, window.max.y);
  return pixels;
}

}  // namespace ptc::test
