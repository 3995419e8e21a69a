// What stands where an input of a build lacks a channel that another input has.
//
//   a.las   classification 2 5 2 ...      -->   2 5 2 ...        its no_value is 255 from now on,
//   b.ply   -                             -->   255 255 ...      if no point of a.las has 255
//
// The values of an input are watched while it is measured, so that a value that stands for "not
// known" is never one that a point has. A channel whose points use that value keeps none: what is
// not known is 0 there, and a note says so.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "engine/base/progress.h"
#include "engine/store/reader.h"
#include "format/schema.h"

namespace ptc {

class AttributePlan;

/// Returns the bits that stand for "not known" in channels that are given a no_value: NaN for
/// floats, the least value of integers with a sign, the greatest of those without. Nothing for a
/// type of a later version.
[[nodiscard]] std::optional<std::uint64_t> usual_no_value(const Channel& channel) noexcept;

/// Says whether a ValueWatch looks at a channel: not at floats, whose NaN says of itself that
/// nothing is known, and not where a no_value says so.
[[nodiscard]] bool is_watched(const Channel& channel) noexcept;

/// Watches the values of channels for usual_no_value().
class ValueWatch {
 public:
  explicit ValueWatch(std::span<const Channel> channels);
  /// Looks at the values of some points.
  /// @param rows  of the points, with all channels
  void add(std::span<const std::byte> rows);
  /// Says whether no value that may still come matters.
  [[nodiscard]] bool done() const noexcept { return watched_.empty(); }
  /// For each channel, whether a component of a point has usual_no_value().
  [[nodiscard]] const std::vector<bool>& taken() const noexcept { return taken_; }

 private:
  struct Watched {
    std::size_t channel;  ///< index in taken_
    std::size_t offset;   ///< bytes from the start of a row
    std::size_t bytes;    ///< of a component
    unsigned components;
    std::uint64_t usual;
  };
  std::vector<Watched> watched_;  ///< channels in which the value was not seen so far
  std::vector<bool> taken_;
  std::size_t row_bytes_;
};

/// Reads channels of a container to find out which of them have usual_no_value() among their
/// values. Memory: an attribute page and its rows.
/// @param wanted  for each channel, whether it is looked at
/// @return        as ValueWatch::taken(), false for channels that are not looked at
[[nodiscard]] std::vector<bool> taken_values(const ContainerReader& container,
                                             const std::vector<bool>& wanted);

/// Points that come into a build together.
struct BuildSource {
  std::string name;   ///< for notes
  std::size_t input;  ///< in the plan, or AttributePlan::kNoInput
};

/// Marks the channels that a source lacks, and notes which source lacks which of them. Channels of
/// holds_marks() stay as they are: 0 is true of points without a mark.
void mark_unknown_values(AttributePlan& plan, std::span<const BuildSource> sources,
                         Progress& progress);

}  // namespace ptc
