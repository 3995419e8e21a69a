// Node pages: bounds survive quantisation, and any bytes are refused or safe to read.
#include "format/node_page.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <catch2/catch.hpp>

#include "format/node_layout.h"
#include "format/scalar.h"
#include "tests/format/support.h"

using namespace ptc;
using ptc::test::clause_of;
using ptc::test::put;
using ptc::test::Random;
using Bytes = std::vector<std::byte>;

namespace {

constexpr std::uint32_t kPages = 50;
constexpr std::uint64_t kPoints = 1000000;

std::array<float, 3> random_axis(Random& random) {
  std::array<double, 3> n;
  double square = 0;
  for (double& c : n) {
    c = random.between(-1, 1);
    square += c * c;
  }
  const double length = std::sqrt(square);
  return {static_cast<float>(n[0] / length), static_cast<float>(n[1] / length),
          static_cast<float>(n[2] / length)};
}

NodeSummary random_summary(Random& random, const LatticePoint& corner, int level) {
  NodeSummary node;
  const double edge = cell_edge(level);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    node.mean[axis] = static_cast<double>(corner[axis]) + edge * random.between(0, 1 - 0x1p-16);
  }
  node.radius = edge * std::exp2(random.between(-20, 2));
  node.thickness = node.radius * random.unit();
  node.area = std::exp2(random.between(-30, 30));
  node.greatest = node.radius * random.unit();
  for (std::size_t k = 0; k < 6; ++k) {
    node.facing[k] = random.below(3) == 0 ? 0 : node.area * random.unit();
    for (double& f : node.flux[k]) f = node.facing[k] * std::exp2(random.between(-20, 20));
    for (double& p : node.power[k]) p = node.facing[k] * std::exp2(random.between(-20, 20));
  }
  node.cone_axis = random_axis(random);
  node.cone_cos = static_cast<float>(random.below(4) == 0 ? 1 : random.between(-1, 1));
  return node;
}

// Makes a group whose children emit light, or none of them.
NodeGroup random_group(Random& random, std::size_t children, int level, bool emits = false) {
  NodeGroup group;
  group.level = level;
  const LatticePoint p{random.bits() & kLatticeMax, random.bits() & kLatticeMax,
                       random.bits() & kLatticeMax};
  group.cell = cell_of(encode_morton(p), std::min(level, kLatticeBits));
  for (std::size_t i = 0; i < children; ++i) {
    NodeChild child;
    child.ref.interior = random.below(2) == 0;
    if (child.ref.interior) {
      child.ref.page = static_cast<std::uint32_t>(random.below(kPages));
      child.ref.slot = static_cast<std::uint16_t>(random.bits());
    } else {
      child.ref.point_count = 1 + static_cast<std::uint32_t>(random.below(0xffff));
      child.ref.first_point = random.below(kPoints - child.ref.point_count + 1);
    }
    child.node = random_summary(random, decode_morton(group.cell), level);
    child.node.emits = emits;
    group.children.push_back(child);
  }
  return group;
}

Bytes page_of(const std::vector<NodeGroup>& groups) {
  NodePageEncoder encoder(65472);
  for (const NodeGroup& group : groups) encoder.add(group);
  return encoder.take();
}

std::string clause(const Bytes& payload, std::uint32_t groups, bool may_emit = true) {
  return clause_of([&] { NodePage(payload, groups, kPages, kPoints, may_emit); });
}

template <class T>
std::string changed(const Bytes& payload, std::uint32_t groups, std::size_t at, T value,
                    bool may_emit) {
  Bytes bytes = payload;
  put(bytes, at, value);
  return clause(bytes, groups, may_emit);
}

