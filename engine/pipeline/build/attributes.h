// The channels of a build's inputs, on their way from rows of attributes to attribute pages.
//
// Inputs differ in what they record of a point. The plan joins their channels and says where each
// value of a row goes. Values that an input does not have are "not known": they are the channel's
// no_value, or 0 in a channel without one (unknown_values.h).
//
//   input 0: intensity | class           ->                    group 2             group 3
//   input 1: class | time | intensity    ->   intensity | class | returns | ...   time | ...
//
// The values of a group travel in records of their own, in the place of a point's light:
//
//   PointRecord   key | radius normal radiance albedo flags emission
//   its values    key | values of the group's channels ..............   at most kGroupBytes
//
// Each group has an external sort. A sort keeps records with equal keys in the order in which they
// came, so all groups leave their sorts in the order of the points, and no index joins them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "engine/base/executor.h"
#include "engine/base/stream.h"
#include "engine/sort/external_sort.h"
#include "engine/sort/record_values.h"
#include "engine/store/reader.h"
#include "engine/store/writer.h"
#include "format/point_record.h"
#include "format/schema.h"

namespace ptc {

/// The greatest size of the values of a point in one group, bytes: what a PointRecord holds behind
/// its key.
inline constexpr std::size_t kGroupBytes = kRecordValueBytes;
/// The first group of channels that come from inputs; group 1 is for channels of shading.
inline constexpr std::uint8_t kFirstInputGroup = 2;
/// The name of the channel that holds the place of each point in its input.
inline constexpr const char* kOriginalIndex = "original_index";

/// Says whether two channels are the same in all but their group.
[[nodiscard]] bool same_but_for_group(Channel a, const Channel& b);

/// The channels of all inputs together, and the way of each input's values to them.
class AttributePlan {
 public:
  /// Stands for an input without channels.
  static constexpr std::size_t kNoInput = ~std::size_t{0};

  /// Adds the channels of the next input.
  ///
  /// A channel that an earlier input has, too, of the same type, meaning and unit, is the same
  /// channel. If only one of the two has a no_value, they are the same channel when that is
  /// usual_no_value() and the points of the other do not have this value. A name that stands for
  /// another kind of channel gets a number at its end, and so does that of a channel of shading
  /// unless the input has all of them (have_shading()). A channel of more than kGroupBytes becomes
  /// several, NAME_0, NAME_1 and so on.
  /// @param channels  in the order of a row; their groups mean nothing
  /// @param taken     for each channel, whether a point of the input has usual_no_value() in it;
  ///                  empty: no point has
  /// @return the number of the input, counted from 0
  std::size_t add_input(std::span<const Channel> channels, const std::vector<bool>& taken = {});
  /// Adds the channel kOriginalIndex, a u64. fill() counts the points of inputs that lack it.
  void add_original_index();

  /// The channels of the container, by group from kFirstInputGroup on.
  [[nodiscard]] const std::vector<Channel>& channels() const noexcept { return channels_; }
  /// Says whether an input has a channel, or fill() makes its values.
  /// @param input    as for fill()
  /// @param channel  index in channels()
  [[nodiscard]] bool has(std::size_t input, std::size_t channel) const;
  /// Gives a channel without a no_value the usual one, if no point of an input has this value.
  /// @return whether the channel has a no_value now
  bool mark_unknown(std::size_t channel);
  /// The number of groups.
  [[nodiscard]] std::size_t groups() const noexcept { return group_bytes_.size(); }
  /// Bytes of a row of an input.
  [[nodiscard]] std::size_t row_bytes(std::size_t input) const { return inputs_[input].row_bytes; }
  /// Bytes of the values of a point in a group.
  /// @param group  counted from 0
  [[nodiscard]] std::size_t group_bytes(std::size_t group) const { return group_bytes_[group]; }

  /// Fills the values of points in one group.
  /// @param input    number of the input in the order of add_input(); its number is kNoInput for
  ///                 points of which nothing is known
  /// @param rows     of its points, row_bytes(input) each
  /// @param first    number of the first of these points among those of all inputs
  /// @param group    counted from 0
  /// @param records  one for each point; they keep their keys
  void fill(std::size_t input, std::span<const std::byte> rows, std::uint64_t first,
            std::size_t group, std::span<PointRecord> records) const;

