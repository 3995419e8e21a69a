// Depth, positions, normals, and the numbers of objects and materials in pictures.
#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfInputFile.h>
#include <OpenEXR/ImfStringAttribute.h>
#include <catch2/catch.hpp>
#include <glm/geometric.hpp>

#include "engine/base/error.h"
#include "engine/io/image/image.h"
#include "engine/pipeline/build/build_container.h"
#include "engine/pipeline/build/meshes.h"
#include "engine/pipeline/render/render_picture.h"
#include "engine/pipeline/render/surface_ids.h"
#include "tests/support/notes.h"
#include "tests/support/temporary_directory.h"

using namespace ptc;
using Catch::Matchers::Contains;

namespace {

constexpr float kNothing = 1e10F;

// A floor, and a lid above a quarter of it that is one object of two materials.
constexpr char kShapes[] =
    "o floor\nusemtl grey\nv -1 0 -1\nv 1 0 -1\nv 1 0 1\nv -1 0 1\nf 4 3 2 1\n"
    "o lid\nusemtl red\nv 0 0.5 0\nv 1 0.5 0\nv 1 0.5 1\nv 0 0.5 1\nv 0.5 0.5 0\nv 0.5 0.5 1\n"
    "f 8 10 9 5\nusemtl blue\nf 10 7 6 9\n";

// The channels of an .exr in the whole of its picture; -1 where the file holds no pixels.
struct Channels {
  std::map<std::string, std::vector<float>> values;
  std::map<std::string, Imf::PixelType> types;
  std::map<std::string, std::string> text;

  explicit Channels(const std::filesystem::path& path) {
    Imf::InputFile file(path.c_str());
    const Imf::Header& header = file.header();
    const auto width = static_cast<std::size_t>(header.displayWindow().max.x + 1),
               height = static_cast<std::size_t>(header.displayWindow().max.y + 1);
    Imf::FrameBuffer frame;
    for (auto c = header.channels().begin(); c != header.channels().end(); ++c) {
      types[c.name()] = c.channel().type;
      std::vector<float>& pixels = values[c.name()];
      pixels.assign(width * height, -1);
      frame.insert(c.name(), Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(pixels.data()),
                                        sizeof(float), sizeof(float) * width));
    }
    file.setFrameBuffer(frame);
    file.readPixels(header.dataWindow().min.y, header.dataWindow().max.y);
    for (auto a = header.begin(); a != header.end(); ++a) {
      const auto* value = dynamic_cast<const Imf::StringAttribute*>(&a.attribute());
      if (value != nullptr) text[a.name()] = value->value();
    }
  }
  [[nodiscard]] float at(const std::string& name, std::size_t pixel) const {
    return values.at(name)[pixel];
  }
  [[nodiscard]] glm::vec3 vector(const std::string& name, std::size_t pixel) const {
    return {at(name + ".X", pixel), at(name + ".Y", pixel), at(name + ".Z", pixel)};
  }
};

// What a ray meets.
struct Met {
  double depth = kNothing;
  glm::dvec3 position{0};
  int object = 0, material = 0;
  bool at_edge = false;  // so that rounding decides
};

// @param along  of depth 1
Met meet(const glm::dvec3& eye, const glm::dvec3& along) {
  Met met;
  const auto look = [&](double height, double low, int object) {
    const double t = (height - eye.y) / along.y;
    const glm::dvec3 p = eye + t * along;
    const double inside = std::min({p.x - low, 1 - p.x, p.z - low, 1 - p.z});
    met.at_edge |= t > 0 && std::abs(inside) < 1e-5;
    if (!(t > 0 && inside > 0) || t > met.depth) return;
    met.at_edge |= object == 2 && std::abs(p.x - 0.5) < 1e-5;
    const int material = object == 1 ? 1 : p.x < 0.5 ? 2 : 3;
    met = {t, p, object, material, met.at_edge};
  };
  look(0, -1, 1);
  look(0.5, 0, 2);
  return met;
}

