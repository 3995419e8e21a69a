// Property, for any well-formed values: what a writer here has written, its reader returns, and
// what the builder has built, the verifier accepts.
//
// The first byte picks the writer: container, PLY and the other formats of points, packed columns
// and codecs, node page, or EXR. Each take_...() function makes well-formed values of the bytes
// that follow; each target writes them, reads them back and compares.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <sstream>
#include <utility>
#include <vector>

#include "engine/io/cloud/point_writer.h"
#include "engine/io/cloud/points.h"
#include "engine/io/image/image.h"
#include "engine/octree/build_pages.h"
#include "engine/parallel/thread_pool.h"
#include "engine/store/container_points.h"
#include "engine/verify/verify.h"
#include "format/codec.h"
#include "format/node_page.h"
#include "format/point_page.h"
#include "fuzz/byte_source.h"
#include "fuzz/memory_file.h"
#include "fuzz/require.h"

namespace {

using namespace ptc;
using fuzz::ByteSource;
using fuzz::require;
using Bytes = std::vector<std::byte>;

constexpr std::uint64_t kKeyMask = ~std::uint64_t{0} >> 1;  // halves of keys have 63 bits

Bytes take_bytes(ByteSource& from, std::size_t count) {
  Bytes bytes(count);
  for (std::byte& b : bytes) b = from.take<std::byte>();
  return bytes;
}

// Makes the halves of a colour, finite and not negative.
Half3 take_halves(ByteSource& from) {
  Half3 halves;
  for (auto& half : halves)
    half = std::min<std::uint16_t>(from.take<std::uint16_t>() & 0x7fff, 0x7bff);
  return halves;
}

// Makes points that crowd in few cells, coincide, or lie at the corners of the lattice. One in four
// emits light where points may.
std::vector<PointRecord> take_points(ByteSource& from, bool may_emit) {
  std::vector<PointRecord> points;
  const std::uint32_t most = from.below(600);
  LatticePoint place{};
  while (!from.empty() && points.size() < most) {
    const std::uint8_t how = from.take();
    for (std::size_t axis = 0; axis < 3 && how % 4 != 0; ++axis) {
      const auto step = std::uint64_t{from.take()} << (how / 4 % 40);
      place[axis] = (how % 4 == 1   ? place[axis] + step
                     : how % 4 == 2 ? step
                                    : kLatticeMax - step) &
                    kLatticeMax;
    }
    PointRecord& point = points.emplace_back();
    point.key = encode_morton(place);
    point.radius = from.number<float>(0);
    point.radiance = take_halves(from);
    if (may_emit && from.take() % 4 == 0) point.emission = take_halves(from);
    point.normal = from.take<std::array<std::int16_t, 2>>();
    point.albedo = from.take<std::array<std::uint8_t, 3>>();
    // Repeat one point in four, up to 16 times.
    for (std::uint8_t copies = from.take() % 64; copies >= 48; --copies)
      points.push_back(points.back());
  }
  std::ranges::stable_sort(points, {}, &PointRecord::key);
  return points;
}

// A stream of points in memory.
class Stream : public PointStream {
 public:
  explicit Stream(std::span<const PointRecord> points) : rest_(points) {}
  std::size_t next(std::span<PointRecord> out) override {
    const std::size_t count = std::min(out.size(), rest_.size());
    std::ranges::copy(rest_.first(count), out.begin());
    rest_ = rest_.subspan(count);
    return count;
  }

