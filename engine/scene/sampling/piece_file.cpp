// The external sorts of the engine carry 24 bytes behind a key. A row takes several of them: sorts
// keep records of one key in the order in which they came, so that all give the same order, and the
// parts of a row come out together.
#include "engine/scene/sampling/piece_file.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <stdexcept>
#include <unordered_map>
#include <utility>

#include <glm/common.hpp>

#include "engine/base/basis.h"
#include "engine/io/file/disk_space.h"
#include "engine/sort/external_sort.h"
#include "engine/sort/point_streams.h"
#include "engine/sort/record_values.h"
#include "format/point_record.h"

namespace ptc {
namespace {

constexpr std::uint64_t kBlockPieces = 256;
constexpr std::uint64_t kPatchPieces = std::uint64_t{1} << 14;  // in one patch, at most
constexpr std::size_t kRowsAtOnce = std::size_t{1} << 12;
// Surfels look for the surface up to this far beyond their patch: their radius is about 0.7
// spacings, and they look for 1.1 radii along the surface and 0.9 away from it.
constexpr float kMarginSpacings = 3;
// Runs of boxes in the next level, and of pieces in a block that is read
constexpr std::size_t kChildren = 8, kRunPieces = 16;
// Near a patch, a run whose box has this diagonal is one rectangle: a share of the least spacing in
// the patch, or of the distance, from which only surfels as large as that look. Where too many runs
// are left, the share is doubled.
constexpr float kRunShare = 0.25F;

}  // namespace

/// A piece and its triangle.
struct PieceFile::Row {
  MeshTriangle triangle;
  std::uint32_t path = 0;
};

template <class AnyRow, class Move>
void PieceFile::move_fields(AnyRow& row, const Move& move) const {
  move(&row.path, sizeof row.path);
  move(&row.triangle.material, sizeof row.triangle.material);
  move(row.triangle.positions.data(), sizeof row.triangle.positions);
  if (parts_.has_uvs()) move(row.triangle.uvs.data(), sizeof row.triangle.uvs);
  if (parts_.has_normals()) move(row.triangle.normals.data(), sizeof row.triangle.normals);
  if (parts_.has_colours()) move(row.triangle.colours.data(), sizeof row.triangle.colours);
}

void PieceFile::pack(const Row& row, std::byte* to) const noexcept {
  move_fields(row, [&](const void* field, std::size_t bytes) {
    std::memcpy(to, field, bytes);
    to += bytes;
  });
}

void PieceFile::unpack(const std::byte* from, Row& row) const noexcept {
  move_fields(row, [&](void* field, std::size_t bytes) {
    std::memcpy(field, from, bytes);
    from += bytes;
  });
}

PieceFile::Run PieceFile::run_of(const Row& row) {
  const SubTriangle shape = piece_of(whole_triangle(row.triangle.positions), row.path);
  const glm::vec3 a(shape.corner[0]), b(shape.corner[1]), c(shape.corner[2]);
  return {{glm::min(a, glm::min(b, c)), glm::max(a, glm::max(b, c))}, glm::cross(b - a, c - a)};
}

void PieceFile::merge(Run& into, const Run& other) {
  into.box = {glm::min(into.box.low, other.box.low), glm::max(into.box.high, other.box.high)};
  into.normal += other.normal;
}

PieceFile::PieceFile(const MeshParts& parts, const SurfaceSurvey& found, const SpacingField& field,
                     double surfels, const PieceSortOptions& options, const Executor& executor)
    : parts_(parts),
      field_(field),
      patch_surfels_(surfels),
      file_(*std::ranges::max_element(options.temp_dirs, {}, [](const std::filesystem::path& dir) {
        return free_bytes({&dir, 1});
      })) {
  const Row row;
  move_fields(row, [&](const void* /*field*/, std::size_t bytes) { row_bytes_ += bytes; });
  sort(found, options, executor);
}

std::size_t PieceFile::groups() const noexcept {
  return (row_bytes_ + kRecordValueBytes - 1) / kRecordValueBytes;
}

/// Writes the rows as they come out of the sorts, and closes patches and blocks.
class PieceFile::Writer {
 public:
  explicit Writer(PieceFile& to) : to_(to) { to_.levels_.emplace_back(); }