bool finite(const NodeSummary& node) {
  const auto ok = [](double x) { return std::isfinite(x); };
  return std::ranges::all_of(node.mean, ok) && ok(node.radius) && ok(node.area) &&
         ok(node.thickness) && ok(node.greatest) && std::ranges::all_of(node.facing, ok) &&
         std::ranges::all_of(node.cone_axis, ok) && ok(node.cone_cos) &&
         std::ranges::all_of(node.flux,
                             [&](const auto& f) { return std::ranges::all_of(f, ok); }) &&
         std::ranges::all_of(node.power, [&](const auto& p) { return std::ranges::all_of(p, ok); });
}

bool reference_in_bounds(const ChildRef& ref) {
  if (ref.interior) return ref.page < kPages;
  return ref.point_count > 0 && ref.first_point + ref.point_count <= kPoints;
}

}  // namespace

TEST_CASE("node page: structure and references survive encoding and decoding", "[format][nodes]") {
  Random random(1);
  std::vector<NodeGroup> groups;
  for (int level = 0; level <= kMaxLevel; ++level) {
    groups.push_back(random_group(random, 1 + random.below(8), level, level % 3 == 0));
  }
  const Bytes payload = page_of(groups);
  const NodePage page(payload, static_cast<std::uint32_t>(groups.size()), kPages, kPoints, true);
  for (std::uint32_t slot = 0; slot < page.size(); ++slot) {
    const NodeGroup back = page.decode(slot);
    CHECK(back.cell == groups[slot].cell);
    CHECK(back.level == groups[slot].level);
    CHECK(page[slot].emits() == (slot % 3 == 0));
    CHECK(emits_light(back) == (slot % 3 == 0));
    REQUIRE(back.children.size() == groups[slot].children.size());
    for (std::size_t i = 0; i < back.children.size(); ++i) {
      CHECK(back.children[i].ref == groups[slot].children[i].ref);
      CHECK(finite(back.children[i].node));
    }
  }
}

TEST_CASE("node page: the stored sphere contains the given one", "[format][nodes]") {
  Random random(2);
  unsigned wrong = 0;
  for (int i = 0; i < 20000; ++i) {
    const int level = static_cast<int>(random.below(63));
    NodeGroup group = random_group(random, 1, level);
    NodeSummary& given = group.children[0].node;
    if (i % 10 == 0) given.radius = 0;
    if (i % 7 == 0) given.mean[1] += (random.unit() - 0.5) * 3 * cell_edge(level);  // clamped
    const NodeSummary stored =
        NodePage(page_of({group}), 1, kPages, kPoints, true).decode(0).children[0].node;
    long double square = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const long double d = static_cast<long double>(stored.mean[axis]) - given.mean[axis];
      square += d * d;
    }
    const long double moved = std::sqrt(square);
    wrong += stored.radius < given.radius + moved;
    // The sphere is not wider than needed: one step of ufloat16.
    wrong += stored.radius > (given.radius + moved) * (1.0L + 0x1p-8L) * (1 + 1e-6L);
    if (i % 7 != 0) {
      wrong +=
          moved > std::sqrt(3.0) / 2 * 1.001 * cell_edge(level) / 65536;  // half a step per axis
    }
  }
  CHECK(wrong == 0);
}

