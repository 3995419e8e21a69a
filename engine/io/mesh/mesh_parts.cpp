// The parts that mesh readers share in addition to polygons: transforms, cameras and textures.
#include <algorithm>
#include <cmath>
#include <exception>
#include <new>
#include <system_error>
#include <utility>

#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include "engine/base/error.h"
#include "engine/io/file/file.h"
#include "engine/io/file/url.h"
#include "engine/io/image/byte_range.h"
#include "engine/io/mesh/mesh_soup.h"

namespace ptc {

// Uses the cofactor matrix, which is the inverse transpose times the determinant and exists for
// every matrix.
glm::dmat3 normal_transform(const glm::dmat4& transform) {
  const glm::dmat3 m(transform);
  const glm::dmat3 cofactor(glm::cross(m[1], m[2]), glm::cross(m[2], m[0]), glm::cross(m[0], m[1]));
  return mirrors(transform) ? -cofactor : cofactor;
}

bool mirrors(const glm::dmat4& transform) {
  return glm::determinant(glm::dmat3(transform)) < 0;
}

std::optional<MeshCamera> make_camera(const glm::dvec3& position, const glm::dvec3& forward,
                                      const glm::dvec3& up, double horizontal_fov) {
  const double sum = position.x + position.y + position.z;
  const double lengths = glm::length(forward) * glm::length(up);
  if (!std::isfinite(sum) || !std::isfinite(lengths) || lengths == 0 || !(horizontal_fov > 0)) {
    return std::nullopt;
  }
  return MeshCamera{position, glm::vec3(glm::normalize(forward)), glm::vec3(glm::normalize(up)),
                    static_cast<float>(horizontal_fov)};
}

std::string reason_for(const std::string& name, const std::filesystem::path& path,
                       const std::exception& error) {
  if (const auto* system = dynamic_cast<const std::system_error*>(&error)) {
    return name + ": " + system->code().message();
  }
  const std::string_view what = error.what();
  const std::string prefix = path.string() + ": ";
  return name + ": " + std::string(what.starts_with(prefix) ? what.substr(prefix.size()) : what);
}

std::uint64_t TextureLoader::pixels_left() const {
  constexpr std::uint64_t kPixelsOfByte = 256;
  const std::uint64_t most = free_pixels_ + kPixelsOfByte * (texture_bytes_ + mesh_bytes_);
  return std::min(most - pixels_, kMaxImagePixels);
}

std::shared_ptr<const Texture> TextureLoader::read(const ByteRange& bytes, const std::string& name,
                                                   TextureUse use) {
  auto texture =
      use == TextureUse::colour
          ? std::optional(store_->read(bytes, name, pixels_left()))
          : store_->read_opacity(bytes, name, use == TextureUse::alpha_or_grey, pixels_left());
  if (!texture) return nullptr;
  pixels_ += texture->size();
  return std::make_shared<const Texture>(std::move(*texture));
}

std::shared_ptr<const Texture> TextureLoader::load(const std::string& name, TextureUse use) {
  std::string relative = name;
  std::ranges::replace(relative, '\\', '/');
  // Normalise the name, because one file has many: a.png and ./a.png.
  const std::filesystem::path path = file_beside(mesh_, relative);
  const auto [at, is_new] = loaded_.try_emplace({path.string(), use});
  if (!is_new || failed_.contains(path.string())) return at->second;
  try {
    const InputFile file(path);
    texture_bytes_ += file.size();
    at->second = read(ByteRange(file, 0, file.size()), path.string(), use);
  } catch (const std::bad_alloc&) {
    throw;
  } catch (const LimitError&) {
    throw;
  } catch (const std::exception& error) {
    if (is_net_failure(path, error)) throw;
    failed_.insert(path.string());
    warnings_.add(kTextureLeftOut, reason_for(name, path, error));
  }
  return at->second;
}

std::shared_ptr<const Texture> TextureLoader::decode(const std::string& name,
                                                     const ByteRange& bytes,
                                                     std::uint64_t mesh_bytes, TextureUse use) {
  mesh_bytes_ = std::max(mesh_bytes_, mesh_bytes);
  try {
    return read(bytes, name, use);
  } catch (const DataError& error) {
    if (use == TextureUse::colour) warnings_.add(kTextureLeftOut, error.what());
    return nullptr;
  }
}

}  // namespace ptc
