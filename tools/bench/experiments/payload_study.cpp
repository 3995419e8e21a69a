// Study of the axes payload and node (model.h). Nothing but the payload differs between two rows:
// each receiver is gathered by itself, with one cut through one tree for all payloads.
//
//   points -> Tree -> cut -+-> nodes -> see() of the payload -> discs -+-> pixels -> shading
//                          `-> near points ----------------------------'
//
// The reference draws all surfels into the same pixels, so the pixels' own error cancels.
#include <algorithm>
#include <cmath>
#include <functional>
#include <tuple>
#include <utility>

#include <glm/geometric.hpp>

#include "engine/base/memory.h"
#include "engine/base/numbers.h"
#include "engine/octree/subtree.h"
#include "engine/shade/reference/brute_force.h"
#include "engine/shade/reference/plain_gather.h"
#include "engine/store/container_points.h"
#include "format/scalar.h"
#include "tools/bench/experiments/model.h"
#include "tools/bench/experiments/payload.h"
#include "tools/bench/references/timed_runs.h"

namespace ptc::bench {
namespace {

// Bytes of reference, mean, radius, cone and thickness of a child (spec/nodes.md).
constexpr double kBoundsBytes = 22;
// Bytes of a child as floats: the reference and 34 numbers.
constexpr double kFloatNodeBytes = 8 + 34 * sizeof(float);

/// A node of the tree.
struct Node {
  NodeSummary summary;                          ///< summary in cell coordinates
  glm::dvec3 mean{0};                           ///< scene units
  glm::vec3 normal{0};                          ///< mean over the area, not unit
  float flatness = 0;                           ///< length of `normal`
  float radius = 0, thickness = 0;              ///< scene units
  std::uint64_t first_point = 0, points = 0;    ///< all points below it
  std::uint32_t first_child = 0, children = 0;  ///< no children: a leaf
};

/// What one receiver sees: nodes that stand for all their points, and single points.
struct Cut {
  std::vector<std::uint32_t> nodes;
  std::vector<std::uint64_t> points;
};

/// The octree of a container in memory, built again from its points. Its summaries are those of the
/// builder, in floating point, or those that were rounded by a node page.
class Tree {
 public:
  Tree(const ContainerReader& container, bool stored)
      : frame_(container.header().frame), stored_(stored) {
    std::vector<PointRecord> points(static_cast<std::size_t>(container.superblock().points));
    static_cast<void>(ContainerPoints(container).next(points));
    SubtreeBuilder builder(container.superblock().leaf_points, frame_.unit());
    root_ = builder
                .build(points, 0, 0,
                       [this](const NodeGroup& group, std::uint64_t) { return add(group); })
                .ref;
  }

  [[nodiscard]] const std::vector<Node>& nodes() const { return nodes_; }
  [[nodiscard]] Cut cut(std::span<const Surfel> surfels, const Receiver& receiver,
                        float solid_angle) const;

 private:
  ChildRef add(const NodeGroup& group) {
    const auto first = static_cast<std::uint32_t>(nodes_.size());
    const NodeGroup kept = stored_ ? through_page(group) : group;
    for (const NodeChild& child : kept.children) nodes_.push_back(node_of(child));
    groups_.emplace_back(first, static_cast<std::uint32_t>(group.children.size()));
    return {.interior = true, .page = static_cast<std::uint32_t>(groups_.size() - 1)};
  }

  /// Encodes a group into a node page and decodes it.
  static NodeGroup through_page(const NodeGroup& group) {
    NodePageEncoder page(std::size_t{1} << 12);
    page.add(group);
    const std::vector<std::byte> payload = page.take();
    return NodePage(payload.data(), 1).decode(0);
  }

  [[nodiscard]] Node node_of(const NodeChild& child) const {
    Node node{.summary = child.node};
    const NodeSummary& s = child.node;
    const double unit = frame_.unit();
    for (int k = 0; k < 3; ++k) {
      const auto axis = static_cast<std::size_t>(k);
      node.mean[k] = frame_.origin[axis] + s.mean[axis] * unit;
      if (s.area > 0)
        node.normal[k] = static_cast<float>((s.facing[2 * axis] - s.facing[2 * axis + 1]) / s.area);
    }
    node.flatness = glm::length(node.normal);
    node.radius = static_cast<float>(unit * s.radius);
    node.thickness = static_cast<float>(unit * s.thickness);
    node.first_point = child.ref.first_point;
    node.points = child.ref.point_count;
    if (child.ref.interior) {
      std::tie(node.first_child, node.children) = groups_[child.ref.page];
      node.first_point = nodes_[node.first_child].first_point;
      node.points = 0;
      for (std::uint32_t i = 0; i < node.children; ++i)
        node.points += nodes_[node.first_child + i].points;
    }
    return node;
  }

