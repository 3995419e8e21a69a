// ptcinfo: prints what a container holds, from its header, superblock, directory and meta page.
//
//   header      format version, page size, frame (the cube of the Z-curve), uuid
//   superblock  points, nodes, levels, pages, bounds, area, flux, checksum of the contents
//   directory   type and bytes of every page: what points, nodes and channels take
//   meta page   channels, and the texts that the build recorded
//
// No page of points or nodes is read, so the time grows with the directory alone, which takes 32
// bytes for each page.
#include <map>

#include <fmt/format.h>

#include "engine/io/file/file.h"
#include "engine/pipeline/budgets.h"
#include "engine/pipeline/run.h"
#include "engine/pipeline/scene_record.h"
#include "engine/store/commit.h"
#include "engine/store/reader.h"
#include "tools/common.h"
#include "tools/report.h"

namespace {

using nlohmann::ordered_json;

constexpr char kPurpose[] =
    "Prints what a container holds, without reading its points and nodes.\n"
    "The summary has the numbers of points, nodes and pages, the bounds in scene units, the bytes "
    "and the channels. --json adds the record of the build: inputs, lights, camera and settings.";
constexpr char kExamples[] =
    "  # Print a summary\n"
    "  ptcinfo scene.ptcx\n"
    "  # Read one figure in a script\n"
    "  ptcinfo scene.ptcx --json | python3 -c 'import json,sys; "
    "print(json.load(sys.stdin)[\"points\"])'\n";

std::string type_name(ptc::ChannelType type) {
  switch (type) {
    case ptc::ChannelType::u8:
      return "u8";
    case ptc::ChannelType::u16:
      return "u16";
    case ptc::ChannelType::half:
      return "half";
    case ptc::ChannelType::f32:
      return "f32";
  }
  return "unknown";
}

/// Pages of one type: their number, their bytes in the file without headers and padding, and their
/// bytes once decoded.
struct Share {
  std::uint64_t pages = 0;
  std::uint64_t stored_bytes = 0;
  std::uint64_t raw_bytes = 0;
};

std::map<ptc::PageType, Share> shares_of(const ptc::ContainerReader& container) {
  std::map<ptc::PageType, Share> shares;
  for (std::uint32_t page = 0; page < container.page_count(); ++page) {
    const ptc::DirectoryEntry& entry = container.entry(page);
    Share& share = shares[entry.type];
    ++share.pages;
    share.stored_bytes += entry.stored_bytes;
    share.raw_bytes += entry.raw_bytes;
  }
  return shares;
}

/// The codec of a file. A page that compression does not shorten is stored raw whatever the codec,
/// so this is the codec of the first page that was shortened; "raw" when none was.
std::string codec_of(const ptc::ContainerReader& container) {
  for (std::uint32_t page = 0; page < container.page_count(); ++page) {
    if (container.entry(page).stored_bytes == container.entry(page).raw_bytes) continue;
    return container.read_page_header(page).coding.codec == ptc::Codec::lz4 ? "lz4" : "zstd";
  }
  return "raw";
}

ordered_json channels_of(const ptc::Meta& meta) {
  ordered_json channels = ordered_json::array();
  for (const ptc::Channel& channel : meta.channels) {
    channels.push_back({{"name", channel.name},
                        {"type", type_name(channel.type)},
                        {"components", channel.components},
                        {"group", channel.group}});
  }
  return channels;
}

std::string hex(std::span<const std::byte> bytes) {
  std::string text;
  for (const std::byte byte : bytes) text += fmt::format("{:02x}", static_cast<unsigned>(byte));
  return text;
}

ordered_json facts_of(const ptc::ContainerReader& container) {
  using ptc::PageType;
  const ptc::Superblock& superblock = container.superblock();
  std::map<PageType, Share> shares = shares_of(container);
  ordered_json facts{{"file", container.path().string()}};
  facts.update(ptc::container_facts(superblock));
  facts["bytes"]["point_pages"] = shares[PageType::point].stored_bytes;
  facts["bytes"]["node_pages"] = shares[PageType::node].stored_bytes;
  facts["bytes"]["attribute_pages"] = shares[PageType::attribute].stored_bytes;
  facts["decoded_bytes"] = {{"point_pages", shares[PageType::point].raw_bytes},
                            {"node_pages", shares[PageType::node].raw_bytes},
                            {"attribute_pages", shares[PageType::attribute].raw_bytes}};
  facts["page_counts"] = {{"point", shares[PageType::point].pages},
                          {"node", shares[PageType::node].pages},
                          {"attribute", shares[PageType::attribute].pages}};
  facts["codec"] = codec_of(container);
  facts["channels"] = channels_of(container.meta());
  facts["leaf_points"] = superblock.leaf_points;
  facts["points_per_page"] = superblock.points_per_page;
  facts["frame"] = {{"origin", superblock.header.frame.origin},
                    {"edge", superblock.header.frame.edge}};
  facts["area"] = superblock.area;
  facts["flux"] = superblock.flux;
  facts["uuid"] = hex(container.header().uuid);
  facts["content_xxh3"] =
      fmt::format("{:016x}{:016x}", superblock.content_xxh3[1], superblock.content_xxh3[0]);
  facts["writer"] = superblock.writer;
  facts["text"] = container.meta().text;
  return facts;
}

/// Refuses a cap that is too small for the directory of the file and the texts of its meta page,
/// before they are read.
/// @throws LimitError
void require_memory(const std::filesystem::path& path, const ptc::RunOptions& run) {
  // Copies of a page of texts: stored, decoded, as JSON, printed. In print a control character
  // takes six bytes.
  constexpr std::uint64_t kTexts = 16;
  const ptc::InputFile file(path);
  const ptc::Superblock superblock = ptc::read_superblock(file, ptc::read_file_header(file));
  const std::uint64_t texts = kTexts << superblock.header.page_shift;
  ptc::MemoryBudget budget(run.memory_bytes, "this file");
  budget.charge("its record", texts);
  budget.charge("its directory", ptc::ContainerReader::kMaxPageBytes * superblock.page_count);
  budget.require();
}

/// A text from a file, made safe to print: in quotes, without characters that a terminal obeys.
std::string quoted(const ordered_json& text) {
  return text.dump(-1, ' ', true);
}

/// The lines of the summary, from the facts that --json prints.
std::string summary_of(const ordered_json& facts) {
  const auto& low = facts["bounds"]["low"];
  const auto& high = facts["bounds"]["high"];
  const auto bytes = [&](const char* what) {
    return ptc::bytes_text(facts["bytes"][what].get<std::uint64_t>());
  };
  std::string text = fmt::format(
      "{}: PTCX {}, written by {}\n"
      "  points    {} in {} pages of {}\n"
      "  nodes     {} in {} groups on {} levels\n"
      "  bounds    {} {} {} to {} {} {}\n"
      "  bytes     {}: points {}, nodes {}, channels {}; codec {}\n",
      facts["file"].get<std::string>(), facts["format_version"].get<std::string>(),
      quoted(facts["writer"]), facts["points"].dump(), facts["page_counts"]["point"].dump(),
      ptc::bytes_text(facts["page_size"].get<std::uint64_t>()), facts["nodes"].dump(),
      facts["node_groups"].dump(), facts["levels"].dump(), low[0].dump(), low[1].dump(),
      low[2].dump(), high[0].dump(), high[1].dump(), high[2].dump(), bytes("file"),
      bytes("point_pages"), bytes("node_pages"), bytes("attribute_pages"),
      facts["codec"].get<std::string>());
  if (const auto rounding = facts["text"].find(ptc::kRoundingKey);
      rounding != facts["text"].end()) {
    text += fmt::format("  rounded   {}\n", quoted(*rounding));
  }
  for (const auto& channel : facts["channels"]) {
    text += fmt::format("  channel   {}: {} x {}\n", channel["name"].get<std::string>(),
                        channel["components"].dump(), channel["type"].get<std::string>());
  }
  return text;
}

}  // namespace

int main(int argc, char** argv) {
  ptc::Command command("ptcinfo", kPurpose, kExamples);
  std::filesystem::path file;
  command.add_input("FILE", file, {".ptcx"}, "Container to look at")->required();
  return command.run(argc, argv, [&](ptc::Progress&) -> ptc::Outcome {
    require_memory(file, command.run_options());
    const ptc::ContainerReader container(file);
    const ordered_json facts = facts_of(container);
    return {facts, summary_of(facts)};
  });
}
