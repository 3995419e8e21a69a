// Internal to the glTF reader: materials with their textures and images.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <utility>

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "engine/io/mesh/gltf_document.h"
#include "engine/io/mesh/mesh_soup.h"

namespace ptc {

/// How a texture lies on a surface.
struct TexturePlace {
  std::uint64_t uv_set = 0;  ///< N of the attribute TEXCOORD_N
  glm::dvec2 offset{0};
  glm::dvec2 scale{1};
  double rotation = 0;

  bool operator==(const TexturePlace&) const = default;
};

/// A material of the file, and how its textures lie on it.
struct GltfMaterial {
  std::size_t index = 0;  ///< of the material in the soup
  TexturePlace place;
  bool alpha = false;  ///< whether alpha counts
};

/// Reads the materials that a file uses, each once, into the soups that use them.
class GltfMaterials {
 public:
  /// All must outlive this.
  GltfMaterials(GltfDocument& document, TextureLoader& textures, MeshWarnings& warnings)
      : document_(document), textures_(textures), warnings_(warnings) {}

  /// Returns a material of the file, or the default one, and adds it to a soup on its first use
  /// since that soup began.
  /// @throws DataError, LimitError, std::system_error
  const GltfMaterial& use(std::optional<std::uint64_t> index, MeshSoup& soup);
  /// Begins another soup, without materials.
  void begin_soup() { materials_.clear(); }

 private:
  using Json = GltfDocument::Json;

  void read_material(const Json& json, Material& material, GltfMaterial& made);
  void read_base(const Json& json, const char* factor, const char* texture, Material& material,
                 GltfMaterial& made);
  void read_emission(const Json& json, Material& material, GltfMaterial& made);
  [[nodiscard]] TexturePlace place_of(const Json& info) const;
  [[nodiscard]] TextureWrap wrap_of(const Json& info) const;
  glm::dvec3 mean_of(const std::shared_ptr<const Texture>& image);
  std::shared_ptr<const Texture> load_texture(const Json& info, TextureUse use);
  std::shared_ptr<const Texture> load_image(std::uint64_t source, TextureUse use);

  GltfDocument& document_;
  TextureLoader& textures_;
  MeshWarnings& warnings_;
  std::map<std::uint64_t, GltfMaterial> materials_;  ///< by index in the file
  using Images = std::map<std::pair<std::uint64_t, TextureUse>, std::shared_ptr<const Texture>>;
  Images images_;         ///< by index in the file
  Images image_of_view_;  ///< by bufferView
  std::map<std::shared_ptr<const Texture>, glm::dvec3> means_;
  std::set<std::uint64_t> textures_left_out_;  ///< indices in the file
};

}  // namespace ptc
