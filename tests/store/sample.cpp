// How the sample containers are made.
#include "tests/store/sample.h"

#include <stdlib.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <random>
#include <stdexcept>
#include <string>

#include "format/node_page.h"
#include "format/point_page.h"
#include "format/scalar.h"

namespace ptc::test {
namespace {

using Facts = PageSummary;

/// The plan of a group: the points that it covers, and its children.
struct Plan {
  std::uint64_t first = 0;
  std::uint64_t end = 0;
  std::vector<ChildRef> children;
};

NodeChild sample_child(const ChildRef& ref, const MortonKey& cell, int level, bool emits) {
  NodeChild child;
  child.ref = ref;
  const LatticePoint corner = decode_morton(cell);
  const double edge = static_cast<double>(kLatticeMax + 1) / static_cast<double>(1u << level);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    child.node.mean[axis] = static_cast<double>(corner[axis]) + edge / 2;
  }
  child.node.radius = edge;
  child.node.area = 1;
  child.node.facing = {0.25, 0, 0.5, 0, 0, 0.25};
  child.node.flux[2] = {1, 2, 3};
  child.node.cone_axis = {0, 0, 1};
  child.node.emits = emits;
  if (emits) child.node.power[5] = {4, 0, 2};
  return child;
}

class Tree {
 public:
  Tree(ContainerWriter& writer, const std::vector<PointRecord>& points, Sample& sample)
      : writer_(writer),
        points_(points),
        sample_(sample),
        limit_(payload_limit(writer.header().page_shift)),
        emits_(writer.header().point_bytes == kEmittingPointBytes) {}

  /// Builds the tree from the leaves up: every eight groups of a tier become children of one above.
  void write(std::uint32_t leaf_points) {
    std::vector<Plan> tier = leaves(leaf_points);
    int level = 0;
    for (std::size_t n = tier.size(); n > 1; n = (n + 7) / 8) ++level;
    sample_.superblock.levels = static_cast<std::uint16_t>(level + 1);
    for (;; --level) {
      const std::vector<ChildRef> refs = write_tier(tier, level);
      if (level == 0) {
        sample_.superblock.root_page = refs[0].page;
        sample_.superblock.root_slot = refs[0].slot;
        return;
      }
      std::vector<Plan> above((tier.size() + 7) / 8);
      for (std::size_t i = 0; i < tier.size(); ++i) {
        Plan& parent = above[i / 8];
        if (parent.children.empty()) parent.first = tier[i].first;
        parent.end = tier[i].end;
        parent.children.push_back(refs[i]);
      }
      tier = std::move(above);
    }
  }

 private:
  std::vector<Plan> leaves(std::uint32_t leaf_points) const {
    std::vector<Plan> tier;
    for (std::uint64_t first = 0; first < points_.size(); first += leaf_points) {
      ChildRef ref;
      ref.first_point = first;
      ref.point_count =
          static_cast<std::uint32_t>(std::min<std::uint64_t>(leaf_points, points_.size() - first));
      if (tier.empty() || tier.back().children.size() == 8) tier.push_back({first, first, {}});
      tier.back().end = first + ref.point_count;
      tier.back().children.push_back(ref);
    }
    return tier;
  }

  std::vector<ChildRef> write_tier(const std::vector<Plan>& tier, int level) {
    std::vector<ChildRef> refs;
    NodePageEncoder encoder(limit_);
    Facts facts{.type = PageType::node,
                .rank = writer_.reserve_page(PageType::node),
                .level = static_cast<std::uint8_t>(level)};
    const auto flush = [&] { sample_.pages.push_back({facts, encoder.take()}); };
    for (const Plan& plan : tier) {
      if (!encoder.fits(plan.children.size(), emits_)) {
        flush();
        facts.rank = writer_.reserve_page(PageType::node);
        facts.record_count = 0;
      }
      NodeGroup group;
      group.level = level;
      group.cell = cell_of(points_[plan.first].key, level);
      for (const ChildRef& ref : plan.children) {
        group.children.push_back(sample_child(ref, group.cell, level, emits_));
      }
      ChildRef ref;
      ref.interior = true;
      ref.page = facts.rank;
      ref.slot = encoder.add(group);
      refs.push_back(ref);
      facts.last_key = group.cell.high;
      if (facts.record_count++ == 0) facts.first_key = group.cell.high;
      sample_.superblock.nodes += group.children.size();
      ++sample_.superblock.node_groups;
    }
    flush();
    return refs;
  }

  ContainerWriter& writer_;
  const std::vector<PointRecord>& points_;
  Sample& sample_;
  std::size_t limit_;
  bool emits_;
};

std::vector<std::byte> noise(std::size_t bytes, std::uint32_t seed) {
  std::mt19937 random(seed);
  std::vector<std::byte> out(bytes);
  for (std::byte& b : out)
    b = static_cast<std::byte>(random() & 0x1f);  // 5 of 8 bits: compressible
  return out;
}

/// Plans the point pages and, group by group, the attribute pages.
void plan_pages(ContainerWriter& writer, const SampleOptions& options,
                const std::vector<PointRecord>& points, Sample& sample) {
  const std::uint32_t full = points_per_page(writer.header());
  for (std::size_t first = 0; first < points.size(); first += full) {
    const auto part =
        std::span(points).subspan(first, std::min<std::size_t>(full, points.size() - first));
    sample.pages.push_back({{.type = PageType::point,
                             .rank = writer.reserve_page(PageType::point),
                             .record_count = static_cast<std::uint32_t>(part.size()),
                             .first_key = part.front().key.high,
                             .last_key = part.back().key.high},
                            encode_point_page(part, writer.header().point_bytes)});
  }
  const std::size_t point_pages = sample.pages.size();
  for (std::uint8_t group = 1; group <= options.attribute_groups; ++group) {
    const std::size_t bytes = group_point_bytes(sample.meta.channels, group);
    for (std::size_t k = 0; k < point_pages; ++k) {
      const Facts facts{.type = PageType::attribute,
                        .group = group,
                        .rank = writer.reserve_page(PageType::attribute, group),
                        .record_count = sample.pages[k].facts.record_count};
      const bool is_void = options.void_every != 0 && facts.rank % options.void_every == 0;
      auto payload = noise(facts.record_count * bytes, facts.rank * 256 + group);
      if (is_void) fill_void(sample.meta.channels, group, payload);
      sample.pages.push_back({facts, std::move(payload), is_void});
    }
  }
}

/// Plans pages of types that a later version may have.
void plan_later(ContainerWriter& writer, const SampleOptions& options, Sample& sample) {
  for (std::size_t i = 0; i < options.later.size(); ++i) {
    const PageType type = options.later[i];
    const auto count = static_cast<std::uint32_t>(i + 1);
    sample.pages.push_back(
        {{.type = type, .rank = writer.reserve_page(type), .record_count = 7 * count},
         noise(count * 33, count)});
  }
}

}  // namespace

