// What every run of an experiment holds: what was asked, where it works, and the rows so far.
#pragma once

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "engine/base/progress.h"
#include "engine/pipeline/run.h"

namespace ptc::bench {

/// Points up to which the tree of a container that was built is built again, to check it.
inline constexpr std::uint64_t kVerifiedWhole = 2'000'000;

/// The base of a run that measures rows of a table. All arguments of the constructor must outlive
/// it.
template <class Options, class Row>
class BenchRun {
 public:
  /// Receives all rows so far, whenever there are more; it may be empty.
  using Report = std::function<void(const std::vector<Row>&)>;

  BenchRun(const Options& options, const std::filesystem::path& work, const RunOptions& run,
           Progress& progress, const Report& report)
      : options_(options), work_(work), run_(run), progress_(progress), report_(report) {}

 protected:
  /// Reports the rows so far.
  void report() const {
    if (report_) report_(rows_);
  }
  /// Says whether the options ask for a panel. @pre Options has `panels`
  [[nodiscard]] bool wants(const std::string& panel) const {
    return std::ranges::find(options_.panels, panel) != options_.panels.end();
  }

  const Options& options_;
  const std::filesystem::path& work_;
  RunOptions run_;
  Progress& progress_;
  std::vector<Row> rows_;

 private:
  const Report& report_;
};

}  // namespace ptc::bench
