#include "tools/bench/stability/row.h"

#include <algorithm>
#include <cstdlib>

namespace ptc::bench {

std::vector<Row> all_rows() {
  std::vector<Row> rows;
  for (const auto& some :
       {rows_of_contacts(), rows_of_pixels(), rows_of_walls(), rows_of_motion(), rows_of_inputs()})
    rows.insert(rows.end(), some.begin(), some.end());
  std::ranges::stable_sort(rows, {}, [](const Row& row) { return std::atoi(row.number); });
  return rows;
}

}  // namespace ptc::bench