TEST_CASE("node page: the stored slab contains the given one", "[format][nodes]") {
  using Vec = std::array<double, 3>;
  const auto normal = [](const NodeSummary& node) {
    Vec v{node.facing[0] - node.facing[1], node.facing[2] - node.facing[3],
          node.facing[4] - node.facing[5]};
    const double length = std::hypot(v[0], v[1], v[2]);
    for (double& x : v) x /= length;
    return v;
  };
  Random random(6);
  unsigned wrong = 0;
  unsigned useful = 0;
  for (int i = 0; i < 20000; ++i) {
    NodeGroup group = random_group(random, 1, 5);
    NodeSummary& given = group.children[0].node;
    for (double& f : given.facing) f = given.area * random.unit();
    given.thickness = given.radius * std::exp2(random.between(-20, 0));
    const NodeSummary stored =
        NodePage(page_of({group}), 1, kPages, kPoints, true).decode(0).children[0].node;
    // Find the highest point over the plane, at the rim of the slab, turned any way.
    const Vec n = normal(given), s = normal(stored);
    const std::array<float, 3> other = random_axis(random);
    double along = 0;
    for (std::size_t k = 0; k < 3; ++k) along += double{other[k]} * n[k];
    Vec side{};
    for (std::size_t k = 0; k < 3; ++k) side[k] = double{other[k]} - along * n[k];
    const double length = std::hypot(side[0], side[1], side[2]);
    const double wide =
        std::sqrt(std::max(0.0, given.radius * given.radius - given.thickness * given.thickness));
    double height = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      height += s[k] *
                (given.mean[k] - stored.mean[k] + given.thickness * n[k] + wide * side[k] / length);
    }
    wrong += std::abs(height) > stored.thickness;
    useful += stored.thickness < 1.1 * given.thickness + 1e-3 * given.radius + cell_edge(5) / 32768;
  }
  CHECK(wrong == 0);
  CHECK(useful > 19000);
}

TEST_CASE("node page: the stored greatest radius is at least the given one, and one step at most",
          "[format][nodes]") {
  Random random(9);
  unsigned wrong = 0;
  for (int i = 0; i < 20000; ++i) {
    NodeGroup group = random_group(random, 2, static_cast<int>(random.below(63)));
    if (i % 10 == 0) group.children[1].node.greatest = 0;
    const NodeGroup stored = NodePage(page_of({group}), 1, kPages, kPoints, false).decode(0);
    for (std::size_t k = 0; k < 2; ++k) {
      const double given = group.children[k].node.greatest;
      const double bound = stored.children[k].node.greatest;
      wrong += bound < given || bound > given * (1 + 0x1p-8);
    }
  }
  CHECK(wrong == 0);
}

TEST_CASE("node page: an exact mean keeps its radius", "[format][nodes]") {
  NodeGroup group;
  group.children.resize(1);
  group.children[0].ref.point_count = 1;
  group.children[0].node.radius = 3;
  group.children[0].node.mean = {0x1p26, 0x1p41, 0};
  const NodeSummary stored =
      NodePage(page_of({group}), 1, kPages, kPoints, true).decode(0).children[0].node;
  CHECK(stored.mean == group.children[0].node.mean);
  CHECK(stored.radius == 3);
}

TEST_CASE("node page: the stored cone contains the given one", "[format][nodes]") {
  Random random(3);
  unsigned wrong = 0;
  unsigned useful = 0;
  for (int i = 0; i < 20000; ++i) {
    NodeGroup group = random_group(random, 1, 5);
    const NodeSummary& given = group.children[0].node;
    const NodeSummary stored =
        NodePage(page_of({group}), 1, kPages, kPoints, true).decode(0).children[0].node;
    const double half_angle = std::acos(double{given.cone_cos});
    // Take a normal on the edge of the given cone, turned any way about the axis.
    const std::array<float, 3> other = random_axis(random);
    std::array<double, 3> side;
    double along = 0;
    for (std::size_t k = 0; k < 3; ++k) along += double{other[k]} * given.cone_axis[k];
    double square = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      side[k] = other[k] - along * given.cone_axis[k];
      square += side[k] * side[k];
    }
    double dot = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      const double n = std::cos(half_angle) * given.cone_axis[k] +
                       std::sin(half_angle) * side[k] / std::sqrt(square);
      dot += n * stored.cone_axis[k];
    }
    wrong += dot < double{stored.cone_cos};
    useful += std::acos(double{stored.cone_cos}) < half_angle + 0.05;
  }
  CHECK(wrong == 0);
  CHECK(useful > 19000);
}

