#include "engine/io/mesh/gltf_materials.h"

#include <algorithm>
#include <limits>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace ptc {

const GltfMaterial& GltfMaterials::use(std::optional<std::uint64_t> index, MeshSoup& soup) {
  const std::uint64_t key = index.value_or(std::numeric_limits<std::uint64_t>::max());
  const auto known = materials_.find(key);
  if (known != materials_.end()) return known->second;
  GltfMaterial& made = materials_[key];
  Material material;
  material.albedo = glm::vec3(1);
  if (index) read_material(document_.at("materials", *index), material, made);
  made.index = soup.add_material(std::move(material));
  return made;
}

void GltfMaterials::read_material(const Json& json, Material& material, GltfMaterial& made) {
  const auto title = json.find("name");
  if (title != json.end() && title->is_string()) material.name = title->get<std::string>();
  const auto sides = json.find("doubleSided");
  material.double_sided = sides != json.end() && sides->is_boolean() && sides->get<bool>();
  const auto mode = json.find("alphaMode");
  if (mode != json.end() && mode->is_string() && *mode != "OPAQUE") {
    made.alpha = true;
    if (*mode == "MASK") {
      const double cutoff = document_.number_at(json, "alphaCutoff", 0.5);
      made.alpha = cutoff > 0;  // or else every alpha reaches it
      material.opacity_cutoff = static_cast<float>(std::max(cutoff, 0.0));
      if (cutoff > 1) material.opacity = 0;  // none does
    }
  }
  if (const Json* const old =
          GltfDocument::extension(json, "KHR_materials_pbrSpecularGlossiness")) {
    read_base(*old, "diffuseFactor", "diffuseTexture", material, made);
  } else if (const Json* const pbr = GltfDocument::member(json, "pbrMetallicRoughness")) {
    read_base(*pbr, "baseColorFactor", "baseColorTexture", material, made);
  }
  read_emission(json, material, made);
}

void GltfMaterials::read_base(const Json& json, const char* factor, const char* texture,
                              Material& material, GltfMaterial& made) {
  if (const auto colour = document_.numbers_at<4>(json, factor)) {
    for (int i = 0; i < 3; ++i) {
      material.albedo[i] =
          static_cast<float>(std::clamp((*colour)[static_cast<std::size_t>(i)], 0.0, 1.0));
    }
    if (made.alpha) material.opacity *= static_cast<float>(std::clamp((*colour)[3], 0.0, 1.0));
  }
  const Json* const info = GltfDocument::member(json, texture);
  if (info == nullptr) return;
  material.texture = load_texture(*info, TextureUse::colour);
  if (made.alpha) material.opacity_texture = load_texture(*info, TextureUse::alpha);
  material.wrap = wrap_of(*info);
  made.place = place_of(*info);
}

// Reads which texture coordinates a texture has, and how they are transformed.
TexturePlace GltfMaterials::place_of(const Json& info) const {
  TexturePlace place{.uv_set = document_.unsigned_at(info, "texCoord").value_or(0)};
  const Json* const transform = GltfDocument::extension(info, "KHR_texture_transform");
  if (transform == nullptr) return place;
  place.uv_set = document_.unsigned_at(*transform, "texCoord").value_or(place.uv_set);
  place.rotation = document_.number_at(*transform, "rotation", 0);
  if (const auto o = document_.numbers_at<2>(*transform, "offset"))
    place.offset = {(*o)[0], (*o)[1]};
  if (const auto s = document_.numbers_at<2>(*transform, "scale")) place.scale = {(*s)[0], (*s)[1]};
  return place;
}

// Reads how a texture goes on beyond its borders.
TextureWrap GltfMaterials::wrap_of(const Json& info) const {
  const auto texture = document_.unsigned_at(info, "index");
  const auto sampler =
      texture ? document_.unsigned_at(document_.at("textures", *texture), "sampler") : std::nullopt;
  if (!sampler) return {};
  const Json& json = document_.at("samplers", *sampler);
  const auto wrap = [&](const char* key) {
    constexpr std::uint64_t kClamp = 33071, kMirror = 33648, kRepeat = 10497;
    const std::uint64_t value = document_.unsigned_at(json, key).value_or(kRepeat);
    return value == kClamp ? Wrap::clamp : value == kMirror ? Wrap::mirror : Wrap::repeat;
  };
  return {wrap("wrapS"), wrap("wrapT")};
}

