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
#include <stdexcept>
#include <unordered_map>
#include <utility>

#include <glm/common.hpp>

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

bool overlap(const glm::vec3& low_a, const glm::vec3& high_a, const glm::vec3& low_b,
             const glm::vec3& high_b) {
  return low_a.x <= high_b.x && low_b.x <= high_a.x && low_a.y <= high_b.y && low_b.y <= high_a.y &&
         low_a.z <= high_b.z && low_b.z <= high_a.z;
}

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

PieceFile::Box PieceFile::box_of(const Row& row) {
  const SubTriangle shape = piece_of(whole_triangle(row.triangle.positions), row.path);
  const glm::vec3 a(shape.corner[0]), b(shape.corner[1]), c(shape.corner[2]);
  return {glm::min(a, glm::min(b, c)), glm::max(a, glm::max(b, c))};
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
  explicit Writer(PieceFile& to) : to_(to) {}

  void add(const std::byte* packed) {
    // Write the row
    buffer_.insert(buffer_.end(), packed, packed + to_.row_bytes_);
    if (buffer_.size() >= kBufferBytes) flush();
    // Measure the piece
    Row row;
    to_.unpack(packed, row);
    const SubTriangle shape = piece_of(whole_triangle(row.triangle.positions), row.path);
    const double spacing = spacing_of(shape, to_.field_, to_.parts_.origin());
    const Box box = box_of(row);
    if (pieces_ % kBlockPieces == 0) {
      to_.blocks_.push_back(box);
    } else {
      Box& block = to_.blocks_.back();
      block = {glm::min(block.low, box.low), glm::max(block.high, box.high)};
    }
    ++pieces_;
    weight_ += shape.area() / (spacing * spacing);
    spacing_ = std::max(spacing_, static_cast<float>(spacing));
    if (weight_ - to_.weights_.back() >= to_.patch_surfels_ ||
        pieces_ - to_.begins_.back() >= kPatchPieces)
      close();
  }

  void finish() {
    flush();
    if (pieces_ > to_.begins_.back()) close();
  }

 private:
  static constexpr std::size_t kBufferBytes = std::size_t{1} << 20;

  void close() {
    to_.begins_.push_back(pieces_);
    to_.weights_.push_back(weight_);
    to_.spacings_.push_back(spacing_);
    spacing_ = 0;
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
  float spacing_ = 0;
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
};

PieceFile::Patch PieceFile::load(std::size_t patch) const {
  // Read its own pieces, and find the boxes that these lie in
  Patch loaded{.before = weights_[patch], .weight = weights_[patch + 1] - weights_[patch]};
  const std::uint64_t begin = begins_[patch], end = begins_[patch + 1];
  const glm::vec3 margin(kMarginSpacings * spacings_[patch]);
  LocalMesh local(parts_);
  std::vector<Row> rows(end - begin);
  read_rows(begin, rows);
  std::vector<Box> own;
  Box all{glm::vec3(std::numeric_limits<float>::infinity()),
          glm::vec3(-std::numeric_limits<float>::infinity())};
  for (std::size_t i = 0; i < rows.size(); ++i) {
    loaded.pieces.push_back({local.add(rows[i].triangle), rows[i].path});
    const Box box = box_of(rows[i]);
    if (i % kBlockPieces == 0) own.push_back({box.low - margin, box.high + margin});
    own.back() = {glm::min(own.back().low, box.low - margin),
                  glm::max(own.back().high, box.high + margin)};
    all = {glm::min(all.low, own.back().low), glm::max(all.high, own.back().high)};
  }

  // Add the triangles of pieces near them
  const auto is_near = [&](const Box& box) {
    return overlap(box.low, box.high, all.low, all.high) &&
           std::ranges::any_of(
               own, [&](const Box& o) { return overlap(box.low, box.high, o.low, o.high); });
  };
  for (std::size_t b = 0; b < blocks_.size(); ++b) {
    const std::uint64_t first = b * kBlockPieces,
                        last = std::min(begins_.back(), first + kBlockPieces);
    if ((first >= begin && last <= end) || !is_near(blocks_[b])) continue;
    rows.resize(last - first);
    read_rows(first, rows);
    for (std::uint64_t i = first; i < last; ++i) {
      if (i >= begin && i < end) continue;
      if (is_near(box_of(rows[i - first]))) static_cast<void>(local.add(rows[i - first].triangle));
    }
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
  return 2 * (pieces / kBlockPieces * sizeof(Box) + patches * 20);
}

}  // namespace ptc