TEST_CASE("node page: area, facing and flux keep their precision", "[format][nodes]") {
  Random random(4);
  unsigned wrong = 0;
  for (int i = 0; i < 5000; ++i) {
    const NodeGroup group = random_group(random, 1, 3);
    const NodeSummary& given = group.children[0].node;
    const Bytes payload = page_of({group});
    const NodePage page(payload, 1, kPages, kPoints, true);
    const NodeSummary stored = page.decode(0).children[0].node;
    wrong += std::abs(stored.area - given.area) > given.area * 0x1p-9;
    for (std::size_t k = 0; k < 6; ++k) {
      const double share = stored.facing[k] / stored.area;
      wrong += std::abs(share - given.facing[k] / given.area) > 0.5001 / 65535;
      std::array<float, 3> radiance{};
      for (std::size_t c = 0; c < 3 && given.facing[k] > 0; ++c) {
        radiance[c] = static_cast<float>(given.flux[k][c] / given.facing[k]);
      }
      const auto bits = test::get<std::uint32_t>(std::span(page[0].radiance(0), 24), 4 * k);
      wrong += bits != encode_rgbe(radiance);
    }
    wrong += page[0].emits() || stored.emits || stored.power != NodeSummary().power;
  }
  CHECK(wrong == 0);
}

TEST_CASE("node page: emission is the mean of power towards each axis", "[format][nodes]") {
  Random random(10);
  unsigned wrong = 0;
  for (int i = 0; i < 5000; ++i) {
    NodeGroup group = random_group(random, 1 + random.below(8), 3, true);
    const std::size_t n = group.children.size();
    const std::size_t dark = random.below(n + 1);  // one child that does not emit, or none
    if (dark < n && n > 1) {
      group.children[dark].node.emits = false;
      group.children[dark].node.power = {};
    }
    const Bytes payload = page_of({group});
    const NodePage page(payload, 1, kPages, kPoints, true);
    const NodeGroup back = page.decode(0);
    wrong += !page[0].emits();
    for (std::size_t c = 0; c < n; ++c) {
      const NodeSummary &given = group.children[c].node, &stored = back.children[c].node;
      for (std::size_t k = 0; k < 6; ++k) {
        std::array<float, 3> radiance{}, emission{};
        for (std::size_t rgb = 0; rgb < 3 && given.facing[k] > 0; ++rgb) {
          radiance[rgb] = static_cast<float>(given.flux[k][rgb] / given.facing[k]);
          emission[rgb] = static_cast<float>(given.power[k][rgb] / given.facing[k]);
        }
        const auto bits = [&](const std::byte* column) {
          return test::get<std::uint32_t>(std::span(column, 4 * n), 4 * c);
        };
        const int axis = static_cast<int>(k);
        wrong += bits(page[0].radiance(axis)) != encode_rgbe(radiance);
        wrong += bits(page[0].emission(axis)) != encode_rgbe(emission);
        const std::array<float, 3> decoded = decode_rgbe(encode_rgbe(emission));
        for (std::size_t rgb = 0; rgb < 3; ++rgb)
          wrong += stored.power[k][rgb] != stored.facing[k] * double{decoded[rgb]};
      }
    }
  }
  CHECK(wrong == 0);
}