// What the samples of a pixel meet.
std::vector<Met> samples_of_pixel(const Camera& camera, unsigned x, unsigned y, unsigned side) {
  const glm::dvec3 forward = glm::normalize(camera.look_at - camera.position);
  const glm::dvec3 right = glm::normalize(glm::cross(forward, glm::dvec3(0, 1, 0)));
  const glm::dvec3 up = glm::cross(right, forward);
  const double half = std::tan(static_cast<double>(camera.vertical_fov) / 2);
  std::vector<Met> samples;
  for (unsigned s = 0; s < side * side; ++s) {
    const double u = x + (s % side + 0.5) / side, v = y + (s / side + 0.5) / side;
    const double across = (2 * u - camera.width) / camera.height * half,
                 above = (1 - 2 * v / camera.height) * half;
    samples.push_back(meet(camera.position, forward + across * right + above * up));
  }
  return samples;
}

// Returns the nearest sample, the first one where several are as near.
Met nearest_of(const std::vector<Met>& samples) {
  Met nearest = samples.front();
  for (const Met& met : samples) {
    if (met.depth < (1 - 1e-6) * nearest.depth) nearest = met;
  }
  return nearest;
}

// Returns the number that most of the samples have, of several the least.
int most_frequent(const std::vector<Met>& samples, int Met::*number) {
  std::map<int, int> counts;
  for (const Met& met : samples) {
    if (met.*number != 0) ++counts[met.*number];
  }
  int best = 0;
  for (const auto& [id, count] : counts) {
    if (best == 0 || count > counts[best]) best = id;
  }
  return best;
}

struct Scene {
  test::TemporaryDirectory dir;
  test::Notes notes;
  RenderRequest request;

  Scene() {
    dir.file("a.obj", kShapes);
    BuildRequest build{.inputs = {path("a.obj")}};
    build.sampling.count = 3000;
    build_container(build, path("a.ptcx"), notes);
    request.scene = path("a.ptcx");
    request.meshes = {path("a.obj")};
    request.camera = Camera{.position = {1, 1.5, 2}, .look_at = {0.1, 0.1, 0}};
    request.size = {{60, 40}};
    request.light_sampling = {.sun_rays = 1, .area_rays = 1, .sky_rays = 0};
  }
  [[nodiscard]] std::filesystem::path path(const std::string& name) const {
    return dir.path() / name;
  }
  void render(const std::string& name, const std::string& layer = "beauty") {
    render_picture(request, std::vector<PictureTarget>{{path(name), layer}}, notes);
  }
  [[nodiscard]] std::string refusal(const std::string& name, const std::string& layer) {
    try {
      render(name, layer);
    } catch (const RequestError& error) {
      CHECK(error.field() == "targets");
      return error.what();
    }
    return "none";
  }
};

const std::array<std::string, 9> kSurface{"Z",   "P.X", "P.Y", "P.Z",        "N.X",
                                          "N.Y", "N.Z", "A",   "object_id.V"};

}  // namespace

