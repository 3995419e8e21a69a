// ptcinfo: prints what a container holds, from its header, superblock, directory and meta page; or
// what the header of a cloud says.
//
//   header      format version, page size, frame (the cube of the Z-curve), uuid
//   superblock  points, nodes, levels, pages, bounds, area, flux, checksum of the contents
//   directory   type and bytes of every page: what points, nodes and channels take
//   meta page   channels, and the texts that the build recorded
//
// No page of points or nodes is read, so the time grows with the directory alone, which takes 40
// bytes for each page.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <map>
#include <span>

#include <fmt/format.h>

#include "engine/base/error.h"
#include "engine/io/cloud/points.h"
#include "engine/io/file/file.h"
#include "engine/io/file/remote_file.h"
#include "engine/octree/rounding.h"
#include "engine/parallel/thread_pool.h"
#include "engine/pipeline/budgets.h"
#include "engine/pipeline/convert/convert.h"
#include "engine/pipeline/render/thumbnail.h"
#include "engine/pipeline/run.h"
#include "engine/pipeline/scene_record.h"
#include "engine/store/commit.h"
#include "engine/store/reader.h"
#include "format/point_page.h"
#include "tools/common.h"
#include "tools/inputs.h"
#include "tools/option_text.h"
#include "tools/options.h"
#include "tools/report.h"
#include "tools/why.h"

