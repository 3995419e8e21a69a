// Reads clouds from PLY, checks surfels of all files, and says which files are clouds.
//
// A PLY header names the properties of a vertex in any order. find_layout() looks them up once;
// then each record is gathered into a RawSurfel, which convert_surfel() checks and rounds:
//
//   header --find_layout()--> Layout        record --gather()--> RawSurfel --check--> Surfel
#include "engine/io/cloud/points.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "engine/base/error.h"
#include "engine/io/cloud/ply.h"
#include "engine/io/cloud/surfel_check.h"
#include "engine/io/image/srgb.h"
#include "engine/io/text/text.h"

namespace ptc {
namespace {

using Triple = std::array<std::size_t, 3>;

// The indices of the properties of a vertex that make a surfel.
struct Layout {
  Triple position{};
  std::optional<Triple> normal;
  std::optional<std::size_t> radius;
  std::optional<Triple> radiance;
  std::optional<Triple> emission;
  std::optional<Triple> albedo;
  std::array<double, 3> albedo_most{};  // stored value that stands for 1; 0 for linear floats
};

[[noreturn]] void refuse(const std::filesystem::path& path, const std::string& rule) {
  throw DataError(path.string() + ": " + rule);
}

// Finds three properties; it refuses a file that has only one or two of them.
std::optional<Triple> find_triple(const PlyElement& vertex, const std::filesystem::path& path,
                                  const std::array<const char*, 3>& names) {
  Triple triple{};
  std::size_t found = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    const auto index = vertex.find(names[i]);
    if (!index) continue;
    triple[i] = *index;
    ++found;
  }
  if (found == 0) return std::nullopt;
  if (found < 3) {
    refuse(path, std::string("the PLY vertices do not have all of ") + names[0] + ", " + names[1] +
                     " and " + names[2]);
  }
  return triple;
}

// Returns the stored value that stands for 1, or 0 for floats, which are linear already.
double stored_one(PlyType type) {
  switch (type) {
    case PlyType::float32:
    case PlyType::float64:
      return 0;
    case PlyType::int16:
    case PlyType::uint16:
      return 65535;
    case PlyType::int8:
    case PlyType::uint8:
    case PlyType::int32:
    case PlyType::uint32:
      break;
  }
  return 255;
}

Layout find_layout(const PlyElement& vertex, const std::filesystem::path& path) {
  const auto first = [&](std::initializer_list<std::array<const char*, 3>> choices) {
    std::optional<Triple> found;
    for (const auto& names : choices) {
      if (!found) found = find_triple(vertex, path, names);
    }
    return found;
  };
  if (vertex.has_list()) refuse(path, "PLY vertices that have a list are not supported");
  Layout layout;
  const auto position = first({{"x", "y", "z"}});
  if (!position) refuse(path, "the PLY vertices have no x, y and z");
  layout.position = *position;
  layout.normal = first({{"nx", "ny", "nz"}, {"normal_x", "normal_y", "normal_z"}});
  layout.radius = vertex.find_any({"radius", "scalar_radius"});
  layout.radiance = first({{"radiance_r", "radiance_g", "radiance_b"}});
  layout.emission = first({{"emission_r", "emission_g", "emission_b"}});
  layout.albedo =
      first({{"red", "green", "blue"}, {"diffuse_red", "diffuse_green", "diffuse_blue"}});
  for (std::size_t i = 0; layout.albedo && i < 3; ++i) {
    layout.albedo_most[i] = stored_one(vertex.properties[(*layout.albedo)[i]].type);
  }
  return layout;
}

glm::dvec3 gather(const PlyRecord& record, const Triple& at) {
  return {record.scalars[at[0]], record.scalars[at[1]], record.scalars[at[2]]};
}

class PlySource : public PointSource {
 public:
  explicit PlySource(const std::filesystem::path& path) : reader_(path), path_(path) {
    vertex_ = reader_.find("vertex");
    if (vertex_ == nullptr) refuse(path, "the PLY file has no vertices");
    layout_ = find_layout(*vertex_, path);
    if (layout_.albedo) fill_curve();
  }

  [[nodiscard]] PointFileInfo info() const {
    return {vertex_->count,
            layout_.normal.has_value(),
            layout_.radius.has_value(),
            layout_.radiance.has_value(),
            layout_.emission.has_value(),
            layout_.albedo.has_value()};
  }

  std::size_t next(std::span<Surfel> out) override {
    if (out.empty() || ended_) return 0;
    if (done_ == 0) skip_before_vertices();
    const auto count =
        static_cast<std::size_t>(std::min<std::uint64_t>(out.size(), vertex_->count - done_));
    for (Surfel& surfel : out.first(count)) {
      reader_.read(*vertex_, record_);
      read_surfel(surfel);
      ++done_;
    }
    // Read the rest along with the last points, so that no caller can stop before it is checked.
    if (done_ == vertex_->count) finish();
    return count;
  }

 private:
  void skip_before_vertices() {
    for (const PlyElement* e = reader_.elements().data(); e != vertex_; ++e) reader_.skip(*e);
  }

  void finish() {
    const PlyElement* const end = reader_.elements().data() + reader_.elements().size();
    for (const PlyElement* e = vertex_ + 1; e != end; ++e) reader_.skip(*e);
    reader_.require_end();
    ended_ = true;
  }

