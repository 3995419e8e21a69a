// verify_container() and the content of pages: faults under correct checksums.
#include <algorithm>
#include <cmath>
#include <cstring>
#include <functional>
#include <iterator>
#include <string>

#include <catch2/catch.hpp>

#include "engine/verify/verify.h"
#include "format/node_layout.h"
#include "format/node_page.h"
#include "format/scalar.h"
#include "tests/support/scenes.h"
#include "tests/verify/damage.h"

namespace ptc::test {
namespace {

/// One number of a group's child: its place, and by how much to change it.
struct Edit {
  const char* what;
  std::size_t bytes;  ///< 1 or 2
  int by;
  std::function<std::size_t(const GroupView&, int)> at;  ///< offset from the group's first byte
};

std::size_t column(const GroupView& group, int child, std::size_t k) {
  return 24 + 8 * static_cast<std::size_t>(group.size()) +
         2 * (static_cast<std::size_t>(group.size()) * k + static_cast<std::size_t>(child));
}

/// Returns edits of each component of six columns of rgbe, one for each axis.
/// @param first  number of the first of them, in columns of 2 bytes
std::vector<Edit> light_edits(const char* what, std::size_t first) {
  std::vector<Edit> all;
  for (std::size_t k = 0; k < 6; ++k) {
    for (std::size_t c = 0; c < 4; ++c) {
      all.push_back({what, 1, c < 3 ? 5 : 1, [first, k, c](const GroupView& g, int i) {
                       return column(g, 0, first + 2 * k) + 4 * static_cast<std::size_t>(i) + c;
                     }});
    }
  }
  return all;
}

std::vector<Edit> edits() {
  std::vector<Edit> all;
  const std::array<const char*, 9> names{"mean x",   "mean y", "mean z",    "radius",  "cone axis",
                                         "cone cos", "area",   "thickness", "greatest"};
  for (std::size_t k = 0; k < names.size(); ++k) {
    for (const int by : {-4, 4}) {
      all.push_back({names[k], 2, by, [k](const GroupView& g, int i) { return column(g, i, k); }});
    }
  }
  for (std::size_t k = 0; k < 6; ++k) {
    for (const int by : {-2, 2}) {
      all.push_back(
          {"facing", 2, by, [k](const GroupView& g, int i) { return column(g, i, kFacing + k); }});
    }
  }
  for (const int by : {-36, 36}) {  // 0.001 rad and more at any angle
    all.push_back(
        {"cone cos", 2, by, [](const GroupView& g, int i) { return column(g, i, kConeCos); }});
  }
  std::ranges::move(light_edits("radiance", kRadiance), std::back_inserter(all));
  return all;
}

std::filesystem::path write_raw(const std::filesystem::path& path,
                                const std::vector<Surfel>& surfels, const BuildOptions& tree) {
  write_scene(path, surfels, tree, 12, Codec::raw);
  return path;
}

/// A container of raw pages that is changed and verified.
struct Specimen {
  TemporaryDirectory directory;
  OpenContainer container;

  explicit Specimen(const std::vector<Surfel>& surfels, const BuildOptions& tree = {})
      : container(write_raw(directory / "scene.ptcx", surfels, tree)) {}