namespace {

using nlohmann::ordered_json;

constexpr char kPurpose[] =
    "Prints what a container or a cloud holds. Its points and nodes are not read, but for --why "
    "and --thumbnail.\n"
    "The summary has the numbers of points, nodes and pages, the bounds in scene units, the bytes, "
    "the channels, and the inputs and lights of the build. --json has these in full, with the "
    "camera and all settings. Of a cloud the summary has what its header states: the format, the "
    "number of points, the bounds of LAS, the coordinate system and what is recorded of each "
    "point.";
constexpr char kExamples[] =
    "  # Print a summary\n"
    "  ptcinfo scene.ptcx\n"
    "  # Look at a scan before it is built\n"
    "  ptcinfo scan.laz\n"
    "  # Tell what a point takes, and why\n"
    "  ptcinfo scene.ptcx --why\n"
    "  # Draw a small picture of a container\n"
    "  ptcinfo scene.ptcx --thumbnail scene.png\n"
    "  # Read one figure in a script\n"
    "  ptcinfo scene.ptcx --json | python3 -c 'import json,sys; "
    "print(json.load(sys.stdin)[\"points\"])'\n";

// The names of spec/points.md#schema, by their values.
constexpr std::array kTypes{"",    "u8", "u16", "half", "f32", "u32",
                            "u64", "i8", "i16", "i32",  "i64", "f64"};
constexpr std::array kRoles{"value", "colour", "direction", "vector", "label", "index", "time"};
constexpr std::array kColourSpaces{"none", "rec709", "srgb", "acescg"};

/// Returns the name of a value, or the value itself where a later version defines it.
template <class Value>
ordered_json name_or_number(Value value, std::span<const char* const> names) {
  const auto number = static_cast<std::size_t>(value);
  if (number < names.size()) return names[number];
  return number;
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

ordered_json channels_of(std::span<const ptc::Channel> all) {
  ordered_json channels = ordered_json::array();
  for (const ptc::Channel& channel : all) {
    ordered_json facts{{"name", channel.name},
                       {"type", name_or_number(channel.type, kTypes)},
                       {"components", channel.components},
                       {"group", channel.group},
                       {"role", name_or_number(channel.role, kRoles)}};
    if (channel.colour_space != ptc::ColourSpace::none)
      facts["colour_space"] = name_or_number(channel.colour_space, kColourSpaces);
    if (!channel.unit.empty()) facts["unit"] = channel.unit;
    if (channel.no_value) facts["no_value"] = *channel.no_value;
    if (channel.scale != 1 || channel.offset != 0) {
      facts["scale"] = channel.scale;
      facts["offset"] = channel.offset;
    }
    channels.push_back(std::move(facts));
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
  if (!container.parts().empty()) {
    ordered_json& parts = facts["parts"] = ordered_json::array();
    for (const auto& part : container.parts()) {
      parts.push_back({{"file", part->path().string()},
                       {"points", part->superblock().points},
                       {"bytes", part->superblock().file_bytes}});
    }
  }
  facts["codec"] = codec_of(container);
  facts["channels"] = channels_of(container.meta().channels);
  facts["leaf_points"] = superblock.leaf_points;
  facts["points_per_page"] = ptc::points_per_page(container.header());
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
  if (file.is_remote()) budget.charge(ptc::RemoteFile::kMemory, ptc::RemoteFile::kMemoryBytes);
  budget.charge("its directory", ptc::ContainerReader::kMaxPageBytes * superblock.page_count);
  budget.require();
}

/// A text from a file, made safe to print: in quotes, without characters that a terminal obeys.
std::string quoted(const ordered_json& text) {
  return text.dump(-1, ' ', true);
}

/// A corner of a box, with as many digits as tell a ten-millionth of its longest edge.
std::string corner_text(const ordered_json& corner, double longest) {
  std::string text;
  for (const auto& coordinate : corner) {
    const auto value = coordinate.get<double>();
    const auto places = [](double number) { return std::floor(std::log10(std::abs(number))); };
    const double digits = value == 0 || longest == 0 || std::isinf(longest)
                              ? 17
                              : places(value) - places(longest) + 7;
    text += text.empty() ? "" : " ";
    text +=
        digits < 1 ? "0" : fmt::format("{:.{}g}", value, static_cast<int>(std::min(digits, 17.0)));
  }
  return text;
}

/// The bounds in scene units: "-1 0 -1 to 1 2.5 1".
std::string bounds_text(const ordered_json& bounds) {
  double longest = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    longest =
        std::max(longest, bounds["high"][axis].get<double>() - bounds["low"][axis].get<double>());
  }
  return corner_text(bounds["low"], longest) + " to " + corner_text(bounds["high"], longest);
}

/// A number with its noun: "1 sun", "2 suns".
std::string counted(std::size_t count, const char* what) {
  return fmt::format("{} {}{}", count, what, count == 1 ? "" : "s");
}

/// The lights of the record: "1 sun, 0 point lights, 0 spot lights, a sky; in groups: key rest".
std::string lights_text(const ordered_json& record, bool emitters) {
  try {
    const ptc::LightRig rig = ptc::light_rig_from_json(record.get<std::string>());
    std::string text = counted(rig.suns.size(), "sun") + ", " +
                       counted(rig.points.size(), "point light") + ", " +
                       counted(rig.spots.size(), "spot light");
    if (!rig.sky.map_path.empty()) {
      text += ", the sky of " + quoted(ordered_json(rig.sky.map_path));
    } else {
      text += rig.sky.radiance == glm::vec3(0) ? ", no sky" : ", a sky";
    }
    if (emitters) text += ", and materials that emit";
    const std::vector<std::string> groups = ptc::light_groups(rig, emitters);
    if (std::ranges::all_of(groups, &std::string::empty)) return text;
    text += "; in groups:";
    for (const std::string& group : groups) text += ' ' + (group.empty() ? ptc::kRestGroup : group);
    return text;
  } catch (const ptc::DataError&) {
    return "the record cannot be read: " + quoted(record);
  }
}

/// Lines on what the build recorded: inputs, spacing, lights and rounding, as far as it did.
std::string record_text(const ordered_json& record) {
  std::string text;
  if (const auto inputs = record.find(ptc::kInputsKey); inputs != record.end()) {
    constexpr std::size_t kMaxLetters = 200;
    const std::string names = quoted(*inputs);
    text += "  inputs    " +
            (names.size() <= kMaxLetters
                 ? names
                 : names.substr(0, names.rfind(' ', kMaxLetters)) + " ...\"; all with --json") +
            "\n";
  }
  if (const auto spacing = record.find(ptc::kSpacingKey); spacing != record.end()) {
    const double length = std::strtod(spacing->get<std::string>().c_str(), nullptr);
    text += fmt::format("  spacing   {:.4g} scene units between surfels of meshes\n", length);
  }
  if (const auto crs = record.find("crs"); crs != record.end()) {
    // The name is the first text in quotes of a WKT; "EPSG:n" has none
    const std::string all = crs->get<std::string>();
    const std::size_t from = all.find('"'), to = all.find('"', from + 1);
    const bool is_wkt = from != std::string::npos && to != std::string::npos;
    text += "  crs       " +
            quoted(ordered_json(is_wkt ? all.substr(from + 1, to - from - 1) : all)) + "\n";
  }
  const auto unit = record.find("metres_per_unit"), up = record.find(ptc::kUpKey);
  if (unit != record.end()) text += "  unit      " + unit->get<std::string>() + " m\n";
  if (up != record.end()) text += "  up        " + up->get<std::string>() + "\n";
  if (const auto time = record.find("time"); time != record.end())
    text += "  time      " + time->get<std::string>() + " s\n";
  if (const auto lights = record.find(ptc::kLightsKey); lights != record.end()) {
    text += "  lights    " + lights_text(*lights, record.contains(ptc::kEmittersKey)) + "\n";
  }
  if (const auto rounding = record.find(ptc::kRoundingKey); rounding != record.end()) {
    text += "  rounded   " +
            (*rounding == ptc::rounding_text()
                 ? "position by at most 0.001 of the point's radius, the radius by 1/512 of it, "
                   "normals by 0.0021 rad, radiance by 1/256 of it"
                 : quoted(*rounding)) +
            "\n";
  }
  return text;
}

/// What the values of a channel are, beyond their type: ", label" or ", colour, srgb, W/m^2".
std::string meaning_of(const ordered_json& channel) {
  std::string text;
  const ordered_json& role = channel["role"];
  if (!role.is_string() || role != "value")
    text += ", " + (role.is_string() ? role.get<std::string>() : "role " + role.dump());
  for (const char* key : {"colour_space", "unit"}) {
    const auto found = channel.find(key);
    if (found == channel.end() || *found == "1") continue;
    text += ", " + (found->is_string() ? found->get<std::string>() : key + (" " + found->dump()));
  }
  if (const auto scale = channel.find("scale"); scale != channel.end()) {
    text += fmt::format(", v means {:.6g} v", scale->get<double>());
    if (const double offset = channel["offset"].get<double>(); offset != 0)
      text += fmt::format(" {} {:.6g}", offset < 0 ? '-' : '+', std::abs(offset));
  }
  if (const auto none = channel.find("no_value"); none != channel.end())
    text += fmt::format(", {:#x} for not known", none->get<std::uint64_t>());
  return text;
}

/// A line for each channel.
std::string channels_text(const ordered_json& facts) {
  std::string text;
  for (const auto& channel : facts["channels"]) {
    const ordered_json& type = channel["type"];
    text += fmt::format("  channel   {}: {} x {}{}\n", channel["name"].get<std::string>(),
                        channel["components"].dump(),
                        type.is_string() ? type.get<std::string>() : "type " + type.dump(),
                        meaning_of(channel));
  }
  return text;
}

/// The lines of the summary, from the facts that --json prints.
std::string summary_of(const ordered_json& facts) {
  const auto bytes = [&](const char* what) {
    return ptc::bytes_text(facts["bytes"][what].get<std::uint64_t>());
  };
  std::string text = fmt::format(
      "{}: PTCX {}, written by {}\n"
      "  pages     {} of {}\n"
      "  points    {} in {} pages\n"
      "  nodes     {} in {} groups on {} levels\n"
      "  bounds    {}\n"
      "  bytes     {}: points {}, nodes {}, channels {}; codec {}\n",
      facts["file"].get<std::string>(), facts["format_version"].get<std::string>(),
      quoted(facts["writer"]), facts["pages"].dump(),
      ptc::bytes_text(facts["page_size"].get<std::uint64_t>()), facts["points"].dump(),
      facts["page_counts"]["point"].dump(), facts["nodes"].dump(), facts["node_groups"].dump(),
      facts["levels"].dump(), bounds_text(facts["bounds"]), bytes("file"), bytes("point_pages"),
      bytes("node_pages"), bytes("attribute_pages"), facts["codec"].get<std::string>());
  if (const auto parts = facts.find("parts"); parts != facts.end()) {
    for (const auto& part : *parts) {
      text +=
          fmt::format("  part      {}: {} points, {}\n", quoted(part["file"]),
                      part["points"].dump(), ptc::bytes_text(part["bytes"].get<std::uint64_t>()));
    }
  }
  text += record_text(facts["text"]);
  return text + channels_text(facts);
}

/// What the header of a cloud says.
ordered_json cloud_facts(const std::filesystem::path& path, const ptc::PointFileInfo& info) {
  ordered_json facts{{"file", path.string()},
                     {"format", info.format},
                     {"points", info.count ? ordered_json(*info.count) : ordered_json()}};
  if (info.stated_bounds) {
    const auto corner = [](const glm::dvec3& p) { return std::array{p.x, p.y, p.z}; };
    facts["bounds"] = {{"low", corner(info.stated_bounds->low)},
                       {"high", corner(info.stated_bounds->high)}};
  }
  facts["bytes"] = {{"file", ptc::InputFile(path).size()}};
  facts["normals"] = info.has_normals;
  facts["radii"] = info.has_radius;
  facts["radiance"] = info.has_radiance;
  facts["emission"] = info.has_emission;
  facts["colours"] = info.has_albedo;
  facts["channels"] = channels_of(info.channels);
  facts["text"] = info.text;
  facts["notes"] = info.notes;
  return facts;
}

/// The lines of the summary of a cloud.
std::string cloud_summary(const ordered_json& facts) {
  std::string text = fmt::format("{}: {}, {}\n", facts["file"].get<std::string>(),
                                 facts["format"].get<std::string>(),
                                 ptc::bytes_text(facts["bytes"]["file"].get<std::uint64_t>()));
  text += "  points    " +
          (facts["points"].is_null() ? "not counted: the header does not say how many there are"
                                     : facts["points"].dump()) +
          "\n";
  if (facts.contains("bounds"))
    text += "  bounds    " + bounds_text(facts["bounds"]) + ", as the header states\n";
  std::string surfel = "position";
  for (const char* part : {"normals", "radii", "radiance", "emission", "colours"}) {
    if (facts[part].get<bool>()) surfel += std::string(", ") + part;
  }
  text += "  of each   " + surfel + "\n" + record_text(facts["text"]) + channels_text(facts);
  for (const auto& note : facts["notes"]) text += "  note      " + note.get<std::string>() + "\n";
  return text;
}

/// Prints what a cloud says of itself.
ptc::Outcome tell_cloud(const std::filesystem::path& path) {
  const ptc::PointFile cloud = ptc::open_points(path);
  const ordered_json facts = cloud_facts(path, cloud.info);
  return {facts, cloud_summary(facts)};
}

/// Refuses what only a container can give.
[[noreturn]] void refuse(const std::filesystem::path& path, const char* why) {
  throw ptc::DataError(path.string() + ": " + why +
                       "; to build a container of it: " + ptc::build_command(path));
}

}  // namespace

int main(int argc, char** argv) {
  ptc::Command command("ptcinfo", kPurpose, kExamples);
  std::filesystem::path file;
  std::filesystem::path thumbnail;
  std::vector<std::string> endings = ptc::cloud_endings();
  endings.insert(endings.begin(), ".ptcx");
  command.add_input("FILE", file, endings, "Container or cloud to look at")->required();
  command
      .add_output("--thumbnail", thumbnail, {".png"},
                  "Picture of a container to write, 480 x 270 pixels\n"
                  "It takes a moment for a scene of any size: of more than two million points "
                  "the coarse levels of the octree alone are drawn.")
      ->required(false);
  bool why = false;
  command.app()
      .add_flag(
          "--why", why,
          "Tell what is stored of a point, in how many bytes, and why\n"
          "The bytes are measured on up to 64 pages of points, a column at a time. They add up "
          "to somewhat more or less than the pages take, whose columns are compressed "
          "together.")
      ->group(ptc::kFilesGroup);
  return command.run(argc, argv, [&](ptc::Progress&) -> ptc::Outcome {
    if (!ptc::is_container(file) && ptc::is_build_input(file)) {
      if (!ptc::is_point_file(file)) refuse(file, "this is a mesh");
      if (why) refuse(file, "--why is about what containers store, and this is a cloud");
      if (!thumbnail.empty())
        refuse(file, "--thumbnail draws containers alone, and this is a cloud");
      return tell_cloud(file);
    }
    require_memory(file, command.run_options());
    const ptc::ContainerReader container(file);
    ordered_json facts = facts_of(container);
    if (why) facts["why"] = ptc::why_facts(container);
    if (!thumbnail.empty())
      ptc::write_thumbnail(container, thumbnail, ptc::ThreadPool(command.run_options().threads));
    return {facts, summary_of(facts) + (why ? ptc::why_text(facts["why"]) : "")};
  });
}
