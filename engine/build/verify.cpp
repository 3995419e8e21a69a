// Every byte once, in the order of the file; then the tree (engine/build/verify.h).
#include "engine/build/verify.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <exception>
#include <mutex>
#include <numeric>
#include <stdexcept>
#include <vector>

#include "engine/base/executor.h"
#include "engine/build/verify_tree.h"
#include "engine/io/file.h"
#include "engine/store/reader.h"
#include "format/bytes.h"
#include "format/error.h"
#include "format/node_page.h"
#include "format/point_page.h"

namespace ptc {
namespace {

constexpr char kPadding[] = "spec/container.md#padding";
constexpr char kPageKeys[] = "spec/container.md#page-keys";
constexpr char kPageLevel[] = "spec/container.md#page-level";
constexpr char kValues[] = "spec/points.md#attribute-pages";
constexpr char kCopies[] = "spec/container.md#superblock-copies";

constexpr std::uint64_t kBaseBytes = std::uint64_t{32} << 20;  // program, libraries, small buffers
constexpr std::size_t kMostCachedPages = 1024;
constexpr std::size_t kLeastCachedPages = 8;

/// Part of the file that a page's header and payload take.
struct Extent {
  std::uint64_t begin = 0;
  std::uint64_t end = 0;
};

class FileCheck {
 public:
  FileCheck(const std::filesystem::path& path, const VerifyOptions& options)
      : file_(path), container_(path), executor_(options.threads) {
    const std::uint64_t page = std::uint64_t{1} << container_.header().page_shift;
    const std::uint64_t pages = container_.page_count();
    const Superblock& superblock = container_.superblock();
    const std::uint64_t fixed = kBaseBytes + 52 * pages + superblock.node_groups / 8 +
                                3 * page * executor_.threads() + 100 * superblock.leaf_points;
    const std::uint64_t least = fixed + kLeastCachedPages * page;
    if (options.memory_bytes < least) {
      throw std::invalid_argument(
          fmt::format("the memory cap is too small for this file: the least that works is {}M",
                      (least >> 20) + 1));
    }
    cached_pages_ = static_cast<std::size_t>(
        std::min<std::uint64_t>(kMostCachedPages, (options.memory_bytes - fixed) / page));
  }

  VerifyReport run(Progress& progress) {
    check_superblocks();
    progress.begin("check pages", container_.page_count(), "pages");
    check_pages(progress);
    progress.end();
    progress.begin("check tree", container_.superblock().points, "points");
    const TreeCounts tree = verify_tree(container_, cached_pages_, progress);
    progress.end();
    return {.file_bytes = container_.superblock().file_bytes,
            .pages = container_.page_count(),
            .points = container_.superblock().points,
            .nodes = tree.nodes,
            .groups = tree.groups,
            .levels = tree.levels};
  }

 private:
  [[noreturn]] void fail(std::uint64_t offset, const char* clause, const std::string& text) const {
    throw FormatError(offset, clause, text).rebased(0, container_.path().string());
  }

  /// A reader is content with one whole copy; a file without fault has two.
  void check_superblocks() const {
    const std::uint64_t first = file_.size() - 2 * kBlockBytes;
    std::array<Block, 2> copies{};
    for (std::size_t i = 0; i < 2; ++i) {
      const std::uint64_t offset = first + i * kBlockBytes;
      file_.read_at(offset, copies[i]);
      try {
        static_cast<void>(decode_superblock(copies[i], container_.header(), file_.size()));
      } catch (const FormatError& error) {
        throw error.rebased(offset, container_.path().string());
      }
    }
    if (copies[0] != copies[1]) fail(first, kCopies, "the two superblocks differ");
  }

  /// All pages by their place in the file; of several faults the one that comes first is thrown.
  void check_pages(Progress& progress) const {
    std::vector<std::uint32_t> order(container_.page_count());
    std::iota(order.begin(), order.end(), 0U);
    std::ranges::sort(order, {}, [&](std::uint32_t page) { return container_.entry(page).offset; });

    std::vector<std::unique_ptr<PageBuffer>> buffers(executor_.threads());
    std::mutex mutex;
    std::size_t first_fault = order.size();
    std::exception_ptr fault;
    executor_.for_each(order.size(), [&](std::size_t i, unsigned thread) {
      {
        const std::lock_guard lock(mutex);
        if (i > first_fault) return;
      }
      if (!buffers[thread]) buffers[thread] = std::make_unique<PageBuffer>(container_);
      try {
        check_page(order[i], *buffers[thread]);
        const std::uint64_t next = i + 1 < order.size() ? container_.entry(order[i + 1]).offset
                                                        : container_.superblock().directory_offset;
        check_zero({extent(order[i]).end, next});
        progress.advance(1);
      } catch (...) {
        const std::lock_guard lock(mutex);
        if (i >= first_fault) return;
        first_fault = i;
        fault = std::current_exception();
      }
    });
    if (fault) std::rethrow_exception(fault);
    check_zero({kBlockBytes, order.empty() ? kBlockBytes : container_.entry(order[0]).offset});
    check_directory_padding();
  }

