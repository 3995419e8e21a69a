#include "tools/bench/stability/row.h"

#include <algorithm>
#include <cstdlib>

namespace ptc::bench {

void Field::add(std::span<const Shading> shadings, glm::vec3 (*value)(const Shading&)) {
  for (const Shading& shading : shadings) ours.push_back(value(shading));
  height += static_cast<unsigned>(shadings.size()) / width;
}

std::vector<Row> all_rows() {
  std::vector<Row> rows;
  for (const auto& some : {rows_of_contacts(), rows_of_pixels(), rows_of_walls(), rows_of_motion(),
                           rows_of_pictures(), rows_of_seams(), rows_of_inputs()})
    rows.insert(rows.end(), some.begin(), some.end());
  std::ranges::stable_sort(rows, {}, [](const Row& row) { return std::atoi(row.number); });
  return rows;
}

}  // namespace ptc::bench