  void add(const std::byte* packed) {
    // Write the row
    buffer_.insert(buffer_.end(), packed, packed + to_.row_bytes_);
    if (buffer_.size() >= kBufferBytes) flush();
    // Measure the piece
    Row row;
    to_.unpack(packed, row);
    const SubTriangle shape = piece_of(whole_triangle(row.triangle.positions), row.path);
    const double spacing = spacing_of(shape, to_.field_, to_.parts_.origin());
    std::vector<Run>& blocks = to_.levels_[0];
    const Run run = run_of(row);
    if (pieces_ % kBlockPieces == 0) blocks.emplace_back();
    merge(blocks.back(), run);
    ++pieces_;
    weight_ += shape.area() / (spacing * spacing);
    widest_ = std::max(widest_, static_cast<float>(spacing));
    closest_ = std::min(closest_, static_cast<float>(spacing));
    if (weight_ - to_.weights_.back() >= to_.patch_surfels_ ||
        pieces_ - to_.begins_.back() >= kPatchPieces)
      close();
  }

  void finish() {
    flush();
    if (pieces_ > to_.begins_.back()) close();
    while (to_.levels_.back().size() > 1) add_level();
  }

 private:
  static constexpr std::size_t kBufferBytes = std::size_t{1} << 20;

  void close() {
    to_.begins_.push_back(pieces_);
    to_.weights_.push_back(weight_);
    to_.widest_.push_back(widest_);
    to_.closest_.push_back(closest_);
    widest_ = 0;
    closest_ = std::numeric_limits<float>::infinity();
  }
  void add_level() {
    std::vector<Run> next;
    const std::vector<Run>& last = to_.levels_.back();
    for (std::size_t i = 0; i < last.size(); ++i) {
      if (i % kChildren == 0) next.emplace_back();
      merge(next.back(), last[i]);
    }
    to_.levels_.push_back(std::move(next));
  }
  void flush() {
    to_.file_.write_at(written_, buffer_);
    written_ += buffer_.size();
    buffer_.clear();
  }

  PieceFile& to_;
  std::vector<std::byte> buffer_;
  std::uint64_t written_ = 0;
  std::uint64_t pieces_ = 0;
  double weight_ = 0;
  float widest_ = 0;
  float closest_ = std::numeric_limits<float>::infinity();
};

void PieceFile::sort(const SurfaceSurvey& found, const PieceSortOptions& options,
                     const Executor& executor) {
  // Begin the sorts. Pieces lie as close as triangles where these are small, and as surface where
  // they are large
  const Bounds& bounds = parts_.bounds();
  const glm::dvec3 extent = bounds.high - bounds.low;
  const double widest = std::max({extent.x, extent.y, extent.z});
  const auto key_of = [&](const glm::dvec3& world) {
    return MortonKey{.high = piece_place(world - bounds.low, widest)};
  };
  std::vector<MortonKey> sample;
  for (const glm::dvec3& place : found.by_area) sample.push_back(key_of(place));
  for (const glm::dvec3& place : found.by_count) sample.push_back(key_of(place));
  std::vector<std::unique_ptr<ExternalSorter>> sorts;
  for (std::size_t g = 0; g < groups(); ++g) {
    sorts.push_back(std::make_unique<ExternalSorter>(
        SortOptions{.memory_bytes = options.memory_bytes / groups(),
                    .temp_dirs = options.temp_dirs,
                    .expected = found.triangles,
                    .emits = true},
        executor, sample));
  }

  // Cut the triangles
  std::vector<std::byte> packed(groups() * kRecordValueBytes);
  std::vector<std::vector<PointRecord>> records(groups());
  const auto hand_on = [&] {
    for (std::size_t g = 0; g < groups(); ++g) {
      sorts[g]->add(records[g]);
      records[g].clear();
    }
  };
  parts_.visit([&](std::span<const MeshTriangle> triangles) {
    Row row;
    for (const MeshTriangle& triangle : triangles) {
      row.triangle = triangle;
      cut_into_pieces(whole_triangle(triangle.positions), field_, parts_.origin(),
                      [&](const SubTriangle& shape, std::uint32_t path) {
                        row.path = path;
                        pack(row, packed.data());
                        const MortonKey key = key_of(parts_.origin() + shape.centre());
                        for (std::size_t g = 0; g < groups(); ++g) {
                          PointRecord& record = records[g].emplace_back();
                          record.key = key;
                          std::memcpy(values_of(record), packed.data() + g * kRecordValueBytes,
                                      kRecordValueBytes);
                        }
                        if (records[0].size() >= kRowsAtOnce) hand_on();
                      });
    }
  });
  hand_on();

  // Write the rows
  std::vector<std::unique_ptr<PointStream>> streams;
  for (auto& sorter : sorts) streams.push_back(sorter->finish());
  Writer writer(*this);
  for (auto& block : records) block.resize(kRowsAtOnce);
  while (const std::size_t count = read_full(*streams[0], records[0])) {
    for (std::size_t g = 1; g < groups(); ++g) {
      if (read_full(*streams[g], std::span(records[g]).first(count)) != count)
        throw std::logic_error("PieceFile: the parts of a row have come apart");
    }
    for (std::size_t i = 0; i < count; ++i) {
      for (std::size_t g = 0; g < groups(); ++g)
        std::memcpy(packed.data() + g * kRecordValueBytes, values_of(records[g][i]),
                    kRecordValueBytes);
      writer.add(packed.data());
    }
  }
  writer.finish();
}

void PieceFile::read_rows(std::uint64_t first, std::span<Row> rows) const {
  std::vector<std::byte> bytes(rows.size() * row_bytes_);
  file_.read_at(first * row_bytes_, bytes);
  for (std::size_t i = 0; i < rows.size(); ++i) unpack(bytes.data() + i * row_bytes_, rows[i]);
}

/// Collects triangles, each once, with the materials that they have.
class PieceFile::LocalMesh {
 public:
  explicit LocalMesh(const MeshParts& parts) : parts_(parts) { mesh_.origin = parts.origin(); }