  /// Returns what verify_container() reports about the container as it is now, for any number of
  /// threads.
  [[nodiscard]] std::string fault() {
    container.write(directory / "wrong.ptcx");
    const std::string found = fault_of(directory / "wrong.ptcx");
    CHECK(fault_of(directory / "wrong.ptcx", 3) == found);
    return found;
  }
};

/// Calls edit(first byte of the group, the group, child) for every child of every group.
template <class Body>
void for_each_child(OpenContainer& container, Body&& body) {
  for (std::size_t page = 0; page < container.pages(); ++page) {
    if (container.header(page).type != PageType::node) continue;
    const std::span<std::byte> payload = container.payload(page);
    const NodePage nodes(payload.data(), container.header(page).record_count);
    for (std::uint32_t slot = 0; slot < nodes.size(); ++slot) {
      const GroupView group = nodes[slot];
      std::byte* start = payload.data() + (group.mean_x() - column(group, 0, 0) - payload.data());
      for (int child = 0; child < group.size(); ++child) body(start, group, child);
    }
  }
}

/// Returns true when no reader can see the difference: the light of an axis that nothing faces, a
/// number at the end of its range, or a change below the verifier's tolerance.
bool is_moot(const Edit& edit, const GroupView& group, int child, std::size_t at, long before) {
  const bool emission = std::strcmp(edit.what, "emission") == 0;
  if (emission || std::strcmp(edit.what, "radiance") == 0) {
    const auto k = static_cast<int>((at - column(group, 0, emission ? kEmission : kRadiance)) / 4) /
                   group.size();
    std::uint32_t rgbe;
    std::memcpy(&rgbe, (emission ? group.emission(k) : group.radiance(k)) + 4 * child, 4);
    return GroupView::u16_at(group.facing(k), child) == 0 || (rgbe & 0xffffff) == 0 ||
           before + edit.by > 255;
  }
  if (std::strcmp(edit.what, "cone axis") == 0) return false;
  if (std::strcmp(edit.what, "thickness") == 0) {  // that of a plane is below the tolerance of sums
    const double radius =
        static_cast<double>(decode_ufloat16(GroupView::u16_at(group.radius(), child)));
    return static_cast<double>(decode_ufloat16(static_cast<std::uint16_t>(before))) < 1e-4 * radius;
  }
  if (std::strcmp(edit.what, "cone cos") == 0) {
    // Half angles may differ by 0.001 rad, and cosines by some of a step of what rounds them down.
    const auto cosine = static_cast<std::int16_t>(before);
    const auto angle = [](int steps) { return std::acos(std::clamp(steps / 32767.0, -1.0, 1.0)); };
    const int clear = cosine + edit.by - (edit.by < 0 ? -2 : 2);
    return cosine + edit.by < -32767 || cosine + edit.by > 32767 ||
           std::abs(angle(clear) - angle(cosine)) <= 1e-3;
  }
  return before + edit.by < 0 || before + edit.by > 65535;
}

/// Makes each edit of each child of each group, and checks that a rule of nodes refuses it.
/// @return  the number of edits
std::size_t check_edits(Specimen& specimen, const std::vector<Edit>& edits) {
  std::size_t tried = 0;
  for (const Edit& edit : edits) {
    std::vector<std::string> missed;
    std::size_t found = 0;
    for_each_child(specimen.container, [&](std::byte* start, const GroupView& group, int child) {
      if (std::strcmp(edit.what, "emission") == 0 && !group.emits()) return;
      const std::size_t at = edit.at(group, child);
      std::uint16_t before = 0;
      std::memcpy(&before, start + at, edit.bytes);
      if (is_moot(edit, group, child, at, before)) return;
      const auto after = static_cast<std::uint16_t>(before + edit.by);
      std::memcpy(start + at, &after, edit.bytes);
      const std::string fault = specimen.fault();
      if (fault.find("spec/nodes.md#node-") == std::string::npos) {
        missed.push_back(std::to_string(before) + ": " + fault);
      } else {
        ++found;
      }
      std::memcpy(start + at, &before, edit.bytes);
      ++tried;
    });
    INFO(edit.what << " by " << edit.by << ", " << found << " found");
    CHECK(missed == std::vector<std::string>{});
    CHECK(found > 0);
  }
  return tried;
}

}  // namespace

TEST_CASE("verify: a wrong number in any node is found under correct checksums", "[verify]") {
  Specimen specimen(small_scene(), {.leaf_points = 12});
  REQUIRE(specimen.fault() == "");
  CHECK(check_edits(specimen, edits()) > 500);
}

TEST_CASE("verify: a wrong emission of any node is found under correct checksums", "[verify]") {
  std::vector<Surfel> surfels = small_scene();
  for (std::size_t i = 0; i < surfels.size(); i += 3) surfels[i].emission = {2, 1, 0.5F};
  Specimen specimen(surfels, {.leaf_points = 12});
  REQUIRE(specimen.container.superblock().header.point_bytes == kEmittingPointBytes);
  REQUIRE(specimen.fault() == "");
  CHECK(check_edits(specimen, light_edits("emission", kEmission)) > 100);
}

TEST_CASE("verify: a reference that leads elsewhere is found under correct checksums", "[verify]") {
  Specimen specimen(small_scene(), {.leaf_points = 4});
  OpenContainer& container = specimen.container;
  std::size_t tried = 0;
  for_each_child(container, [&](std::byte* start, const GroupView& group, int child) {
    const bool interior = group.child(child).interior;
    std::byte* place = start + 24 + 8 * child;
    std::uint64_t before = 0;
    std::memcpy(&before, place, 8);
    for (std::uint64_t by = 1; by < 6; ++by) {  // other groups, other first points, other counts
      for (const std::uint64_t after :
           {before + (by << (interior ? 32 : 0)), before + (by << (interior ? 0 : 48))}) {
        std::memcpy(place, &after, 8);
        CHECK(specimen.fault() != "");
        ++tried;
      }
    }
    std::memcpy(place, &before, 8);
  });
  CHECK(tried > 300);
}

TEST_CASE("verify: a group with a wrong level or cell is found under correct checksums",
          "[verify]") {
  Specimen specimen(small_scene(), {.leaf_points = 4});
  OpenContainer& container = specimen.container;
  for_each_child(container, [&](std::byte* start, const GroupView& group, int child) {
    if (child != 0) return;
    for (const int by : {-2, -1, 1, 2}) {
      const std::byte before = start[16];
      if (static_cast<int>(before) + by < 0) continue;
      start[16] = static_cast<std::byte>(static_cast<int>(before) + by);
      CHECK(specimen.fault() != "");
      start[16] = before;
    }
    if (group.level() == 0) return;
    std::uint64_t cell = 0;
    std::memcpy(&cell, start, 8);
    for (int digit = 0; digit < group.level(); ++digit) {
      const std::uint64_t moved = cell ^ std::uint64_t{1} << (60 - 3 * digit);
      std::memcpy(start, &moved, 8);
      CHECK(specimen.fault() != "");
    }
    std::memcpy(start, &cell, 8);
  });
}

TEST_CASE("verify: a page header that contradicts its page is found under correct checksums",
          "[verify]") {
  Specimen specimen(random_surfels(500, 4));
  OpenContainer& container = specimen.container;
  const auto fault = [&](std::size_t page, const std::function<void(PageHeader&)>& edit) {
    const PageHeader before = container.header(page);
    edit(container.header(page));
    const std::string found = specimen.fault();
    container.header(page) = before;
    return found;
  };
  for (std::size_t page = 0; page + 1 < container.pages(); ++page) {
    const bool points = container.header(page).type == PageType::point;
    if (points) {
      CHECK(fault(page, [](PageHeader& h) { h.first_key -= h.first_key > 0 ? 1 : 0; }).empty() ==
            (container.header(page).first_key == 0));
      CHECK(fault(page, [](PageHeader& h) { ++h.last_key; }) != "");
    } else {
      CHECK(fault(page, [](PageHeader& h) { ++h.level; }) != "");
    }
  }
}

TEST_CASE("verify: wrong totals in the superblock are found under correct checksums", "[verify]") {
  Specimen specimen(small_scene());
  const auto fault = [&](const std::function<void(Superblock&)>& edit) {
    const Superblock before = specimen.container.superblock();
    edit(specimen.container.superblock());
    const std::string found = specimen.fault();
    specimen.container.superblock() = before;
    return found;
  };
  CHECK(fault([](Superblock&) {}) == "");
  using Catch::Matchers::Contains;
  CHECK_THAT(fault([](Superblock& s) { s.area *= 1.00001; }), Contains("superblock-totals"));
  CHECK_THAT(fault([](Superblock& s) { s.flux[1] *= 0.9999; }), Contains("superblock-totals"));
  CHECK_THAT(fault([](Superblock& s) { s.bounds_low[2] -= 1e-9; }), Contains("superblock-totals"));
  CHECK_THAT(fault([](Superblock& s) { s.bounds_high[0] += 1; }), Contains("superblock-totals"));
  CHECK_THAT(fault([](Superblock& s) { ++s.nodes; }), Contains("superblock-counts"));
  CHECK_THAT(fault([](Superblock& s) { --s.nodes; }), Contains("superblock-counts"));
  CHECK_THAT(fault([](Superblock& s) { --s.points; }), Contains("superblock-counts"));
  CHECK_THAT(fault([](Superblock& s) { ++s.levels; }), Contains("superblock-root"));
  CHECK_THAT(fault([](Superblock& s) { s.leaf_points = 10; }), Contains("node-leaf"));
  CHECK_THAT(fault([](Superblock& s) { s.leaf_points = 40; }), Contains("node-leaf"));
  CHECK(fault([](Superblock& s) { ++s.root_slot; }) != "");
  CHECK(fault([](Superblock& s) { s.header.frame.edge *= 2; }) != "");
  CHECK(fault([](Superblock& s) { s.header.frame.origin[0] += s.header.frame.unit(); }) != "");
}

TEST_CASE("verify: points that descend from page to page are found, and no tree is built of them",
          "[verify]") {
  Specimen specimen(random_surfels(500, 4));
  OpenContainer& container = specimen.container;
  std::vector<std::size_t> pages;
  for (std::size_t page = 0; page < container.pages(); ++page) {
    if (container.header(page).type == PageType::point) pages.push_back(page);
  }
  REQUIRE(pages.size() > 3);
  std::ranges::swap_ranges(container.payload(pages[1]), container.payload(pages[2]));
  std::swap(container.header(pages[1]).first_key, container.header(pages[2]).first_key);
  std::swap(container.header(pages[1]).last_key, container.header(pages[2]).last_key);
  CHECK_THAT(specimen.fault(), Catch::Matchers::Contains("spec/points.md#point-order"));
  Progress silent;
  const VerifyReport report =
      verify_container(specimen.directory / "wrong.ptcx", {.level = VerifyLevel::rebuild}, silent);
  CHECK(report.tree_checked);
  CHECK_FALSE(report.tree_digest);
}

TEST_CASE("verify: a point that moved is found under correct checksums", "[verify]") {
  Specimen specimen(small_scene());
  OpenContainer& container = specimen.container;
  struct PointEdit {
    std::size_t column;  ///< bytes of a point before it
    std::size_t bytes;
    std::uint32_t by;
  };
  for (std::size_t page = 0; page < container.pages(); ++page) {
    if (container.header(page).type != PageType::point) continue;
    const std::size_t count = container.header(page).record_count;
    for (std::size_t i = 0; i < count; ++i) {
      // x by a thousandth, normal by 0.01, radiance by 4 per cent, radius by 6 per cent
      for (const PointEdit& edit :
           {PointEdit{0, 4, 1U << 31}, {20, 2, 400}, {24, 2, 40}, {16, 4, 1U << 19}}) {
        std::byte* place = container.payload(page).data() + edit.column * count + edit.bytes * i;
        std::uint32_t value = 0;
        std::memcpy(&value, place, edit.bytes);
        const std::uint32_t after = value + edit.by;
        std::memcpy(place, &after, edit.bytes);
        CHECK(specimen.fault() != "");
        std::memcpy(place, &value, edit.bytes);
      }
    }
  }
}

}  // namespace ptc::test