std::vector<PointRecord> sample_points(std::uint32_t count) {
  std::mt19937_64 random(count);
  std::vector<PointRecord> points(count);
  for (PointRecord& point : points) {
    LatticePoint place;
    for (auto& axis : place) axis = random() & kLatticeMax;
    point.key = encode_morton(place);
    point.radius = static_cast<float>(random() % 1000 + 1) / 1000.0f;
    point.normal = encode_octahedral({0, 0, 1});
    for (auto& channel : point.radiance) {
      channel = encode_half(static_cast<float>(random() % 256) / 16.0f);
    }
    point.emission = {encode_half(static_cast<float>(random() % 16)), 0, encode_half(1)};
    point.albedo = {10, 20, static_cast<std::uint8_t>(random() & 0xff)};
  }
  std::ranges::sort(points, {}, &PointRecord::key);
  return points;
}

void write_unfinished(ContainerWriter& writer, const SampleOptions& options, Sample& sample) {
  for (std::uint8_t group = 1; group <= options.attribute_groups; ++group) {
    const std::string g = std::to_string(group);
    sample.meta.channels.push_back(
        {.name = "a" + g, .type = ChannelType::half, .group = group, .no_value = 0x7e00});
    sample.meta.channels.push_back(
        {.name = "b" + g, .type = ChannelType::u8, .components = group, .group = group});
  }
  sample.meta.text["title"] = "sample";
  const std::vector<PointRecord> points = sample_points(options.points);
  plan_pages(writer, options, points, sample);
  Superblock& superblock = sample.superblock;
  superblock.points = options.points;
  superblock.leaf_points = options.leaf_points;
  superblock.bounds_high = {1, 1, 1};
  superblock.area = 3;
  superblock.flux = {1, 2, 3};
  if (!points.empty()) Tree(writer, points, sample).write(options.leaf_points);
  plan_later(writer, options, sample);
  // Write from the last page to the first, so that numbers and places in the file disagree; those
  // of the tail lie in their order.
  const auto in_tail =
      static_cast<std::size_t>(std::ranges::count_if(sample.pages, [](const Sample::Page& page) {
        return page.facts.type != PageType::point && page.facts.type != PageType::attribute;
      }));
  const std::size_t body = sample.pages.size() - std::min(in_tail, options.tail_pages);
  for (std::size_t page = body; page-- > 0;) {
    const Sample::Page& it = sample.pages[page];
    if (it.is_void) {
      writer.write_void_page(it.facts);
    } else {
      writer.write_page(it.facts, it.payload);
    }
  }
  for (const Sample::Page& it : std::span(sample.pages).subspan(body))
    writer.keep_page(it.facts, it.payload);
}

Sample write_sample(const std::filesystem::path& target, const SampleOptions& options) {
  Sample sample;
  ContainerWriter writer(target, options.writer);
  write_unfinished(writer, options, sample);
  sample.superblock = writer.finish(sample.meta, sample.superblock);
  return sample;
}

std::string rule_of(const std::filesystem::path& path) {
  const std::string name = path.filename().string();
  const std::size_t dash = name.find('-');
  return "spec/" + name.substr(0, dash) + ".md#" + name.substr(dash + 1, name.find('.') - dash - 1);
}

std::vector<std::byte> read_file(const std::filesystem::path& path) {
  std::ifstream in(path, std::ios::binary);
  const std::vector<char> text((std::istreambuf_iterator<char>(in)), {});
  std::vector<std::byte> bytes(text.size());
  std::ranges::copy(std::as_bytes(std::span(text)), bytes.begin());
  return bytes;
}

void write_file(const std::filesystem::path& path, std::span<const std::byte> bytes) {
  std::ofstream out(path, std::ios::binary | std::ios::trunc);
  out.write(reinterpret_cast<const char*>(bytes.data()),
            static_cast<std::streamsize>(bytes.size()));
  out.close();
  if (!out) throw std::runtime_error("cannot write " + path.string());
}

std::vector<std::byte> walk(const std::filesystem::path& path, ContainerReader::OpenParts parts) {
  const ContainerReader reader(path, parts);
  PageDecoder decoder;
  std::vector<std::byte> all;
  std::vector<std::byte> buffer(reader.page_payload_limit());
  for (std::uint32_t page = 0; page < reader.page_count(); ++page) {
    const PageHeader header = reader.read_page(page, buffer, decoder);
    all.insert(all.end(), buffer.begin(), buffer.begin() + header.raw_bytes);
  }
  return all;
}

}  // namespace ptc::test