  struct PageBuffer {
    explicit PageBuffer(const ContainerReader& container)
        : payload(container.page_payload_limit()) {}
    PageDecoder decoder;
    std::vector<std::byte> payload;
  };

  [[nodiscard]] Extent extent(std::uint32_t page) const {
    const DirectoryEntry& entry = container_.entry(page);
    return {entry.offset, entry.offset + kPageHeaderBytes + entry.stored_bytes};
  }

  /// Directory pages were checked when the file was opened, all but what pads the last.
  void check_directory_padding() const {
    const Superblock& superblock = container_.superblock();
    const std::uint32_t full = directory_entries_per_page(superblock.header);
    const std::uint64_t entries =
        superblock.page_count - (superblock.directory_pages - 1) * std::uint64_t{full};
    const std::uint64_t last =
        superblock.directory_offset +
        (std::uint64_t{superblock.directory_pages - 1} << superblock.header.page_shift);
    check_zero({last + kPageHeaderBytes + entries * kDirectoryEntryBytes,
                superblock.file_bytes - 2 * kBlockBytes});
  }

  void check_zero(Extent gap) const {
    std::array<std::byte, 2 * kBlockBytes> block;
    while (gap.begin < gap.end) {
      const auto part =
          std::span(block).first(std::min<std::uint64_t>(block.size(), gap.end - gap.begin));
      file_.read_at(gap.begin, part);
      const auto found = std::ranges::find_if(part, [](std::byte b) { return b != std::byte{0}; });
      if (found != part.end()) {
        fail(gap.begin + static_cast<std::uint64_t>(found - part.begin()), kPadding,
             "byte between pages is not zero");
      }
      gap.begin += part.size();
    }
  }

  void check_page(std::uint32_t page, PageBuffer& buffer) const {
    const PageHeader header = container_.read_page(page, buffer.payload, buffer.decoder);
    const std::uint64_t offset = container_.entry(page).offset;
    if (header.type == PageType::point) {
      const PointPage points(buffer.payload.data(), header.record_count);
      if (points[0].key.high != header.first_key ||
          points[points.size() - 1].key.high != header.last_key) {
        fail(offset + 32, kPageKeys,
             fmt::format("page {}: keys are not those of its points", page));
      }
    }
    if (header.type == PageType::node) {
      const NodePage nodes(buffer.payload.data(), header.record_count);
      int least = kMaxLevel;
      std::uint64_t first_key = ~std::uint64_t{0}, last_key = 0;
      for (std::uint32_t slot = 0; slot < nodes.size(); ++slot) {
        least = std::min(least, nodes[slot].level());
        first_key = std::min(first_key, nodes[slot].cell().high);
        last_key = std::max(last_key, nodes[slot].cell().high);
      }
      if (least != header.level) {
        fail(offset + 22, kPageLevel,
             fmt::format("page {}: level is not the least of its groups", page));
      }
      if (first_key != header.first_key || last_key != header.last_key) {
        fail(offset + 32, kPageKeys, fmt::format("page {}: keys are not those of its groups", page));
      }
    }
    if (header.type == PageType::attribute) check_values(page, header, buffer.payload.data());
  }

  /// Halves and floats are finite: exponents below the greatest.
  void check_values(std::uint32_t page, const PageHeader& header, const std::byte* column) const {
    const auto check = [&]<class T>(T infinity, std::size_t count, const std::string& name) {
      for (std::size_t i = 0; i < count; ++i) {
        if ((load<T>(column, i * sizeof(T)) & infinity) != infinity) continue;
        fail(container_.entry(page).offset, kValues,
             fmt::format("page {}: {} of point {} is not finite", page, name, i % header.record_count));
      }
    };
    for (const Channel& channel : container_.meta().channels) {
      if (channel.group != header.group) continue;
      const std::size_t count = std::size_t{channel.components} * header.record_count;
      if (channel.type == ChannelType::half) check(std::uint16_t{0x7c00}, count, channel.name);
      if (channel.type == ChannelType::f32) check(std::uint32_t{0x7f800000}, count, channel.name);
      column += count * channel_bytes(channel.type);
    }
  }

  InputFile file_;
  ContainerReader container_;
  Executor executor_;
  std::size_t cached_pages_ = 0;
};

}  // namespace

VerifyReport verify_container(const std::filesystem::path& path, const VerifyOptions& options,
                              Progress& progress) {
  return FileCheck(path, options).run(progress);
}

}  // namespace ptc