TEST_CASE("node page: columns lie where the spec says", "[format][nodes]") {
  NodeGroup group;
  group.children.resize(2);
  for (std::size_t i = 0; i < 2; ++i) {
    NodeSummary& node = group.children[i].node;
    group.children[i].ref.point_count = 1;
    node.mean = {0x1p26 * 1, 0x1p26 * 2, 0x1p26 * 3};
    node.radius = 4;
    node.thickness = 2;
    node.greatest = 3;
    node.area = 1;
    node.facing = {1, 0, 0, 0, 0, 0.5};
    node.flux[0] = {1, 2, 4};
    node.power[5] = {8, 0, 0};
    node.cone_axis = {0, 0, 1};
    node.emits = i == 0;
  }
  group.children[1].node.power = {};
  const Bytes bytes = page_of({group});
  REQUIRE(bytes.size() == 8 + 24 + 2 * (62 + 24) + 4);
  const auto u16 = [&](std::size_t before, std::size_t i) {
    return test::get<std::uint16_t>(bytes, 8 + 24 + 2 * before + 2 * i);
  };
  const auto u32 = [&](std::size_t before, std::size_t i) {
    return test::get<std::uint32_t>(bytes, 8 + 24 + 2 * before + 4 * i);
  };
  CHECK(bytes[8 + 17] == std::byte{2});
  CHECK(bytes[8 + 19] == std::byte{1});  // emits
  for (std::size_t i = 0; i < 2; ++i) {
    CHECK(u16(8, i) == 1);
    CHECK(u16(10, i) == 2);
    CHECK(u16(12, i) == 3);
    CHECK(u16(14, i) == encode_ufloat16(4));
    CHECK(u16(16, i) == 0);
    CHECK(u16(20, i) == encode_ufloat16(1));
    CHECK(u16(24, i) == encode_ufloat16(3));
    CHECK(u16(26, i) == 65535);
    CHECK(u16(36, i) == 32768);  // half of 65535, up
    CHECK(u32(38, i) == encode_rgbe({1, 2, 4}));
    CHECK(u32(42, i) == 0);
    CHECK(u32(62, i) == 0);
    CHECK(u32(82, i) == (i == 0 ? encode_rgbe({16, 0, 0}) : 0));
  }
}

TEST_CASE("node page: a copied group keeps its bytes, with emission or without",
          "[format][nodes]") {
  Random random(11);
  for (const bool emits : {false, true}) {
    const Bytes payload = page_of({random_group(random, 5, 4, emits), random_group(random, 3, 9)});
    const NodePage page(payload, 2, kPages, kPoints, emits);
    CHECK(page[0].bytes().size() == 24u + 5 * (emits ? 86 : 62));
    NodePageEncoder encoder(65472);
    for (std::uint32_t slot = 0; slot < 2; ++slot) encoder.add(page[slot]);
    CHECK(encoder.take() == payload);
  }
}

TEST_CASE("node page: a cluster without area emits no light", "[format][nodes]") {
  NodeGroup group;
  group.children.resize(1);
  group.children[0].ref.point_count = 1;
  group.children[0].node.emits = true;
  group.children[0].node.flux[1] = group.children[0].node.power[1] = {1, 1, 1};
  const Bytes payload = page_of({group});
  const NodeSummary node = NodePage(payload, 1, kPages, kPoints, true).decode(0).children[0].node;
  CHECK(node.area == 0);
  CHECK(node.facing == std::array<double, 6>{});
  CHECK(node.flux == decltype(node.flux){});
  CHECK(node.power == decltype(node.power){});
}

TEST_CASE("node page: groups fill a page up to its limit", "[format][nodes]") {
  const auto stored = [](std::size_t n, bool emits) {
    return round_to_slot(group_content_bytes(n, emits));
  };
  CHECK(stored(1, false) == 88);
  CHECK(stored(1, true) == 112);
  CHECK(stored(8, false) == 520);
  CHECK(stored(8, true) == 712);
  Random random(5);
  for (const std::size_t limit : {4032u, 65472u}) {
    NodePageEncoder encoder(limit);
    std::size_t groups = 0;
    std::size_t bytes = 0;
    for (;;) {
      const std::size_t n = 1 + random.below(8);
      const bool emits = random.below(2) == 0;
      const std::size_t table = (2 * (groups + 1) + 7) / 8 * 8;
      const bool fits = table + bytes + stored(n, emits) <= limit;
      REQUIRE(encoder.fits(n, emits) == fits);
      if (!fits) {
        CHECK_THROWS_AS(encoder.add(random_group(random, n, 9, emits)), std::invalid_argument);
        break;
      }
      CHECK(encoder.add(random_group(random, n, 9, emits)) == groups);
      ++groups;
      bytes += stored(n, emits);
      CHECK(encoder.size() == groups);
    }
    const Bytes payload = encoder.take();
    CHECK(payload.size() <= limit);
    CHECK(clause(payload, static_cast<std::uint32_t>(groups)) == "none");
    CHECK(encoder.size() == 0);
    CHECK(encoder.fits(8, true));
  }
}

