// Surfels that are made patch by patch, by several threads, and come out in order.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/base/executor.h"
#include "engine/base/stream.h"

namespace ptc {

/// The surfels of a patch.
struct SampledPatch {
  std::vector<Surfel> surfels;
  double area = 0;  ///< of the patch
  double owed = 0;  ///< the same, if the patch is too small for a surfel; else 0
};

/// A stream of the surfels of patches, which derived classes make.
class PatchStream : public PointSource {
 public:
  /// @param at_once  patches that are made at the same time, at most; 0: as many as there are
  /// threads
  PatchStream(const Executor& executor, unsigned at_once)
      : executor_(executor),
        // A few for each thread, so that no thread waits long for the others
        patches_of_turn_(at_once == 0 || at_once >= executor.threads()
                             ? std::size_t{4} * executor.threads()
                             : at_once) {}

  std::size_t next(std::span<Surfel> out) final {
    std::size_t filled = 0;
    while (filled < out.size()) {
      if (patch_ == ready_.size() && !fetch()) break;
      const std::vector<Surfel>& from = ready_[patch_].surfels;
      const std::size_t count = std::min(out.size() - filled, from.size() - taken_);
      std::copy_n(from.begin() + static_cast<std::ptrdiff_t>(taken_), count,
                  out.begin() + static_cast<std::ptrdiff_t>(filled));
      filled += count;
      taken_ += count;
      if (taken_ == from.size()) {
        ++patch_;
        taken_ = 0;
      }
    }
    return filled;
  }

 private:
  /// Returns the number of patches.
  [[nodiscard]] virtual std::size_t patches() const = 0;
  /// Makes the surfels of a patch. Threads: may be called concurrently.
  [[nodiscard]] virtual SampledPatch make(std::size_t index) const = 0;

  /// Makes the next patches. @return  false after the last patch
  bool fetch() {
    const std::size_t count = std::min<std::size_t>(patches() - done_, patches_of_turn_);
    if (count == 0) return false;
    ready_.assign(count, {});
    patch_ = 0;
    executor_.for_each(count, [&](std::size_t i, unsigned) { ready_[i] = make(done_ + i); });
    done_ += count;
    // Patches too small for a surfel leave their area to the next one
    for (SampledPatch& patch : ready_) {
      if (patch.surfels.empty()) {
        owed_ += patch.owed;
        continue;
      }
      if (owed_ == 0) continue;
      const auto scale = static_cast<float>(std::sqrt(1 + owed_ / patch.area));
      for (Surfel& surfel : patch.surfels) surfel.radius *= scale;
      owed_ = 0;
    }
    return true;
  }

  const Executor& executor_;
  std::size_t patches_of_turn_;
  std::size_t done_ = 0;             ///< patches made so far
  std::vector<SampledPatch> ready_;  ///< patches that are made and not all handed out
  std::size_t patch_ = 0;            ///< index in ready_ of the one being handed out
  std::size_t taken_ = 0;            ///< surfels of it that were handed out
  double owed_ = 0;                  ///< area of patches without a surfel
};

}  // namespace ptc