  Frame frame_;
  bool stored_;
  std::vector<Node> nodes_;  ///< siblings next to each other, children before parents
  /// First node and number of nodes of each group, by the page of a reference to it.
  std::vector<std::pair<std::uint32_t, std::uint32_t>> groups_;
  ChildRef root_;
};

/// Cuts the tree by the rules of PlainGather.
Cut Tree::cut(std::span<const Surfel> surfels, const Receiver& receiver, float solid_angle) const {
  Cut cut;
  std::vector<std::uint32_t> stack;
  const auto push = [&](std::uint32_t first, std::uint32_t count) {
    for (std::uint32_t i = 0; i < count; ++i) stack.push_back(first + i);
  };
  if (root_.interior) push(groups_[root_.page].first, groups_[root_.page].second);
  while (!stack.empty()) {
    const std::uint32_t at = stack.back();
    stack.pop_back();
    const Node& node = nodes_[at];
    const glm::vec3 to(node.mean - receiver.position);
    const glm::vec3 slab = node.flatness > 0 ? node.normal / node.flatness : glm::vec3(0);
    if (height_of_top(to, receiver.normal, node.radius, slab, node.thickness) <= 0) continue;
    if (kPi * node.radius * node.radius < solid_angle * glm::dot(to, to)) {
      cut.nodes.push_back(at);
    } else if (node.children > 0) {
      push(node.first_child, node.children);
    } else {
      for (std::uint64_t k = node.first_point; k < node.first_point + node.points; ++k) {
        const Surfel& s = surfels[static_cast<std::size_t>(k)];
        const glm::vec3 away(s.position - receiver.position);
        if (s.radius > 0 && height_of_top(away, receiver.normal, s.radius, s.normal, 0) > 0)
          cut.points.push_back(k);
      }
    }
  }
  return cut;
}

/// A disc relative to its receiver.
struct Disc {
  glm::vec3 to, normal;
  float radius;
  std::uint32_t rgbe;
};

/// Evaluates a payload of a node towards a viewer.
using See = std::function<Seen(std::uint32_t node, const glm::vec3& toward)>;

std::uint32_t pack(const glm::vec3& colour) {
  return encode_rgbe({colour.r, colour.g, colour.b});
}

/// Fits a payload to every node of a tree. @return count() numbers for each node
std::vector<float> fit_all(const Payload& payload, const Tree& tree,
                           std::span<const Surfel> surfels, const Executor& executor) {
  const std::vector<Node>& nodes = tree.nodes();
  std::vector<float> numbers(nodes.size() * payload.count());
  executor.for_each(nodes.size(), [&](std::size_t i, unsigned) {
    payload.fit(nodes[i].summary, surfels.subspan(nodes[i].first_point, nodes[i].points),
                &numbers[i * payload.count()]);
  });
  return numbers;
}

See seen_by(const Payload& payload, const std::vector<float>& numbers) {
  return
      [&payload, &numbers, stride = payload.count()](std::uint32_t node, const glm::vec3& toward) {
        return payload.see(&numbers[node * stride], toward);
      };
}

/// Shades the receivers with any payload, and compares with all surfels in the same pixels.
class Study {
 public:
  Study(const BenchScene& scene, std::span<const Receiver> receivers, const ModelOptions& options,
        const Executor& executor)
      : scene_(scene),
        receivers_(receivers),
        options_(options),
        executor_(executor),
        grid_(options.study_resolution, {}),
        truth_(receivers.size()),
        cuts_(receivers.size()),
        discs_(receivers.size()) {
    shade_brute_force(scene.surfels(), receivers, truth_, grid_, Sides::both, executor);
  }

  /// Cuts a tree for all receivers. Rows are measured with these cuts from then on.
  void set_cuts(const Tree& tree, float solid_angle) {
    tree_ = &tree;
    solid_angle_ = solid_angle;
    cut_cost_ = for_each(
        [&](std::size_t i) { cuts_[i] = tree.cut(scene_.surfels(), receivers_[i], solid_angle); });
  }

  /// Measures one payload. The time of a receiver is that of its cut, its payloads and its pixels.
  [[nodiscard]] ModelRow measure(const char* axis, const char* variant, const char* form,
                                 double bytes, const See& see) {
    Costs evaluate, whole;
    std::vector<Shading> results(receivers_.size());
    for (unsigned repeat = 0; repeat < options_.repeats; ++repeat) {
      Cost cost = for_each([&](std::size_t i) { add_discs(i, see); });
      evaluate.add(cost);
      cost += cut_cost_;
      cost += for_each([&](std::size_t i) { results[i] = draw(i); });
      whole.add(cost);
    }
    ModelRow row{.scene = scene_.name(),
                 .axis = axis,
                 .variant = variant,
                 .form = form,
                 .solid_angle = static_cast<double>(solid_angle_),
                 .bytes = bytes,
                 .per = "node",
                 .us = whole.cpu_us(receivers_.size()),
                 .wall_us = whole.wall_us(receivers_.size()),
                 .evaluate_us = evaluate.cpu_us(receivers_.size()).median};
    compare(row, results, truth_);
    return row;
  }

 private:
  /// Calls body(i) for every receiver.
  Cost for_each(const std::function<void(std::size_t)>& body) const {
    return timed(
        [&] { executor_.for_each(receivers_.size(), [&](std::size_t i, unsigned) { body(i); }); });
  }