TEST_CASE("surface layers: depth, position, normal and numbers are those of rays at the shapes",
          "[integration][layers]") {
  Scene scene;
  // One tile or several, samples at once or in turns
  const auto [width, height, samples] =
      GENERATE(table<unsigned, unsigned, unsigned>({{60, 40, 4}, {300, 270, 1}, {30, 20, 36}}));
  scene.request.size = {{width, height}};
  scene.request.samples = samples;
  scene.render("a.exr");
  Camera camera = *scene.request.camera;
  camera.width = width;
  camera.height = height;
  const auto side = static_cast<unsigned>(std::lround(std::sqrt(samples)));
  const Channels picture(scene.path("a.exr"));
  std::array<int, 3> seen{};
  int mixed = 0;
  for (unsigned y = 0; y < height; ++y) {
    for (unsigned x = 0; x < width; ++x) {
      const std::vector<Met> met = samples_of_pixel(camera, x, y, side);
      if (std::ranges::any_of(met, &Met::at_edge)) continue;
      const std::size_t pixel = std::size_t{y} * width + x;
      INFO(x << ", " << y);
      const Met nearest = nearest_of(met);
      const auto covered = std::ranges::count_if(met, [](const Met& m) { return m.object > 0; });
      const auto share = static_cast<float>(covered) / static_cast<float>(samples);
      const int object = most_frequent(met, &Met::object);
      REQUIRE(picture.at("A", pixel) == Approx(share).margin(1e-3));
      REQUIRE(picture.at("Z", pixel) == Approx(nearest.depth).epsilon(2e-6));
      REQUIRE(picture.at("object_id.V", pixel) == static_cast<float>(object));
      REQUIRE(picture.at("material_id.V", pixel) ==
              static_cast<float>(most_frequent(met, &Met::material)));
      REQUIRE(glm::distance(glm::dvec3(picture.vector("P", pixel)), nearest.position) < 2e-6);
      REQUIRE(picture.vector("N", pixel) == glm::vec3(0, nearest.object > 0 ? 1 : 0, 0));
      ++seen[static_cast<std::size_t>(object)];
      mixed += covered > 0 &&
               std::ranges::any_of(met, [&](const Met& m) { return m.object != met[0].object; });
    }
  }
  for (const int pixels : seen) CHECK(pixels > 20);
  CHECK((samples == 1 || mixed > 20));
}

TEST_CASE("surface layers: channels have the names and types that other programs know",
          "[integration][layers]") {
  Scene scene;
  scene.render("a.exr");
  const Channels picture(scene.path("a.exr"));
  std::string names;
  for (const auto& [name, type] : picture.types)
    names += name + (type == Imf::FLOAT ? ":float " : ":half ");
  CHECK(names ==
        "A:half B:half G:half N.X:half N.Y:half N.Z:half P.X:float P.Y:float P.Z:float R:half "
        "Z:float albedo.B:half albedo.G:half albedo.R:half bent_normal.X:float "
        "bent_normal.Y:float bent_normal.Z:float direct.B:half direct.G:half direct.R:half "
        "indirect.B:half indirect.G:half indirect.R:half material_id.V:float object_id.V:float "
        "occlusion.V:half ");
  CHECK(picture.text.at("ptcx/objectNames") == R"({"1":"a.obj:floor","2":"a.obj:lid"})");
  CHECK(picture.text.at("ptcx/materialNames") ==
        R"({"1":"a.obj:grey","2":"a.obj:red","3":"a.obj:blue"})");
}

TEST_CASE("surface layers: a part, a frame and groups of lights show the same",
          "[integration][layers]") {
  Scene scene;
  const bool sees_mesh = GENERATE(true, false);
  if (!sees_mesh) scene.request.meshes.clear();
  scene.render("whole.exr");
  const Channels whole(scene.path("whole.exr"));
  const auto compare = [&](const std::string& name) {
    const Channels other(scene.path(name));
    CHECK(other.text == whole.text);
    for (const std::string& channel : kSurface) {
      INFO(name << " " << channel);
      REQUIRE(other.values.contains(channel) == whole.values.contains(channel));
      if (!whole.values.contains(channel)) continue;
      const bool cropped = scene.request.crop.has_value();
      std::size_t differ = 0;
      for (std::size_t y = cropped ? 7 : 0; y < (cropped ? 30 : 40); ++y) {
        for (std::size_t x = cropped ? 10 : 0; x < (cropped ? 43 : 60); ++x)
          differ += other.at(channel, 60 * y + x) != whole.at(channel, 60 * y + x);
      }
      CHECK(differ == 0);
    }
  };
  SECTION("of a part") {
    scene.request.crop = {{10, 7, 43, 30}};
    scene.render("part.exr");
    compare("part.exr");
  }
  SECTION("of a sequence") {
    scene.request.sequence = SequenceRequest{.frames = {1, 2}};
    scene.render("frame.#.exr");
    compare("frame.1.exr");
    compare("frame.2.exr");
  }
  SECTION("in groups of lights") {
    scene.request.lights = LightRig{};
    scene.request.lights->suns = {{.group = "key"}};
    scene.request.light_groups = true;
    scene.render("groups.exr");
    compare("groups.exr");
    scene.request.crop = {{10, 7, 43, 30}};
    scene.render("part.exr");
    compare("part.exr");
  }
}

