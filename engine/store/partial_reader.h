// Reads parts of a container in few requests, as over a network (spec/README.md#conformance).
//
//   | header | pages ...            | directory ...   | coarse node pages, meta | A | B |
//                                                  |<----- the first request ------->|
//               page <--- its entry, one of a range of the directory
//
// The first request gets the end of the file: the superblock, the tail and the last entries of the
// directory. What lies deeper takes a request for some entries and one for the pages that they
// name, where neighbours share a request. A node page that an answer holds is loaded with it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <tuple>
#include <vector>

#include "engine/io/file/file.h"
#include "engine/store/page_content.h"
#include "format/codec.h"
#include "format/container.h"
#include "format/node_page.h"
#include "format/point_page.h"
#include "format/schema.h"

namespace ptc {

/// Bytes that are read in ranges: a file, or an object that another machine holds.
class RangeSource {
 public:
  virtual ~RangeSource() = default;
  /// Returns the name that errors begin with.
  [[nodiscard]] virtual std::string name() const = 0;
  /// Returns the length of the source, bytes.
  [[nodiscard]] virtual std::uint64_t size() const = 0;
  /// Fills `out` with the bytes from `offset` on, in one request.
  /// @throws what the source throws when it fails
  virtual void read(std::uint64_t offset, std::span<std::byte> out) = 0;
};

/// A file as a source of ranges.
class FileRanges : public RangeSource {
 public:
  /// @param file  must outlive this
  explicit FileRanges(const InputFile& file) : file_(file) {}
  [[nodiscard]] std::string name() const override { return file_.path().string(); }
  [[nodiscard]] std::uint64_t size() const override { return file_.size(); }
  void read(std::uint64_t offset, std::span<std::byte> out) override { file_.read_at(offset, out); }

 private:
  const InputFile& file_;
};

/// A container of which only parts are read.
///
///     PartialReader scene(source);
///     scene.load({{scene.numbers().nodes()[scene.superblock().root_page]}});
///     use(scene.nodes(scene.superblock().root_page));
///
/// Opening checks the superblock, the meta page and the entries that come with them; loading checks
/// the entry, the header, the checksum and the payload of each page. A reference is checked where
/// it can be: that its page and points exist. That the page has its slot is known once nodes() has
/// returned the page. Every function that reads throws FormatError, whose message begins with the
/// name of the source, and what the source throws.
///
/// Memory: the first request, the entries that were read and the payloads that were loaded.
class PartialReader {
 public:
  static constexpr std::size_t kFirstRequest = std::size_t{256} << 10;  ///< bytes

  /// Opens a container.
  /// @param source  must outlive this
  explicit PartialReader(RangeSource& source);

  [[nodiscard]] const Superblock& superblock() const noexcept { return superblock_; }
  [[nodiscard]] const FileHeader& header() const noexcept { return superblock_.header; }
  [[nodiscard]] const Meta& meta() const noexcept { return meta_; }
  /// Returns the numbers of all pages.
  [[nodiscard]] const PageNumbers& numbers() const noexcept { return numbers_; }

  /// Loads pages that are not loaded yet, and the node pages that come with them. Neighbouring
  /// ranges share a request. A damaged page is refused when it is asked for, not when it comes with
  /// others.
  /// @param pages  page numbers of point, attribute and node pages, in any order
  void load(std::span<const std::uint32_t> pages);
  /// Reads the entries of pages whose entries are not known yet, and those around them.
  /// @param pages  as for load(), which calls this
  void load_entries(std::span<const std::uint32_t> pages);
  /// Returns the least level of the groups on a node page. @pre its entry is known
  [[nodiscard]] int level(std::uint32_t page) const { return entries_.at(page).level; }
  /// Returns the node page of this level on which the group of a cell lies, as far as the known
  /// entries tell: the last one that begins at the cell or before it.
  /// @param key  high half of the cell's low corner
  [[nodiscard]] std::optional<std::uint32_t> known_node_page(int level, std::uint64_t key) const;
  /// Returns how many times so far requests were sent that did not wait for one another.
  [[nodiscard]] unsigned rounds() const noexcept { return rounds_; }
  /// Says whether a page is loaded.
  [[nodiscard]] bool has(std::uint32_t page) const { return pages_.contains(page); }
  /// Forgets a page, to free its memory.
  void forget(std::uint32_t page) { pages_.erase(page); }

  /// Returns the node page of this rank. @pre it is loaded
  [[nodiscard]] NodePage nodes(std::uint32_t rank) const;
  /// Returns the point page of this rank. @pre it is loaded
  [[nodiscard]] PointPage points(std::uint32_t rank) const;
  /// Returns the decoded payload of a page. @pre it is loaded
  [[nodiscard]] std::span<const std::byte> payload(std::uint32_t page) const;

 private:
  struct Loaded {
    std::vector<std::byte> payload;
    std::uint32_t record_count = 0;
  };
  /// A run of bytes of the source, and the pages or entries in it.
  struct Extent {
    std::uint64_t begin = 0, end = 0;
    std::vector<std::uint32_t> pages;
  };

  void open();
  void read_meta();
  void take_entry(std::uint32_t page, const DirectoryEntry& entry);
  void take_entries(std::uint64_t begin, std::span<const std::byte> bytes, std::uint32_t first,
                    std::uint32_t last);
  void take_last_entries();
  void take_whole_pages(std::uint64_t begin, std::span<const std::byte> bytes);
  [[nodiscard]] PageNumbers::Range kind_of(std::uint32_t page) const;
  void check_entry(std::uint32_t page, const DirectoryEntry& entry) const;
  void take_page(std::uint32_t page, std::span<const std::byte> image);
  void count_round(std::span<const Extent> extents);
  [[nodiscard]] static std::vector<Extent> merged(std::vector<Extent> extents, std::uint64_t gap);
  [[nodiscard]] std::span<const std::byte> bytes_of(const Extent& extent,
                                                    std::vector<std::byte>& buffer);

  RangeSource& source_;
  unsigned rounds_ = 1;
  std::vector<std::byte> end_;  ///< the first request: the end of the source
  Superblock superblock_;
  PageNumbers numbers_;
  Meta meta_;
  GroupColumns columns_;
  PageDecoder decoder_;
  std::map<std::uint32_t, DirectoryEntry> entries_;  ///< by page
  /// Node pages whose entries are known: their level, first key and number.
  std::set<std::tuple<int, std::uint64_t, std::uint32_t>> nodes_by_key_;
  std::map<std::uint64_t, std::uint32_t> nodes_by_offset_;  ///< the same pages
  std::map<std::uint32_t, Loaded> pages_;
};

}  // namespace ptc
