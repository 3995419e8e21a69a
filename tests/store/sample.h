// Small containers for tests, and a directory to keep them in.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "engine/store/reader.h"
#include "engine/store/writer.h"
#include "format/point_record.h"
#include "tests/support/temporary_directory.h"

namespace ptc::test {

struct SampleOptions {
  WriterOptions writer{12, Codec::zstd, 1, Uuid{std::byte{7}}};
  std::uint32_t points = 500;
  std::uint32_t leaf_points = 2;
  unsigned attribute_groups = 2;  ///< group g has a half, which may be unknown, and g u8
  std::uint32_t void_every = 0;   ///< each of this many attribute pages of a group is void; 0: none
  std::vector<PageType> later{};  ///< types of skippable pages, ascending
  std::size_t tail_pages =
      2;  ///< at most this many pages lie in the tail in front of the meta page
};

/// The content of a sample, page by page in the order of their numbers. A void page has the payload
/// that readers take for it.
struct Sample {
  struct Page {
    PageSummary facts;
    std::vector<std::byte> payload;
    bool is_void = false;
  };
  std::vector<Page> pages;  ///< the meta page is not among them
  Meta meta;
  Superblock superblock;  ///< as finish() returned it
};

/// Returns points by ascending key, the same ones for the same count.
[[nodiscard]] std::vector<PointRecord> sample_points(std::uint32_t count);

/// Writes a container: random points under a tree with eight children in each group. It is cut by
/// rank, not by place, because the reader does not look at places. Points and nodes emit light when
/// the writer's options say so.
Sample write_sample(const std::filesystem::path& target, const SampleOptions& options);

/// Writes everything that write_sample() writes before it calls finish().
void write_unfinished(ContainerWriter& writer, const SampleOptions& options, Sample& sample);

/// Returns the rule that a bad vector breaks, by its name: "container-page-magic.variant.ptcx"
/// shows spec/container.md#page-magic.
[[nodiscard]] std::string rule_of(const std::filesystem::path& path);

[[nodiscard]] std::vector<std::byte> read_file(const std::filesystem::path& path);
void write_file(const std::filesystem::path& path, std::span<const std::byte> bytes);

/// Opens a container and reads every page.
/// @param parts  whether the pages of its parts are read as well
/// @return the payloads, one after another
[[nodiscard]] std::vector<std::byte> walk(
    const std::filesystem::path& path,
    ContainerReader::OpenParts parts = ContainerReader::OpenParts::yes);

}  // namespace ptc::test