TEST_CASE("surface layers: surfels have depth, position and normal, and no numbers",
          "[integration][layers]") {
  Scene scene;
  scene.request.meshes.clear();
  scene.render("a.exr");
  const Channels picture(scene.path("a.exr"));
  CHECK_FALSE(picture.values.contains("object_id.V"));
  CHECK_FALSE(picture.values.contains("material_id.V"));
  CHECK(picture.text.empty());
  Camera camera = *scene.request.camera;
  camera.width = 60;
  camera.height = 40;
  const glm::dvec3 forward = glm::normalize(camera.look_at - camera.position);
  int compared = 0;
  for (unsigned y = 0; y < 40; ++y) {
    for (unsigned x = 0; x < 60; ++x) {
      const std::vector<Met> met = samples_of_pixel(camera, x, y, 2);
      const int object = met[0].object;
      const auto is_inside = [&](const Met& m) {
        const double low = m.object == 1 ? -1 : 0;
        const double x_in = std::min(m.position.x - low, 1 - m.position.x),
                     z_in = std::min(m.position.z - low, 1 - m.position.z);
        return m.object > 0 && m.object == object && std::min(x_in, z_in) > 0.1;
      };
      if (!std::ranges::all_of(met, is_inside)) continue;
      const std::size_t pixel = std::size_t{y} * 60 + x;
      const Met nearest = nearest_of(met);
      if (std::abs(static_cast<double>(picture.at("Z", pixel)) - nearest.depth) > 0.02)
        continue;  // a disc of the edge of the lid
      // Discs overlap at heights of their own, which may choose another sample
      const double z = static_cast<double>(picture.at("Z", pixel));
      CHECK(z == Approx(nearest.depth).margin(3e-3));
      const glm::dvec3 place(picture.vector("P", pixel));
      CHECK(place.y == Approx(nearest.position.y).margin(2e-3));
      CHECK(glm::distance(place, nearest.position) < 0.1);
      CHECK(glm::dot(place - camera.position, forward) == Approx(z).epsilon(1e-6));
      CHECK(picture.at("N.Y", pixel) > 0.999F);
      ++compared;
    }
  }
  CHECK(compared > 200);
  CHECK_THAT(scene.refusal("a.png", "object_id"), Contains("surfels do not know their objects"));
  CHECK_THAT(scene.refusal("a.png", "material_id"), Contains("surfels do not know their objects"));
  CHECK_FALSE(std::filesystem::exists(scene.path("a.png")));
}

