// Writes what the LAS reader returns to standard output, for comparison with another reader
// (laz_peer.py): a line of JSON, then for each point its position (3 doubles), albedo (3 floats)
// and row of attributes. Of a file that is refused the rule goes to standard error.
#include <cstdio>
#include <vector>

#include <nlohmann/json.hpp>

#include "engine/base/error.h"
#include "engine/io/cloud/formats.h"

using namespace ptc;

namespace {

template <typename T>
void put(const T* values, std::size_t count) {
  std::fwrite(values, sizeof(T), count, stdout);
}

void print_line(const nlohmann::json& line) {
  std::puts(line.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace).c_str());
}

nlohmann::json describe(const PointFileInfo& info) {
  nlohmann::json line = {{"count", info.count.value_or(0)},
                         {"text", info.text},
                         {"notes", info.notes},
                         {"has_albedo", info.has_albedo}};
  line["channels"] = nlohmann::json::array();
  for (const Channel& channel : info.channels) {
    line["channels"].push_back({{"name", channel.name},
                                {"type", static_cast<int>(channel.type)},
                                {"components", channel.components},
                                {"scale", channel.scale},
                                {"offset", channel.offset}});
  }
  return line;
}

void dump(const char* path) {
  PointFile file = open_las(path);
  print_line(describe(file.info));
  std::vector<Surfel> block(10'000);
  while (const std::size_t count = file.source->next(block)) {
    const auto rows = file.source->attributes();
    const std::size_t row = rows.size() / count;
    for (std::size_t i = 0; i < count; ++i) {
      put(&block[i].position.x, 3);
      put(&block[i].albedo.x, 3);
      put(rows.data() + i * row, row);
    }
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  try {
    dump(argv[1]);
  } catch (const DataError& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
  return 0;
}