  /// Makes the discs that stand for the nodes of receiver i's cut.
  void add_discs(std::size_t i, const See& see) {
    discs_[i].clear();
    for (const std::uint32_t at : cuts_[i].nodes) {
      const Node& node = tree_->nodes()[at];
      const glm::vec3 to(node.mean - receivers_[i].position);
      const glm::vec3 toward = -glm::normalize(to);
      const ClusterShape shape{node.normal, static_cast<float>(node.summary.area), node.radius,
                               node.thickness};
      const Seen seen = see(at, seen_from(shape, toward));
      const float projected = std::max(seen.front, seen.back);
      if (!(projected > 0)) continue;
      const Splat splat = make_splat(shape, toward, projected, GatherOptions{}.inflation);
      const float lit = lit_area(splat, seen.front, projected);
      const float dim = lit > 0 ? seen.front / lit : 0;
      discs_[i].push_back({to, splat.normal, splat.radius, pack(seen.radiance * dim)});
    }
  }

  /// Draws the discs and points of receiver i, and sums the pixels.
  [[nodiscard]] Shading draw(std::size_t i) const {
    DirectionBuffer buffer(grid_.resolution());
    DiscQueue queue;
    const auto push = [&](const Disc& disc) {
      queue.push(disc.to, disc.normal, disc.radius, disc.rgbe);
      if (!queue.full()) return;
      buffer.draw(grid_, queue, Sides::both);
      queue.size = 0;
    };
    for (const Disc& disc : discs_[i]) push(disc);
    for (const std::uint64_t k : cuts_[i].points) {
      const Surfel& s = scene_.surfels()[static_cast<std::size_t>(k)];
      push({glm::vec3(s.position - receivers_[i].position), s.normal, s.radius, pack(s.radiance)});
    }
    buffer.draw(grid_, queue, Sides::both);
    return buffer.resolve(grid_, receivers_[i].normal);
  }

  const BenchScene& scene_;
  std::span<const Receiver> receivers_;
  const ModelOptions& options_;
  const Executor& executor_;
  DirectionGrid grid_;
  std::vector<Shading> truth_;
  const Tree* tree_ = nullptr;
  float solid_angle_ = 0;
  Cost cut_cost_;
  std::vector<Cut> cuts_;
  std::vector<std::vector<Disc>> discs_;
};

}  // namespace

std::vector<ModelRow> study_payloads(const BenchScene& scene, std::span<const Receiver> receivers,
                                     const ModelOptions& options, const Executor& executor,
                                     Progress& progress) {
  // Build the trees, with summaries as floats and as stored
  const std::span<const Surfel> surfels = scene.surfels();
  const Tree exact(scene.container(), false), stored(scene.container(), true);
  progress.begin(scene.name() + ", payloads", options.solid_angles.size() * (payloads().size() + 1),
                 "rows");
  Study study(scene, receivers, options, executor);
  // Fit all payloads
  std::vector<std::vector<float>> floats, rounded;
  for (const Payload& payload : payloads()) {
    floats.push_back(fit_all(payload, exact, surfels, executor));
    rounded.push_back(floats.back());
    for (std::size_t at = 0; at < rounded.back().size(); at += payload.count())
      payload.round(&rounded.back()[at]);
  }
  const auto cube = static_cast<std::size_t>(
      std::ranges::find(payloads(), std::string_view("cube"),
                        [](const Payload& p) { return std::string_view(p.name); }) -
      payloads().begin());
  const std::vector<float> as_stored = fit_all(payloads()[cube], stored, surfels, executor);

  // Measure them at each solid angle
  std::vector<ModelRow> rows;
  for (const float solid_angle : options.solid_angles) {
    study.set_cuts(exact, solid_angle);
    for (std::size_t i = 0; i < payloads().size(); ++i) {
      const Payload& p = payloads()[i];
      const auto float_bytes = kBoundsBytes + static_cast<double>(p.count() * sizeof(float));
      const auto bytes = kBoundsBytes + static_cast<double>(p.stored_bytes());
      rows.push_back(study.measure("payload", p.name, "stored", bytes, seen_by(p, rounded[i])));
      rows.push_back(study.measure("payload", p.name, "float", float_bytes, seen_by(p, floats[i])));
      if (i == cube)
        rows.push_back(
            study.measure("node", "all columns", "float", kFloatNodeBytes, seen_by(p, floats[i])));
      progress.advance(1);
    }
    rows.push_back(study.measure(
        "payload", "exact", "float", kNone, [&](std::uint32_t at, const glm::vec3& toward) {
          const Node& node = exact.nodes()[at];
          return see_exactly(surfels.subspan(node.first_point, node.points), toward);
        }));
    study.set_cuts(stored, solid_angle);
    const double whole = kBoundsBytes + static_cast<double>(payloads()[cube].stored_bytes());
    rows.push_back(study.measure("node", "all columns", "stored", whole,
                                 seen_by(payloads()[cube], as_stored)));
    progress.advance(1);
  }
  progress.end();
  return rows;
}

}  // namespace ptc::bench