  /// Makes room for so many more triangles, so that vectors do not grow to twice what they hold.
  void reserve(std::size_t more) {
    const std::size_t triangles = mesh_.triangles.size() + more;
    mesh_.positions.reserve(3 * triangles);
    if (parts_.has_normals()) mesh_.normals.reserve(3 * triangles);
    if (parts_.has_uvs()) mesh_.uvs.reserve(3 * triangles);
    if (parts_.has_colours()) mesh_.colours.reserve(3 * triangles);
    mesh_.triangles.reserve(triangles);
    mesh_.material_of.reserve(triangles);
  }

  /// Adds a triangle that is not there yet. @return its index
  std::uint32_t add(const MeshTriangle& triangle) {
    // Triangles of equal positions and material are one
    std::uint64_t hash = triangle.material;
    std::array<std::uint32_t, 9> bits;
    std::memcpy(bits.data(), triangle.positions.data(), sizeof bits);
    for (const std::uint32_t word : bits) hash = (hash ^ word) * 0x9e3779b97f4a7c15U;
    const auto [first, last] = known_.equal_range(hash);
    for (auto at = first; at != last; ++at) {
      if (is_same(at->second, triangle)) return at->second;
    }
    const auto index = static_cast<std::uint32_t>(mesh_.triangles.size());
    known_.emplace(hash, index);
    const auto vertex = static_cast<std::uint32_t>(mesh_.positions.size());
    mesh_.positions.insert(mesh_.positions.end(), triangle.positions.begin(),
                           triangle.positions.end());
    if (parts_.has_normals())
      mesh_.normals.insert(mesh_.normals.end(), triangle.normals.begin(), triangle.normals.end());
    if (parts_.has_uvs())
      mesh_.uvs.insert(mesh_.uvs.end(), triangle.uvs.begin(), triangle.uvs.end());
    if (parts_.has_colours())
      mesh_.colours.insert(mesh_.colours.end(), triangle.colours.begin(), triangle.colours.end());
    mesh_.triangles.push_back({vertex, vertex + 1, vertex + 2});
    mesh_.material_of.push_back(material(triangle.material));
    return index;
  }