TEST_CASE("surface layers: each place of an object has a number, and each file its materials",
          "[integration][layers]") {
  test::TemporaryDirectory dir;
  test::Notes notes;
  dir.file("a.obj", kShapes);
  dir.file("b.obj", kShapes);
  dir.file("c.ply",
           "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
           "property float z\nelement face 1\nproperty list uchar int vertex_indices\n"
           "end_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n");
  dir.file("all.scene.json", R"({"ptcx_scene": 1, "materials": {"brick": {}}, "objects": [
    {"file": "a.obj", "placements": [{"translate": [0, 0, 0]}, {"translate": [9, 0, 0]}]},
    {"file": "c.ply", "material": "brick"},
    {"file": "b.obj"},
    {"file": "b.obj", "material": "brick"}]})");
  const LoadedMeshes loaded =
      load_meshes({dir.path() / "all.scene.json"}, nullptr, {.backdrop = true}, {}, notes);
  const SurfaceIds ids(loaded.mesh);
  CHECK(ids.text().at("ptcx/objectNames") ==
        R"({"1":"a.obj:floor","2":"a.obj:lid","3":"a.obj:floor#2","4":"a.obj:lid#2",)"
        R"("5":"c.ply","6":"b.obj:floor","7":"b.obj:lid","8":"b.obj:floor#2","9":"b.obj:lid#2",)"
        R"("10":"ground","11":"wall"})");
  CHECK(ids.text().at("ptcx/materialNames") ==
        R"({"1":"a.obj:grey","2":"a.obj:red","3":"a.obj:blue","4":"brick","5":"b.obj:grey",)"
        R"("6":"b.obj:red","7":"b.obj:blue","8":"ground","9":"wall"})");
  // The floors and lids have two and four triangles
  const auto number = [&](std::uint32_t triangle) {
    return std::array{ids.at(triangle).object, ids.at(triangle).material};
  };
  using Pair = std::array<std::uint32_t, 2>;
  CHECK(number(0) == Pair{1, 1});
  CHECK(number(3) == Pair{2, 2});
  CHECK(number(4) == Pair{2, 3});
  CHECK(number(6) == Pair{3, 1});
  CHECK(number(11) == Pair{4, 3});
  CHECK(number(12) == Pair{5, 4});
  CHECK(number(13) == Pair{6, 5});
  CHECK(number(19) == Pair{8, 4});
  CHECK(number(25) == Pair{10, 8});
}

TEST_CASE("surface layers: names that occur again get numbers, and text that is no UTF-8 is mended",
          "[integration][layers]") {
  Mesh mesh;
  mesh.materials.resize(1);
  CHECK(SurfaceIds(mesh).text().at("ptcx/objectNames") == R"({"1":""})");
  mesh.objects = {"a", "a#2", "a", "a", "\xff"};
  CHECK(SurfaceIds(mesh).text().at("ptcx/objectNames") ==
        "{\"1\":\"a\",\"2\":\"a#2\",\"3\":\"a#3\",\"4\":\"a#4\",\"5\":\"\xef\xbf\xbd\"}");
}

TEST_CASE("surface layers: the number of most samples wins, of several the least",
          "[integration][layers]") {
  IdVotes votes;
  votes.begin(3, 9);
  for (const unsigned id : {7U, 5U, 5U, 7U, 3U}) votes.add(1, id);
  CHECK(votes.winner(0) == 0);
  CHECK(votes.winner(1) == 5);
  votes.add(1, 7);
  CHECK(votes.winner(1) == 7);
  votes.begin(3, 1);
  CHECK(votes.winner(1) == 0);
  // Behind sixteen different numbers no others count
  votes.begin(2, 100);
  for (unsigned id = 1; id <= 16; ++id) votes.add(0, id);
  for (unsigned i = 0; i < 9; ++i) votes.add(0, 99);
  votes.add(0, 12);
  CHECK(votes.winner(0) == 12);
  CHECK(votes.winner(1) == 0);
}