  // Tabulates the sRGB curve for 8-bit values.
  void fill_curve() {
    for (std::size_t i = 0; i < curve_.size(); ++i) {
      curve_[i] = srgb_to_linear(static_cast<double>(i) / 255);
    }
  }

  // Returns the linear albedo of a stored value. A value out of range gives one that the check of
  // the surfel refuses.
  [[nodiscard]] double albedo_of(double stored, double most) const {
    if (most == 0) return stored;
    if (!(stored >= 0 && stored <= most)) return std::numeric_limits<double>::quiet_NaN();
    return most == 255 ? curve_[static_cast<std::size_t>(stored)] : srgb_to_linear(stored / most);
  }

  void read_surfel(Surfel& surfel) {
    RawSurfel raw;
    raw.position = gather(record_, layout_.position);
    if (layout_.normal) raw.normal = gather(record_, *layout_.normal);
    if (layout_.radius) raw.radius = record_.scalars[*layout_.radius];
    if (layout_.radiance) raw.radiance = gather(record_, *layout_.radiance);
    if (layout_.emission) raw.emission = gather(record_, *layout_.emission);
    for (std::size_t i = 0; layout_.albedo && i < 3; ++i) {
      raw.albedo[static_cast<int>(i)] =
          albedo_of(record_.scalars[(*layout_.albedo)[i]], layout_.albedo_most[i]);
    }
    const std::string rule = convert_surfel(raw, layout_.normal.has_value(), surfel);
    if (!rule.empty()) reader_.fail(record_, "point " + std::to_string(done_) + ": " + rule);
  }

  PlyReader reader_;
  std::filesystem::path path_;
  const PlyElement* vertex_ = nullptr;  // an element of reader_
  Layout layout_;
  std::array<double, 256> curve_{};  // linear value of each 8-bit sRGB value
  PlyRecord record_;                 // kept between calls
  std::uint64_t done_ = 0;           // points that were read
  bool ended_ = false;               // everything behind the vertices was read
};

bool is_ply(const std::filesystem::path& path) {
  const std::string extension = lower_extension(path);
  return extension == ".ply" || (extension == ".gz" && lower_extension(path.stem()) == ".ply");
}

bool is_xyz(const std::filesystem::path& path) {
  constexpr std::array<std::string_view, 4> kExtensions = {".xyz", ".xyzn", ".asc", ".txt"};
  return std::ranges::find(kExtensions, lower_extension(path)) != kExtensions.end();
}

bool all_finite(const glm::dvec3& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

bool all_within(const glm::dvec3& v, double most) {
  return v.x >= 0 && v.y >= 0 && v.z >= 0 && v.x <= most && v.y <= most && v.z <= most;
}

}  // namespace

std::string convert_surfel(const RawSurfel& raw, bool has_normals, Surfel& out) {
  constexpr double kMaxFloat = std::numeric_limits<float>::max();
  // Check the numbers against the ranges that records can hold.
  if (!all_finite(raw.position)) return "the position is not finite";
  if (!fits_coordinates(raw.position)) return "the position is beyond 2^999";
  if (!(raw.radius >= 0 && raw.radius <= kMaxFloat))
    return "the radius is negative, not a number or beyond the range of float";
  if (!all_within(raw.radiance, kMaxFloat))
    return "the radiance is negative, not a number or beyond the range of float";
  if (!all_within(raw.emission, kMaxFloat))
    return "the emission is negative, not a number or beyond the range of float";
  if (!all_within(raw.albedo, 1)) return "the colour is out of range";

  // Convert them.
  out.position = raw.position;
  out.normal = glm::vec3(0);
  out.radius = static_cast<float>(raw.radius);
  out.radiance = glm::vec3(raw.radiance);
  out.emission = glm::vec3(raw.emission);
  out.albedo = glm::vec3(raw.albedo);
  if (!has_normals) return {};

  // Normalise the normal; scale it first, because squares of very small or large components would
  // leave the range of double.
  if (!all_finite(raw.normal)) return "the normal is not finite";
  const double most =
      std::max({std::abs(raw.normal.x), std::abs(raw.normal.y), std::abs(raw.normal.z)});
  if (most == 0) return "the normal has zero length";
  const glm::dvec3 scaled = raw.normal / most;
  out.normal = glm::vec3(
      scaled / std::sqrt(scaled.x * scaled.x + scaled.y * scaled.y + scaled.z * scaled.z));
  return {};
}

PointFile open_points(const std::filesystem::path& path) {
  if (is_ply(path)) {
    auto source = std::make_unique<PlySource>(path);
    const PointFileInfo info = source->info();
    return {info, std::move(source)};
  }
  if (is_xyz(path)) return open_xyz(path);
  refuse(path, "not a point cloud: the name ends in none of .ply .ply.gz .xyz .xyzn .asc .txt");
}

bool is_point_file(const std::filesystem::path& path) {
  if (!is_ply(path)) return is_xyz(path);
  const PlyReader reader(path);
  return std::ranges::none_of(reader.elements(), [](const PlyElement& element) {
    return (element.name == "face" || element.name == "tristrips") && element.count > 0;
  });
}

}  // namespace ptc