 private:
  /// Where a run of bytes of a row goes.
  struct Piece {
    std::size_t from;   ///< offset in the row
    std::size_t group;  ///< counted from 0
    std::size_t to;     ///< offset among the group's values
    std::size_t bytes;
  };
  struct Input {
    std::vector<std::size_t> channels;  ///< indices in channels_
    std::vector<Piece> pieces;
    std::size_t row_bytes = 0;
    bool indexed = false;  ///< the input itself says where its points were
    bool shaded = false;   ///< the input has all channels of an earlier shading
  };
  struct Place {
    std::size_t group, offset;
  };

  [[nodiscard]] std::size_t join(const Channel& channel, bool taken, const Input& input);
  [[nodiscard]] std::size_t add_channel(Channel channel, bool taken);
  void set_no_value(std::size_t channel, std::uint64_t bits);

  std::vector<Channel> channels_;         ///< by group
  std::vector<Place> places_;             ///< of each channel
  std::vector<bool> taken_;               ///< for each channel: a point has usual_no_value()
  std::vector<std::size_t> group_bytes_;  ///< bytes of a point in each group
  std::vector<std::byte> unknown_;        ///< kGroupBytes for each group
  std::vector<Input> inputs_;
  std::optional<std::size_t> index_;  ///< the channel kOriginalIndex
};

/// The external sorts of all groups of a plan.
class AttributeSorts {
 public:
  /// @param options   of each sort: its share of the memory, its directories and the points
  ///                  expected
  /// @param kept      names of the temporary files of all sorts, as many for each; empty: they have
  ///                  none
  /// @param executor  must outlive this
  /// @param sample    keys, as for ExternalSorter
  AttributeSorts(const AttributePlan& plan, SortOptions options,
                 std::span<const std::filesystem::path> kept, const Executor& executor,
                 std::span<const MortonKey> sample);
  /// Resumes from the kept files of earlier sorts.
  /// @param options  of each sort
  /// @param state    what keep() wrote, read to its end
  /// @throws as ExternalSorter
  AttributeSorts(const SortOptions& options, const Executor& executor, StateReader& state);

  /// Adds the values of points, as AttributePlan::fill() makes them.
  /// @param points  their records, whose keys are used
  void add(const AttributePlan& plan, std::span<const PointRecord> points, std::size_t input,
           std::span<const std::byte> rows, std::uint64_t first);
  /// Adds values of one group, as AttributePlan::fill() made them.
  void add(std::size_t group, std::span<const PointRecord> values) { sorts_[group]->add(values); }
  /// Number of groups.
  [[nodiscard]] std::size_t size() const noexcept { return sorts_.size(); }
  /// Bytes of temporary files that the expected points take.
  [[nodiscard]] std::uint64_t expected_spill() const noexcept;
  /// The digests of all values so far, one for each group.
  [[nodiscard]] std::vector<RecordsDigest> digest() const;
  /// Spills everything to the kept files and writes what another process needs to resume.
  void keep(StateWriter& state);
  /// Returns the sorted values of a group, a stream of records whose keys are those of the points.
  [[nodiscard]] std::unique_ptr<PointStream> finish(std::size_t group) {
    return sorts_[group]->finish();
  }

 private:
  const Executor* executor_;
  std::vector<std::unique_ptr<ExternalSorter>> sorts_;
  std::vector<PointRecord> block_;  ///< kept between calls of add()
};

/// Writes the attribute pages of a group.
/// @param values    of all points, by ascending key
/// @param channels  of the file, by group; those of `group` take at most kGroupBytes a point
void write_attribute_pages(PointStream& values, std::uint8_t group,
                           std::span<const Channel> channels, std::uint64_t points,
                           ContainerWriter& writer);

/// Makes the plan again by which the channels of a container came about.
/// @param scene     channels of the container that points were appended to; null: there was none
/// @param channels  of the container
[[nodiscard]] AttributePlan plan_of(const std::vector<Channel>* scene,
                                    std::span<const Channel> channels);

/// Yields the values of one group of a plan for the points of a container, by ascending key.
/// Memory: a point page and its attribute pages.
/// @param container  must outlive the result; its channels are input 0 of the plan
[[nodiscard]] std::unique_ptr<PointStream> container_attributes(const ContainerReader& container,
                                                                const AttributePlan& plan,
                                                                std::size_t group);

}  // namespace ptc