// Reads the emission. A mesh has one set of texture coordinates: where the emission texture lies
// on another than that of the base colour, it is replaced by its mean, so that the emitted power
// is right.
void GltfMaterials::read_emission(const Json& json, Material& material, GltfMaterial& made) {
  const auto factor = document_.numbers_at<3>(json, "emissiveFactor");
  if (!factor) return;
  double strength = 1;
  if (const Json* const e = GltfDocument::extension(json, "KHR_materials_emissive_strength")) {
    strength = document_.number_at(*e, "emissiveStrength", 1);
  }
  glm::dvec3 mean(1);
  const Json* const info = GltfDocument::member(json, "emissiveTexture");
  const auto image = info == nullptr ? nullptr : load_texture(*info, TextureUse::colour);
  if (image && (!material.texture || place_of(*info) == made.place)) {
    material.emission_texture = image;
    material.emission_wrap = wrap_of(*info);
    made.place = place_of(*info);
  } else if (image) {
    mean = mean_of(image);
    warnings_.add(kEmissionAveraged,
                  "material '" + material.name + "', whose base colour lies on other coordinates");
  }
  for (int i = 0; i < 3; ++i) {
    const double value = (*factor)[static_cast<std::size_t>(i)] * strength * mean[i];
    material.emission[i] =
        static_cast<float>(std::clamp<double>(value, 0, std::numeric_limits<float>::max()));
  }
}

// Returns the mean of a texture; it is kept, because many materials may share one.
glm::dvec3 GltfMaterials::mean_of(const std::shared_ptr<const Texture>& image) {
  const auto [at, is_new] = means_.try_emplace(image, 0);
  if (is_new) {
    image->visit_rows([&sum = at->second](std::span<const glm::vec3> row) {
      for (const glm::vec3& pixel : row) sum += glm::dvec3(pixel);
    });
    at->second /= static_cast<double>(image->size());
  }
  return at->second;
}

std::shared_ptr<const Texture> GltfMaterials::load_texture(const Json& info, TextureUse use) {
  const auto texture = document_.unsigned_at(info, "index");
  if (!texture) document_.fail("a texture has no index");
  const auto source = document_.unsigned_at(document_.at("textures", *texture), "source");
  if (!source) {
    if (textures_left_out_.insert(*texture).second) {
      warnings_.add(kTextureLeftOut,
                    "texture " + std::to_string(*texture) + ": it has no supported source");
    }
    return nullptr;
  }
  const auto [at, is_new] = images_.try_emplace({*source, use});
  if (is_new) at->second = load_image(*source, use);
  return at->second;
}

// Loads an image. Several images that are one file or one bufferView are loaded once.
std::shared_ptr<const Texture> GltfMaterials::load_image(std::uint64_t source, TextureUse use) {
  const Json& image = document_.at("images", source);
  const auto uri = image.find("uri");
  const std::string label = "image " + std::to_string(source);
  if (uri != image.end() && uri->is_string()) {
    const std::string text = uri->get<std::string>();
    if (!text.starts_with("data:")) return textures_.load(GltfDocument::file_name(text), use);
    const std::vector<std::byte> bytes = document_.decode_uri(text);
    return textures_.decode(label, ByteRange(bytes), document_.bytes_read(), use);
  }
  const auto view = document_.unsigned_at(image, "bufferView");
  if (!view) document_.fail("an image has neither uri nor bufferView");
  const auto [at, is_new] = image_of_view_.try_emplace({*view, use});
  if (is_new) {
    const ByteRange bytes = document_.view(*view);
    at->second = textures_.decode(label, bytes, document_.bytes_read(), use);
  }
  return at->second;
}

}  // namespace ptc