TEST_CASE("surface layers: pictures of them tell near from far, and numbers apart",
          "[integration][layers]") {
  Scene scene;
  scene.request.samples = 1;
  const std::vector<PictureTarget> targets{{scene.path("a.exr")},
                                           {scene.path("depth.png"), "depth"},
                                           {scene.path("normal.png"), "normal"},
                                           {scene.path("object.png"), "object_id"},
                                           {scene.path("material.png"), "material_id"}};
  render_picture(scene.request, targets, scene.notes);
  const Channels picture(scene.path("a.exr"));
  const Image depth = read_image(scene.path("depth.png")),
              normal = read_image(scene.path("normal.png"));
  float nearest = kNothing, farthest = 0;
  for (const float z : picture.values.at("Z")) {
    nearest = std::min(nearest, z);
    if (z != kNothing) farthest = std::max(farthest, z);
  }
  const auto stored = [](float linear) {
    return linear <= 0.0031308F ? 12.92F * linear : 1.055F * std::pow(linear, 1 / 2.4F) - 0.055F;
  };
  for (std::size_t i = 0; i < depth.pixels.size(); ++i) {
    const float z = picture.at("Z", i);
    const float grey = z == kNothing ? 0 : 1 - 0.9F * (z - nearest) / (farthest - nearest);
    REQUIRE(stored(depth.pixels[i].x) == Approx(grey).margin(0.003));
    const glm::vec3 up = z == kNothing ? glm::vec3(0) : glm::vec3(0.5F, 1, 0.5F);
    for (int c = 0; c < 3; ++c) REQUIRE(stored(normal.pixels[i][c]) == Approx(up[c]).margin(0.003));
  }
  for (const auto& [name, count] : {std::pair("object", 2U), std::pair("material", 3U)}) {
    const Image shown = read_image(scene.path(std::string(name) + ".png"));
    std::map<float, glm::vec3> colours;
    for (std::size_t i = 0; i < shown.pixels.size(); ++i) {
      const auto [at, is_new] =
          colours.try_emplace(picture.at(name + std::string("_id.V"), i), shown.pixels[i]);
      REQUIRE(at->second == shown.pixels[i]);
    }
    REQUIRE(colours.size() == count + 1);
    CHECK(colours.at(0) == glm::vec3(0));
    for (unsigned a = 0; a < count; ++a)
      CHECK(glm::distance(colours.at(static_cast<float>(a)),
                          colours.at(static_cast<float>(a + 1))) > 0.1F);
  }
}

TEST_CASE("surface layers: a texture has numbers and no depth, vertices have neither",
          "[integration][layers]") {
  Scene scene;
  scene.dir.file("b.obj",
                 "v -1 0 -1\nv 1 0 -1\nv 1 0 1\nv -1 0 1\nvt 0 0\nvt 0.5 0\nvt 0.5 1\nvt 0 1\n"
                 "vt 1 0\nvt 1 1\nv -1 0.5 -1\nv 1 0.5 -1\nv 1 0.5 1\nv -1 0.5 1\n"
                 "o floor\nusemtl grey\nf 4/4 3/3 2/2 1/1\no lid\nusemtl red\n"
                 "f 8/3 7/6 6/5 5/2\n");
  scene.request.meshes = {scene.path("b.obj")};
  scene.request.camera.reset();
  SECTION("texture") {
    scene.request.texture = TextureTarget{};
    scene.request.size = {{16, 16}};
    scene.render("a.exr");
    const Channels picture(scene.path("a.exr"));
    CHECK_FALSE(picture.values.contains("Z"));
    CHECK_FALSE(picture.values.contains("N.X"));
    CHECK(picture.text.at("ptcx/objectNames") == R"({"1":"b.obj:floor","2":"b.obj:lid"})");
    for (std::size_t i = 0; i < 256; ++i) {
      CHECK(picture.at("object_id.V", i) == (i % 16 < 8 ? 1.0F : 2.0F));
      CHECK(picture.at("material_id.V", i) == (i % 16 < 8 ? 1.0F : 2.0F));
    }
    scene.render("o.png", "object_id");
    CHECK(std::filesystem::exists(scene.path("o.png")));
    CHECK_THAT(scene.refusal("d.png", "depth"), Contains("textures have no layer 'depth'"));
    CHECK_THAT(scene.refusal("d.png", "normal"), Contains("textures have no layer 'normal'"));
  }
  SECTION("vertices") {
    scene.request.size.reset();
    scene.request.vertices = true;
    CHECK_THAT(scene.refusal("d.glb", "object_id"), Contains("vertices have no layer 'object_id'"));
    CHECK_THAT(scene.refusal("d.glb", "depth"), Contains("vertices have no layer 'depth'"));
  }
}