TEST_CASE("node page: slots reach the end of the largest page", "[format][nodes]") {
  Random random(6);
  const NodeGroup group = random_group(random, 8, 9);
  NodePageEncoder encoder((1u << 20) - 64);
  std::uint32_t groups = 0;
  for (; encoder.fits(8, false); ++groups) encoder.add(group);
  const Bytes payload = encoder.take();
  CHECK(payload.size() <= 65536 * 8);
  CHECK(payload.size() > 65536 * 8 - 540);
  CHECK(clause(payload, groups) == "none");
}

TEST_CASE("node page: too many or no children are refused", "[format][nodes]") {
  NodePageEncoder encoder(4032);
  NodeGroup group;
  CHECK_THROWS_AS(encoder.add(group), std::invalid_argument);
  group.children.resize(9);
  CHECK_THROWS_AS(encoder.add(group), std::invalid_argument);
}

TEST_CASE("node page: every truncation and wrong count is refused", "[format][nodes]") {
  Random random(7);
  const Bytes payload = page_of({random_group(random, 3, 2), random_group(random, 8, 41)});
  CHECK(clause(payload, 2) == "none");
  for (std::size_t n = 0; n < payload.size(); ++n) {
    CHECK(clause(Bytes(payload.begin(), payload.begin() + static_cast<std::ptrdiff_t>(n)), 2) ==
          "spec/nodes.md#node-slots");
  }
  for (const std::uint32_t count : {0u, 1u, 3u, 5u, 60000u, 0xffffffffu}) {
    CHECK(clause(payload, count) != "none");
  }
}

TEST_CASE("node page: any value of any byte is refused or safe to read", "[format][nodes]") {
  for (const bool may_emit : {false, true}) {
    Random random(8);
    std::vector<NodeGroup> groups;
    for (const int level : {0, 21, 42, 60}) {
      const bool emits = may_emit && level % 2 == 0;
      groups.push_back(random_group(random, 1 + random.below(4), level, emits));
    }
    const Bytes payload = page_of(groups);
    const auto count = static_cast<std::uint32_t>(groups.size());
    unsigned wrong = 0;
    unsigned refused = 0;
    for (std::size_t at = 0; at < payload.size(); ++at) {
      for (unsigned value = 0; value < 256; ++value) {
        Bytes bytes = payload;
        bytes[at] = static_cast<std::byte>(value);
        if (clause(bytes, count, may_emit) != "none") {
          ++refused;
          continue;
        }
        const NodePage page(bytes.data(), count);
        for (std::uint32_t slot = 0; slot < count; ++slot) {
          const NodeGroup group = page.decode(slot);
          wrong += group.level > kMaxLevel || group.children.empty() || group.children.size() > 8;
          wrong += cell_of(group.cell, std::min(group.level, kLatticeBits)) != group.cell;
          wrong += emits_light(group) && !may_emit;
          for (const NodeChild& child : group.children) {
            wrong += !finite(child.node);
            wrong += !reference_in_bounds(child.ref);
          }
        }
      }
    }
    CHECK(wrong == 0);
    CHECK(refused > 5000);
  }
}

TEST_CASE("node page: only a file with emission has groups that emit", "[format][nodes]") {
  Random random(12);
  const Bytes payload = page_of({random_group(random, 2, 7), random_group(random, 3, 7, true)});
  CHECK(clause(payload, 2, true) == "none");
  CHECK(clause(payload, 2, false) == "spec/nodes.md#node-mask");
}