  /// Adds an opaque rectangle in the mean plane of a run, as wide as its box.
  void add_rectangle(const Run& run) {
    const glm::vec3 middle = 0.5F * (run.box.low + run.box.high);
    const glm::vec3 half = 0.5F * (run.box.high - run.box.low);
    glm::vec3 normal(0);
    if (glm::dot(run.normal, run.normal) > 0) {
      normal = glm::normalize(run.normal);
    } else {
      normal[half.x <= half.y && half.x <= half.z ? 0 : half.y <= half.z ? 1 : 2] = 1;
    }
    const Basis basis(normal);
    const glm::vec3 x = basis.x * glm::dot(glm::abs(basis.x), half),
                    y = basis.y * glm::dot(glm::abs(basis.y), half);
    if (x == glm::vec3(0) || y == glm::vec3(0)) return;  // a run on a line covers nothing
    const auto vertex = static_cast<std::uint32_t>(mesh_.positions.size());
    for (const glm::vec3& corner : {-x - y, x - y, x + y, -x + y}) {
      mesh_.positions.push_back(middle + corner);
      if (parts_.has_normals()) mesh_.normals.push_back(normal);
      if (parts_.has_uvs()) mesh_.uvs.emplace_back(0);
      if (parts_.has_colours()) mesh_.colours.emplace_back(1);
    }
    if (!opaque_) {
      opaque_ = static_cast<std::uint16_t>(mesh_.materials.size());
      mesh_.materials.emplace_back();
    }
    for (const std::uint32_t k : {1U, 2U}) {
      mesh_.triangles.push_back({vertex, vertex + k, vertex + k + 1});
      mesh_.material_of.push_back(*opaque_);
    }
  }

  [[nodiscard]] Mesh take() { return std::move(mesh_); }

 private:
  [[nodiscard]] bool is_same(std::uint32_t index, const MeshTriangle& triangle) const {
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t vertex = mesh_.triangles[index][k];
      if (mesh_.positions[vertex] != triangle.positions[k]) return false;
      if (parts_.has_uvs() && mesh_.uvs[vertex] != triangle.uvs[k]) return false;
      if (parts_.has_normals() && mesh_.normals[vertex] != triangle.normals[k]) return false;
      if (parts_.has_colours() && mesh_.colours[vertex] != triangle.colours[k]) return false;
    }
    return mesh_.material_of[index] == materials_.at(triangle.material);
  }

  std::uint16_t material(std::uint32_t of_parts) {
    const auto [at, is_new] =
        materials_.try_emplace(of_parts, static_cast<std::uint16_t>(mesh_.materials.size()));
    if (is_new) mesh_.materials.push_back(parts_.materials()[of_parts]);
    return at->second;
  }

  const MeshParts& parts_;
  Mesh mesh_;
  std::unordered_multimap<std::uint64_t, std::uint32_t> known_;  ///< triangles by hash
  std::map<std::uint32_t, std::uint16_t> materials_;             ///< by index in the parts
  std::optional<std::uint16_t> opaque_;                          ///< material of rectangles
};

/// Finds what is near a patch.
class PieceFile::Surroundings {
 public:
  /// @param rows  of the patch
  Surroundings(const PieceFile& file, std::size_t patch, std::span<const Row> rows)
      : file_(file),
        begin_(file.begins_[patch]),
        end_(file.begins_[patch + 1]),
        margin_(kMarginSpacings * file.widest_[patch]),
        closest_(file.closest_[patch]) {
    for (std::size_t i = 0; i < rows.size(); ++i) {
      const Run run = run_of(rows[i]);
      if (i % kBlockPieces == 0) own_.emplace_back();
      merge(own_.back(), run);
      merge(all_, run);
    }
  }

  /// Finds triangles and runs. @return false when there are too many
  [[nodiscard]] bool find(float share) {
    share_ = share;
    triangles_.clear();
    runs_.clear();
    const std::size_t top = file_.levels_.size() - 1;
    for (std::size_t i = 0; i < file_.levels_[top].size(); ++i) {
      if (!look_at(top, i)) return false;
    }
    return true;
  }
  [[nodiscard]] const std::vector<MeshTriangle>& triangles() const noexcept { return triangles_; }
  [[nodiscard]] const std::vector<Run>& runs() const noexcept { return runs_; }

 private:
  /// Returns how far a box is from the patch; nothing when it is not near.
  [[nodiscard]] std::optional<float> distance(const Box& box) const {
    const auto gap = [&](const Box& to) {
      return glm::max(glm::max(box.low - to.high, to.low - box.high), glm::vec3(0));
    };
    const auto is_near = [&](const glm::vec3& to) {
      return std::max({to.x, to.y, to.z}) <= margin_;
    };
    if (!is_near(gap(all_.box))) return std::nullopt;
    std::optional<float> least;
    for (const Run& run : own_) {
      const glm::vec3 to = gap(run.box);
      if (is_near(to)) least = std::min(least.value_or(margin_ * 2), glm::length(to));
    }
    return least;
  }
  [[nodiscard]] bool is_small(const Box& box, float distance) const {
    return glm::distance(box.low, box.high) <= share_ * std::max(closest_, distance);
  }
  [[nodiscard]] bool is_full() const noexcept {
    return triangles_.size() + 2 * runs_.size() > kMostNear;
  }