 private:
  std::span<const PointRecord> rest_;
};

// Makes the type, the role and the facts of a channel, so that they suit each other.
Channel take_channel(ByteSource& from) {
  Channel channel;
  channel.type = static_cast<ChannelType>(1 + from.take() % 14);  // the last are of a later version
  if (channel_bytes(channel.type) == 0)
    channel.size = static_cast<std::uint8_t>(1 << from.take() % 4);
  channel.components = static_cast<std::uint8_t>(1 + from.take() % 16);
  channel.role = static_cast<ChannelRole>(from.take() % 8);
  channel.colour_space = static_cast<ColourSpace>(from.take() % 5);
  const bool counts = channel.type == ChannelType::u32 || channel.type == ChannelType::u64;
  if (channel.role == ChannelRole::direction || channel.role == ChannelRole::vector)
    channel.components = 3;
  if (channel.role == ChannelRole::index && counts) channel.components = 1;
  if (channel.role == ChannelRole::index && !counts) channel.role = ChannelRole::value;
  if (from.take() % 2 == 0) {
    const std::size_t unused = 64 - 8 * channel.component_bytes();
    channel.no_value = from.take<std::uint64_t>() << unused >> unused;
  }
  if (from.take() % 2 == 0) channel.unit = from.text(15, "m/s^2 W1", 8);
  if (from.take() % 2 == 0) channel.scale = from.number<double>();
  if (channel.scale == 0) channel.scale = 1;
  if (from.take() % 2 == 0) channel.offset = from.number<double>();
  return channel;
}

// Makes channels and texts. Returns nothing where two channels have one name, or a group has more
// bytes than a point.
std::optional<Meta> take_meta(ByteSource& from, std::size_t point_bytes) {
  constexpr char kLetters[] = "abz09_.";
  Meta meta;
  for (std::uint8_t n = from.take() % 4; n > 0; --n) {
    const int group = meta.channels.empty() ? 1 : meta.channels.back().group;
    const std::string name = from.text(31, kLetters, 7);
    if (std::ranges::count(meta.channels, name, &Channel::name) > 0) return {};
    meta.channels.push_back(take_channel(from));
    Channel& channel = meta.channels.back();
    channel.name = name;
    channel.group = static_cast<std::uint8_t>(std::min(255, group + from.take() % 3));
    if (group_point_bytes(meta.channels, channel.group) > point_bytes) return {};
  }
  for (std::uint8_t n = from.take() % 3; n > 0; --n) {
    const std::string key = from.text(31, kLetters, 7);
    meta.text[key] = from.text(80, "a\xc3\xa9 \n", 1);
  }
  return meta;
}

// Writes the attribute pages of all channel groups and keeps their payloads in `written`. One page
// in four has no value that is known, and is void.
void write_attributes(ByteSource& from, ContainerWriter& writer, const Meta& meta,
                      std::uint64_t points, std::vector<Bytes>& written) {
  const std::uint32_t full = points_per_page(writer.header());
  for (const std::uint8_t group : channel_groups(meta.channels)) {
    for (std::uint64_t first = 0; first < points; first += full) {
      const auto count = static_cast<std::uint32_t>(std::min<std::uint64_t>(full, points - first));
      Bytes& payload = written.emplace_back(count * group_point_bytes(meta.channels, group));
      fill_void(meta.channels, group, payload);
      if (from.take() % 4 != 0) payload = take_bytes(from, payload.size());
      writer.write_attributes(group, payload, count, meta.channels);
    }
  }
}

// A page of a type that a later version may have.
struct LaterPage {
  PageSummary facts;
  Bytes payload;
};

// Writes up to three pages of later types, unless the tail has no room for them.
std::vector<LaterPage> write_later(ByteSource& from, ContainerWriter& writer) {
  std::vector<LaterPage> pages(from.take() % 4);
  if (writer.state().node_pages + pages.size() >= kMaxTailPages) return {};
  for (LaterPage& page : pages)
    page.facts.type = static_cast<PageType>(kFirstSkippable + from.take() % 128);
  std::ranges::stable_sort(pages, {}, [](const LaterPage& page) { return page.facts.type; });
  for (LaterPage& page : pages) {
    page.facts.rank = writer.reserve_page(page.facts.type);
    page.facts.record_count = std::max(1U, from.take<std::uint32_t>());
    page.payload = take_bytes(from, 1 + from.below(payload_limit(writer.header().page_shift)));
    writer.keep_page(page.facts, page.payload);
  }
  return pages;
}

// Compares everything that a reader returns with what was written.
void compare(const ContainerReader& reader, const std::vector<PointRecord>& points,
             const Meta& meta, const std::vector<Bytes>& attributes,
             const std::vector<LaterPage>& later) {
  require(reader.meta().channels == meta.channels && reader.meta().text == meta.text);

  // Compare the points.
  ContainerPoints stream(reader);
  std::vector<PointRecord> back(points.size() + 1);
  require(stream.next(back) == points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    const PointRecord &a = points[i], &b = back[i];
    require(a.key == b.key && a.radius == b.radius && a.normal == b.normal &&
            a.radiance == b.radiance && a.albedo == b.albedo && a.emission == b.emission);
  }

  // Compare the attribute pages.
  PageDecoder decoder;
  const auto read = [&](std::uint32_t page) {
    Bytes payload(reader.page_payload_limit());
    payload.resize(reader.read_page(page, payload, decoder).raw_bytes);
    return payload;
  };
  std::size_t k = 0;
  for (unsigned group = 1; group <= kMaxGroup; ++group) {
    for (const std::uint32_t page : reader.attribute_pages(static_cast<std::uint8_t>(group)))
      require(k < attributes.size() && read(page) == attributes[k++]);
  }
  require(k == attributes.size());

  // Compare the pages of later types.
  k = 0;
  for (std::uint32_t page = 0; page < reader.page_count(); ++page) {
    const DirectoryEntry& entry = reader.entry(page);
    if (!is_skippable(entry.type)) continue;
    require(k < later.size() && entry.type == later[k].facts.type &&
            reader.rank(page) == later[k].facts.rank &&
            entry.record_count == later[k].facts.record_count && read(page) == later[k].payload);
    ++k;
  }
  require(k == later.size());
}

void container(ByteSource& from) {
  // Make options, channels, a frame and points.
  WriterOptions options;
  options.page_shift = static_cast<std::uint8_t>(12 + from.take() % 3);
  options.codec = static_cast<Codec>(from.take() % 3);
  options.uuid = from.take<Uuid>();
  const bool may_emit = from.take() % 2 == 0;
  options.point_bytes = may_emit ? kEmittingPointBytes : kPointBytes;
  const std::optional<Meta> meta = take_meta(from, options.point_bytes);
  if (!meta) return;
  BuildOptions build;
  build.leaf_points = 1 + from.take() % 20;
  build.levels_per_stream = 1 + from.take() % 63;
  Frame frame;
  frame.edge = std::ldexp(1.0, static_cast<std::int8_t>(from.take()));
  frame.origin.fill(frame.edge * static_cast<std::int8_t>(from.take()) / 128);
  std::vector<Bytes> attributes;
  const std::vector<PointRecord> points = take_points(from, may_emit);

  // Build the container.
  const auto path = fuzz::MemoryFile::directory() / "a.ptcx";
  Progress silent;
  Stream stream(points);
  options.frame = frame;
  ContainerWriter writer(path, options);
  const Superblock superblock = build_pages(stream, writer, build, ThreadPool(1), silent);
  write_attributes(from, writer, *meta, points.size(), attributes);
  const std::vector<LaterPage> later = write_later(from, writer);
  const Superblock written = writer.finish(*meta, superblock);

  // Verify it, and compare what it holds.
  require(verify_container(
              path,
              {.level = VerifyLevel::rebuild, .memory_bytes = std::uint64_t{1} << 30, .threads = 1},
              silent)
              .findings.empty());
  const ContainerReader reader(path);
  require(reader.superblock().content_xxh3 == written.content_xxh3 &&
          reader.header().uuid == options.uuid);
  compare(reader, points, *meta, attributes, later);
}

// Makes the text `las.header`: any bytes, or an object with numbers where they belong.
std::string take_las_header(ByteSource& from) {
  if (from.take() % 2 == 0) return from.text(60, "{}[]:,\"scale019.e-", 18);
  std::ostringstream text;
  const auto triple = [&](const char* name) {
    text << '"' << name << "\":[" << from.number<double>() << ',' << from.number<double>() << ','
         << from.number<double>() << ']';
  };
  text << '{';
  triple("scale");
  text << ',';
  triple("offset");
  text << ",\"day\":" << from.take<std::uint32_t>() << ",\"system_id\":\"\u00e9\"}";
  return text.str();
}

// Writes surfels with any attributes and texts in every format. A PLY of them is read back.
void write_everywhere(ByteSource& from, const Meta& meta, const std::vector<Surfel>& surfels,
                      bool emits) {
  // Make attributes and texts
  PointWriteInfo info{.count = surfels.size(), .channels = meta.channels, .text = meta.text};
  for (const Surfel& surfel : surfels) info.bounds.add(surfel.position);
  info.has_normals = info.has_radius = info.has_radiance = info.has_albedo = true;
  info.emits = emits;
  std::size_t row_bytes = 0;
  for (const Channel& channel : info.channels)
    row_bytes += channel.component_bytes() * channel.components;
  const Bytes rows = take_bytes(from, surfels.size() * row_bytes);
  if (from.take() % 2 == 0) info.text["las.header"] = take_las_header(from);
  if (from.take() % 2 == 0) info.text["las.vlrs"] = from.text(200, "AB/+=aQc", 8);

  // Write them
  const auto path = fuzz::MemoryFile::directory() / "b.ply";
  for (const OutputFormat format :
       {OutputFormat::bgeo, OutputFormat::las, OutputFormat::pcd, OutputFormat::ptc,
        OutputFormat::usda, OutputFormat::usdc, OutputFormat::xyz, OutputFormat::ply}) {
    static_cast<void>(losses(format, info));
    const auto writer = create_points(path, format, info);
    writer->write(surfels, rows);
    writer->finish();
  }
  std::vector<Surfel> back(surfels.size() + 1);
  require(open_points(path).source->next(back) == surfels.size());
  for (std::size_t i = 0; i < surfels.size(); ++i) {
    const Surfel &a = surfels[i], &b = back[i];
    require(a.position == b.position && a.normal == b.normal && a.radius == b.radius &&
            a.radiance == b.radiance && a.albedo == b.albedo && a.emission == b.emission);
  }
}

void clouds(ByteSource& from) {
  // Make surfels and channels.
  const bool emits = from.take() % 2 == 0;
  const std::optional<Meta> meta = take_meta(from, kEmittingPointBytes);
  if (!meta) return;
  std::vector<Surfel> surfels(from.take() % 40);
  for (Surfel& s : surfels) {
    for (int i = 0; i < 3; ++i) {
      s.position[i] = std::clamp(from.number<double>(), -kMaxCoordinate, kMaxCoordinate);
      s.radiance[i] = from.number<float>(0);
      s.albedo[i] = static_cast<float>(from.take()) / 255;
      if (emits) s.emission[i] = from.number<float>(0);
    }
    s.radius = from.number<float>(0);
    s.normal[from.take() % 3] = from.take() % 2 == 0 ? 1.0F : -1.0F;
  }
  write_everywhere(from, *meta, surfels, emits);
}

void codec(ByteSource& from) {
  // Make a payload of some columns.
  std::vector<Channel> channels;
  for (std::uint8_t n = 1 + from.take() % 3; n > 0; --n) {
    channels.push_back({.name = "a",
                        .type = static_cast<ChannelType>(1 + from.take() % 11),
                        .components = static_cast<std::uint8_t>(1 + from.take() % 2)});
  }
  const std::vector<PackedColumn> columns = packed_group_columns(channels, 1);
  const std::uint32_t count = 1 + from.below(300);
  const Bytes raw = take_bytes(from, count * group_point_bytes(channels, 1));

  // Encode and decode it by each codec, then pack and unpack it alone.
  Bytes stored, back(raw.size()), packed;
  for (const Codec kind : {Codec::raw, Codec::zstd, Codec::lz4}) {
    const Coding coding = PageEncoder(kind).encode(raw, stored, {count, columns});
    PageDecoder().decode(coding, stored, back, {count, columns});
    require(back == raw && stored.size() <= raw.size());
  }
  pack_columns(raw, count, columns, packed);
  std::ranges::fill(back, std::byte{0x5a});
  unpack_columns(packed, count, columns, back);
  require(back == raw);
}

// Makes a group with references and summaries of its children.
NodeGroup take_group(ByteSource& from) {
  // Choose a cell.
  NodeGroup group;
  group.level = from.take() % 63;
  group.cell = cell_of(
      {from.take<std::uint64_t>() & kKeyMask, from.take<std::uint64_t>() & kKeyMask}, group.level);
  const LatticePoint corner = decode_morton(group.cell);

  // Choose references and summaries.
  group.children.resize(1 + from.take() % 8);
  for (NodeChild& child : group.children) {
    child.ref.interior = from.take() % 2 == 0;
    if (child.ref.interior) {
      child.ref.page = from.take() % 100;
      child.ref.slot = from.take<std::uint16_t>();
    } else {
      child.ref.point_count = 1 + from.below(kMaxLeafPoints);
      child.ref.first_point = from.take<std::uint32_t>();
    }
    NodeSummary& node = child.node;
    for (std::size_t i = 0; i < 3; ++i) node.mean[i] = static_cast<double>(corner[i]) + from.take();
    for (double* value : {&node.radius, &node.area, &node.thickness, &node.greatest})
      *value = from.number<double>(0);
    node.thickness = std::min(node.thickness, node.radius);
    for (double& facing : node.facing) facing = node.area * (from.take() / 255.0);
    for (auto& rgb : node.flux) rgb.fill(from.number<float>(0));
    node.emits = from.take() % 8 == 0;
    for (auto& rgb : node.power) rgb.fill(node.emits ? from.number<float>(0) : 0);
    node.cone_axis = {0, 0, 1};
    node.cone_cos = static_cast<float>(from.take()) / 127.5F - 1;
  }
  return group;
}

void node_page(ByteSource& from) {
  // Fill a page with groups.
  constexpr std::uint64_t kPoints = std::uint64_t{1} << 40;
  NodePageEncoder encoder(std::size_t{4032} << from.take() % 9);
  std::vector<NodeGroup> groups;
  while (!from.empty()) {
    NodeGroup group = take_group(from);
    if (!encoder.fits(group.children.size(), emits_light(group))) break;
    require(encoder.add(group) == groups.size());
    groups.push_back(std::move(group));
  }
  if (groups.empty()) return;

  // Decode it: references are equal, and bounds are not narrower. Add each group again.
  const Bytes payload = encoder.take();
  const NodePage page(payload, static_cast<std::uint32_t>(groups.size()), 100, kPoints, true);
  for (std::uint32_t slot = 0; slot < page.size(); ++slot) {
    require(encoder.add(page[slot]) == slot && page[slot].emits() == emits_light(groups[slot]));
    const NodeGroup back = page.decode(slot);
    const NodeGroup& group = groups[slot];
    require(back.cell == group.cell && back.level == group.level &&
            back.children.size() == group.children.size());
    for (std::size_t i = 0; i < group.children.size(); ++i) {
      const NodeSummary &a = group.children[i].node, &b = back.children[i].node;
      require(back.children[i].ref == group.children[i].ref && std::isfinite(b.radius) &&
              b.cone_cos <= a.cone_cos);
      require(b.radius >= std::min(a.radius, 0x1.ffp127) &&
              b.thickness >= std::min(a.thickness, 0x1.ffp127) &&
              b.greatest >= std::min(a.greatest, 0x1.ffp127));
    }
  }
  require(encoder.take() == payload);  // groups were added as they lie in the page
}

void exr(ByteSource& from) {
  const unsigned width = 1 + from.take() % 20, height = 1 + from.take() % 20;
  ExrLayer layer;
  layer.full_float = true;
  layer.values.resize(std::size_t{3} * width * height);
  for (float& value : layer.values) value = from.number<float>(0);
  const auto path = fuzz::MemoryFile::directory() / "a.exr";
  write_exr(path, width, height, {layer});
  const Image image = read_image(path);
  require(image.width == width && image.height == height);
  for (std::size_t i = 0; i < layer.values.size(); ++i) {
    require(image.pixels[i / 3][static_cast<int>(i % 3)] == layer.values[i]);
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  constexpr std::array kWriters{container, container, clouds, codec, node_page, exr};
  ByteSource from(data, size);
  kWriters[from.take() % kWriters.size()](from);
  return 0;
}