TEST_CASE("node page: a broken rule is named", "[format][nodes]") {
  NodeGroup group;
  group.level = 3;
  group.cell = encode_morton({5ull << 39, 0, 0});
  group.children.resize(3);  // 24 + 186 bytes, 6 of padding; the group starts at 8
  for (NodeChild& child : group.children) child.ref.point_count = 2;
  group.children[1].ref = {true, 7, 1, 0, 0};
  const Bytes payload = page_of({group});
  REQUIRE(payload.size() == 8 + 216);
  const auto with = [&](std::size_t at, auto value, bool may_emit = false) {
    return changed(payload, 1, at, value, may_emit);
  };
  CHECK(with(0, std::uint16_t{2}) == "spec/nodes.md#node-slots");
  CHECK(with(2, std::uint16_t{1}) == "spec/nodes.md#node-zero");
  CHECK(with(8, ~std::uint64_t{0}) == "spec/nodes.md#node-cell");
  CHECK(with(8, 5ull << 53) == "spec/nodes.md#node-cell");
  CHECK(with(16, std::uint64_t{1}) == "spec/nodes.md#node-cell");
  CHECK(with(24, std::uint8_t{63}) == "spec/nodes.md#node-level");
  CHECK(with(25, std::uint8_t{0}) == "spec/nodes.md#node-children");
  CHECK(with(25, std::uint8_t{9}) == "spec/nodes.md#node-children");
  CHECK(with(25, std::uint8_t{4}) == "spec/nodes.md#node-slots");
  CHECK(with(26, std::uint8_t{8}) == "spec/nodes.md#node-mask");
  CHECK(with(27, std::uint8_t{1}) == "spec/nodes.md#node-mask");
  CHECK(with(27, std::uint8_t{1}, true) == "spec/nodes.md#node-slots");  // it would be longer
  for (unsigned flags = 2; flags < 256; ++flags) {
    CHECK(with(27, static_cast<std::uint8_t>(flags), true) == "spec/nodes.md#node-mask");
  }
  CHECK(with(28, std::uint32_t{1}) == "spec/nodes.md#node-zero");
  CHECK(with(32, kPoints - 2 + (2ull << 48)) == "none");
  CHECK(with(32, kPoints - 1 + (2ull << 48)) == "spec/nodes.md#node-leaf");
  CHECK(with(32, kPoints + 1 + (2ull << 48)) == "spec/nodes.md#node-leaf");
  CHECK(with(32, std::uint64_t{0}) == "spec/nodes.md#node-leaf");
  CHECK(with(40, std::uint64_t{kPages}) == "spec/nodes.md#node-reference");
  CHECK(with(40, 1ull << 48) == "spec/nodes.md#node-zero");
  CHECK(with(8 + 48 + 6 * 3, std::uint16_t{0xff00}) == "spec/nodes.md#node-number");  // radius
  CHECK(with(8 + 48 + 6 * 3, std::uint16_t{0xfeff}) == "none");
  CHECK(with(8 + 48 + 6 * 6 + 4, std::uint16_t{0xffff}) == "spec/nodes.md#node-number");  // area
  CHECK(with(8 + 48 + 6 * 7 + 2, std::uint16_t{0xff00}) ==
        "spec/nodes.md#node-number");  // thickness
  CHECK(with(8 + 48 + 6 * 8, std::uint16_t{0xff00}) ==
        "spec/nodes.md#node-number");  // greatest radius
  CHECK(with(8 + 48 + 6 * 8 + 4, std::uint16_t{0xfeff}) == "none");
  CHECK(with(8 + 48 + 6 * 9, std::uint16_t{0xffff}) == "none");  // facing
  CHECK(with(8 + 210, std::uint16_t{1}) == "spec/nodes.md#node-zero");
  CHECK(with(8 + 214, std::uint16_t{1}) == "spec/nodes.md#node-zero");
}