  bool look_at(std::size_t level, std::size_t index) {
    // Pass over what is the patch itself
    std::uint64_t pieces = kBlockPieces;
    for (std::size_t i = 0; i < level; ++i) pieces *= kChildren;
    const std::uint64_t first = index * pieces,
                        last = std::min(file_.begins_.back(), first + pieces);
    if (first >= begin_ && last <= end_) return true;
    // Take it as one, or look into it
    const Run& run = file_.levels_[level][index];
    const auto away = distance(run.box);
    if (!away) return true;
    const bool apart = last <= begin_ || first >= end_;
    if (apart && is_small(run.box, *away)) {
      runs_.push_back(run);
      return !is_full();
    }
    if (level == 0) return look_into_block(first, last);
    const std::size_t children = file_.levels_[level - 1].size();
    for (std::size_t i = index * kChildren; i < std::min(children, (index + 1) * kChildren); ++i) {
      if (!look_at(level - 1, i)) return false;
    }
    return true;
  }
  bool look_into_block(std::uint64_t first, std::uint64_t last) {
    rows_.resize(last - first);
    file_.read_rows(first, rows_);
    for (std::uint64_t from = first; from < last; from += kRunPieces) {
      Run run;
      const std::uint64_t to = std::min(last, from + kRunPieces);
      for (std::uint64_t i = from; i < to; ++i) {
        if (i < begin_ || i >= end_) merge(run, run_of(rows_[i - first]));
      }
      const auto away = distance(run.box);
      if (!away) continue;
      if (is_small(run.box, *away)) {
        runs_.push_back(run);
      } else {
        for (std::uint64_t i = from; i < to; ++i) {
          const Row& row = rows_[i - first];
          if ((i < begin_ || i >= end_) && distance(run_of(row).box))
            triangles_.push_back(row.triangle);
        }
      }
      if (is_full()) return false;
    }
    return true;
  }

  const PieceFile& file_;
  std::uint64_t begin_, end_;
  float margin_, closest_;
  float share_ = kRunShare;
  std::vector<Run> own_;  // blocks of the patch
  Run all_;
  std::vector<Row> rows_;
  std::vector<MeshTriangle> triangles_;
  std::vector<Run> runs_;
};

PieceFile::Patch PieceFile::load(std::size_t patch) const {
  // Read its own pieces
  Patch loaded{.before = weights_[patch], .weight = weights_[patch + 1] - weights_[patch]};
  LocalMesh local(parts_);
  std::vector<Row> rows(begins_[patch + 1] - begins_[patch]);
  read_rows(begins_[patch], rows);
  local.reserve(rows.size());
  for (const Row& row : rows) loaded.pieces.push_back({local.add(row.triangle), row.path});
  // Add what is near it
  if (surfels_of(loaded.before + loaded.weight) > surfels_of(loaded.before)) {
    Surroundings near(*this, patch, rows);
    for (float share = kRunShare; !near.find(share);) share *= 2;
    local.reserve(near.triangles().size() + 2 * near.runs().size());
    for (const MeshTriangle& triangle : near.triangles()) static_cast<void>(local.add(triangle));
    for (const Run& run : near.runs()) local.add_rectangle(run);
  }
  loaded.mesh = local.take();
  return loaded;
}

std::uint64_t PieceFile::index_bytes(std::uint64_t triangles, std::uint64_t surfels,
                                     double patch_surfels) noexcept {
  // Vectors grow to up to twice what they hold. Large triangles are cut into pieces of up to 512
  // surfels each
  const std::uint64_t pieces = triangles + surfels / 64;
  const std::uint64_t patches =
      pieces / kPatchPieces +
      static_cast<std::uint64_t>(static_cast<double>(surfels) / patch_surfels);
  const std::uint64_t runs = pieces / kBlockPieces * kChildren / (kChildren - 1);
  return 2 * (runs * sizeof(Run) + patches * 24);
}

}  // namespace ptc
