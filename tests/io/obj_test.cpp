// Meshes and materials from OBJ.
#include <catch2/catch.hpp>

#include "engine/base/error.h"
#include "engine/io/image/byte_range.h"
#include "engine/io/mesh/mesh_soup.h"
#include "tests/io/files.h"

using namespace ptc;
using Catch::Matchers::Contains;
using Catch::Matchers::EndsWith;

namespace {

const std::string kSquare = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

MeshFile read(const test::TemporaryDirectory& scratch, const std::string& text) {
  return read_mesh(scratch.file("a.obj", text));
}

std::string fault(const test::TemporaryDirectory& scratch, const std::string& text) {
  return refusal([&] { static_cast<void>(read(scratch, text)); });
}

}  // namespace

TEST_CASE("obj: indices count from one or from the end, and may leave out any part", "[io][mesh]") {
  const test::TemporaryDirectory scratch;
  const std::string start = kSquare + "vt 0.5\nvt 0 1 7\nvn 0 0 1\n";
  for (const char* face : {"f 1 2 3", "f -4 -3 -2", "f 1/1 2/1 3/2", "f 1//1 2//1 3//1",
                           "f 1/1/1 2/2/1 3/2/1", "f 1/1/ 2/1/ 3/1/", "f 1/-2/-1 2/-1/-1 3/1/1",
                           "  f\t1 2 \\\n 3 # comment", "f 1 2 \\\r\n3\r", "f +1 +2 +3"}) {
    const Mesh mesh = read(scratch, start + face + "\n").mesh;
    REQUIRE(mesh.triangles.size() == 1);
    CHECK(mesh.positions[mesh.triangles[0][1]] + glm::vec3(mesh.origin) == glm::vec3(1, 0, 0));
  }
}

TEST_CASE("obj: corners that differ in any index become separate vertices", "[io][mesh]") {
  const test::TemporaryDirectory scratch;
  const std::string start = kSquare + "vt 0 0\nvt 1 1\nvn 0 0 1\nvn 0 1 0\n";
  const Mesh shared = read(scratch, start + "f 1/1/1 2/1/1 3/1/1\nf 1/1/1 3/1/1 4/1/1\n").mesh;
  CHECK(shared.positions.size() == 4);
  const Mesh split = read(scratch, start + "f 1/1/1 2/1/1 3/1/1\nf 1/2/1 3/1/2 4/1/1\n").mesh;
  CHECK(split.positions.size() == 6);
  CHECK(split.uvs[split.triangles[1][0]] == glm::vec2(1, 1));
  CHECK(split.normals[split.triangles[1][1]] == glm::vec3(0, 1, 0));
  CHECK(split.normals[split.triangles[0][2]] == glm::vec3(0, 0, 1));
}

TEST_CASE("obj: numbers behind a position are its colour, and vertices without one are white",
          "[io][mesh]") {
  const test::TemporaryDirectory scratch;
  const Mesh mesh = read(scratch,
                         "v 0 0 0\nv 1 0 0 1 0 0.5\nv 1 1 0 2 -1 0\nv 0 1 0 1\n"
                         "f 1 2 3\nf 1 3 4\n")
                        .mesh;
  REQUIRE(mesh.colours.size() == mesh.positions.size());
  const auto colour = [&](std::size_t triangle, std::size_t k) {
    return mesh.colours[mesh.triangles[triangle][k]];
  };
  CHECK(colour(0, 0) == glm::vec3(1));
  CHECK(colour(0, 1).x == 1);
  CHECK(colour(0, 1).y == 0);
  CHECK(static_cast<double>(colour(0, 1).z) == Approx(0.21404).epsilon(1e-4));
  CHECK(colour(0, 2) == glm::vec3(1, 0, 0));
  CHECK(colour(1, 2) == glm::vec3(1));  // a weight is no colour
  CHECK(mesh.materials[0].albedo == glm::vec3(1));
  // Wherever the first colour stands
  const Mesh late = read(scratch,
                         "usemtl none\nv 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\nv 0 1 0 1 0 0\n"
                         "f 1 3 4\n")
                        .mesh;
  CHECK(late.materials[0].albedo == glm::vec3(1));
  CHECK(late.colours[late.triangles[1][2]] == glm::vec3(1, 0, 0));
  const Mesh grey = read(scratch, kSquare + "f 1 2 3\n").mesh;
  CHECK(grey.colours.empty());
  CHECK(grey.materials[0].albedo == glm::vec3(0.5F));
}

TEST_CASE("obj: a texture with -clamp ends at its borders", "[io][mesh]") {
  const test::TemporaryDirectory scratch;
  write_png(scratch.path() / "a.png", {1, 1, {glm::vec3(1)}});
  scratch.file("a.mtl",
               "newmtl a\nmap_Kd -clamp on a.png\nmap_Ke a.png\nnewmtl b\nmap_Kd -clamp on "
               "a.png\nmap_Kd -clamp off a.png\n");
  const Mesh mesh =
      read(scratch, "mtllib a.mtl\n" + kSquare + "usemtl a\nf 1 2 3\nusemtl b\nf 1 3 4\n").mesh;
  REQUIRE(mesh.materials.size() == 2);
  REQUIRE(mesh.materials[0].texture);
  CHECK(mesh.materials[0].wrap == TextureWrap{Wrap::clamp, Wrap::clamp});
  CHECK(mesh.materials[0].emission_wrap == TextureWrap{});
  CHECK(mesh.materials[1].wrap == TextureWrap{});
}

TEST_CASE("obj: d, Tr and map_d say how opaque a material is", "[io][mesh]") {
  const test::TemporaryDirectory scratch;
  // A TGA of two pixels with alpha 0 and 255, a PNG without alpha, and a TGA that is all opaque
  scratch.file("a.tga", tga_with_alpha({0, 255}));
  scratch.file("solid.tga", tga_with_alpha({255, 255}));
  write_png(scratch.path() / "grey.png", {2, 1, {glm::vec3(0), glm::vec3(1)}});
  scratch.file("a.mtl",
               "newmtl a\nd 0.25\nnewmtl b\nTr 0.25\nnewmtl c\nmap_d a.tga\nnewmtl d\n"
               "map_d grey.png\nnewmtl e\nmap_d solid.tga\nd nan\nd\nnewmtl f\nd -1\nnewmtl g\n"
               "map_Kd a.tga\nd 7\n");
  std::string text = kSquare + "mtllib a.mtl\n";
  for (const char* name : {"a", "b", "c", "d", "e", "f", "g"})
    text += "usemtl " + std::string(name) + "\nf 1 2 3\n";
  const MeshFile file = read(scratch, text);
  CHECK(file.warnings.empty());
  const std::vector<Material>& materials = file.mesh.materials;
  REQUIRE(materials.size() == 7);
  const std::vector<float> opacity{0.25F, 0.75F, 1, 1, 1, 0, 1};
  for (std::size_t i = 0; i < 7; ++i) {
    CHECK(materials[i].opacity == opacity[i]);
    CHECK(materials[i].opacity_cutoff == 0);
    CHECK((materials[i].opacity_texture != nullptr) == (i == 2 || i == 3));
    CHECK(materials[i].is_opaque() == (i == 4 || i == 6));
  }
  for (const std::size_t i : {2U, 3U}) {
    CHECK(materials[i].opacity_texture->at(0, 0) == glm::vec3(0));
    CHECK(materials[i].opacity_texture->at(1, 0) == glm::vec3(1));
  }
  // A material that takes the place of all keeps their opacity
  const Mesh other =
      read_mesh(scratch.path() / "a.obj", {.material = Material{.albedo = glm::vec3(0.75F)}}).mesh;
  CHECK(other.materials[0].opacity == 0.25F);
  CHECK(other.materials[2].opacity_texture);
  CHECK(other.materials[2].albedo == glm::vec3(0.75F));
}

TEST_CASE("obj: faces without normals among others get flat ones", "[io][mesh]") {
  const test::TemporaryDirectory scratch;
  const Mesh mesh =
      read(scratch, kSquare + "v 0 0 5\nvn 0 1 1\nf 1//1 2//1 3//1\nf 1 4 3\nf 1 2 5\n").mesh;
  REQUIRE(mesh.normals.size() == mesh.positions.size());
  CHECK(mesh.normals[mesh.triangles[1][0]] == glm::vec3(0, 0, -1));
  CHECK(mesh.normals[mesh.triangles[2][0]] == glm::vec3(0, -1, 0));
  CHECK(mesh.normals[mesh.triangles[2][2]] == glm::vec3(0, -1, 0));
}

TEST_CASE("obj: millimetres are kept ten million metres from the origin", "[io][mesh]") {
  const test::TemporaryDirectory scratch;
  const Mesh mesh =
      read(scratch, "v 10000000.001 0 0\nv 10000000.003 0 0\nv 10000000.001 0.002 0\nf 1 2 3\n")
          .mesh;
  CHECK(mesh.origin == glm::dvec3(1e7, 0, 0));
  CHECK(static_cast<double>(mesh.positions[1].x) == Approx(0.003).epsilon(1e-6));
}

TEST_CASE("obj: objects are what follows an o, or a g without any o before it", "[io][mesh]") {
  const test::TemporaryDirectory scratch;
  const auto check = [&](const std::string& text, const std::vector<std::string>& objects,
                         const std::vector<ObjectRun>& runs) {
    INFO(text);
    const MeshFile file = read(scratch, kSquare + text);
    CHECK(file.mesh.objects == objects);
    CHECK(file.mesh.object_runs == runs);
    CHECK(file.warnings.empty());
  };
  check("f 1 2 3 4\n", {}, {});
  check("o a\nf 1 2 3\no b c # d\nf 1 2 3 4\nf 1 3 4\n", {"a", "b c"}, {{0, 0}, {1, 1}});
  check("o a\ng x\nf 1 2 3\ng y\nf 1 2 3\n", {"a"}, {{0, 0}});
  check("g x\nf 1 2 3\ng y z\nf 1 2 3\n", {"x", "y z"}, {{0, 0}, {1, 1}});
  check("g x\nf 1 2 3\no y\nf 1 2 3\ng z\nf 1 3 4\n", {"x", "y"}, {{0, 0}, {1, 1}});
  // An object goes on, one has no triangle with an area, and the first is not named
  check("f 1 2 3\no a\nf 2 3 4\no b\nf 1 1 2\no a\nf 1 2 3\n", {"a", "", "b"},
        {{0, 1}, {1, 0}, {2, 0}});
  check("o a\no b\nf 1 2 3\n", {"a", "b"}, {{0, 1}});
  // The last object has no triangle with an area
  check("o a\nf 1 2 3\no b\nf 1 1 2\n", {"a", "b"}, {{0, 0}});
  check("o " + std::string(300, 'n') + "\nf 1 2 3\n", {std::string(255, 'n')}, {{0, 0}});
}

TEST_CASE("obj: too many objects count as one and are told, and so do those on the disk",
          "[io][mesh]") {
  const test::TemporaryDirectory scratch;
  std::string text = kSquare;
  for (int i = 0; i < 65536; ++i) text += "g " + std::to_string(i) + "\n";
  text += "f 1 2 3\n";
  const MeshFile most = read(scratch, text);
  CHECK(most.mesh.objects.size() == 65536);
  CHECK(most.warnings.empty());
  const MeshFile more = read(scratch, text + "g one\nf 1 2 3\ng two\nf 1 2 3\n");
  CHECK(more.mesh.objects.empty());
  CHECK(more.mesh.object_runs.empty());
  REQUIRE(more.warnings.size() == 1);
  CHECK_THAT(more.warnings[0], Contains("too many"));
  // Names count for the memory that reading takes
  const auto path = scratch.file("a.obj", text);
  const MeshRoom room{.memory_bytes = std::uint64_t{4} << 20, .temp_directory = scratch.path()};
  CHECK(read_mesh(path, room).spilled);
  scratch.file("a.obj", kSquare + "f 1 2 3\ng two\nf 1 2 3\n");
  CHECK_FALSE(read_mesh(path, room).spilled);
}

TEST_CASE("obj: an emission texture times Ke 0 0 0 is dark and told, and dark meshes do not emit",
          "[io][mesh]") {
  const test::TemporaryDirectory scratch;
  write_png(scratch.path() / "a.png", {1, 1, {glm::vec3(1, 0, 0)}});
  scratch.file("a.mtl",
               "newmtl first\nKe 0 0 0\nmap_Ke a.png\nnewmtl unused\nKe 1 1 1\n"
               "newmtl last\nmap_Ke a.png\nKe 0 0 0\n");
  const std::string head = kSquare + "mtllib a.mtl\nusemtl first\nf 1 2 3\nusemtl last\nf 1 2 3\n";
  const MeshFile file = read(scratch, head);
  REQUIRE(file.warnings.size() == 1);
  CHECK_THAT(file.warnings[0], Catch::Contains("2 materials emit nothing") &&
                                   Catch::Contains("first") && Catch::Contains("last"));
  CHECK_FALSE(file.mesh.emits());
  CHECK(read(scratch, head + "usemtl unused\nf 1 3 4\n").mesh.emits());
  Mesh unused = file.mesh;
  unused.materials.push_back({.name = "unused", .emission = glm::vec3(1)});
  CHECK_FALSE(unused.emits());
}

TEST_CASE("obj: materials come from the library, textures from files next to it", "[io][mesh]") {
  const test::TemporaryDirectory scratch;
  write_png(scratch.path() / "my red.png", {1, 1, {glm::vec3(1, 0, 0)}});
  scratch.file("a b.mtl",
               "Kd 9 9 9\nnewmtl red wall\nKd 0.5 0.25 2\nmap_Kd -s 1 1 -o 0.5 -bm 2 my red.png\n"
               "newmtl lamp # a comment\nKd 0.1\nKe 17 12 4\nillum 2\n"
               "newmtl odd\nKd spectral file.rfl\nmap_Ke none.png\nmap_Kd none.png\n"
               "newmtl screen\nmap_Ke my red.png\nnewmtl dim\nmap_Ke my red.png\nKe 0.5 0.5 0.5\n"
               "newmtl lamp\nKe 0 0 0\n");
  const MeshFile file = read(scratch, kSquare +
                                          "mtllib a b.mtl\nf 1 2 3\nusemtl red wall\nf 1 2 3\n"
                                          "usemtl lamp\nf 1 2 4\nusemtl missing\nf 1 3 4\n"
                                          "usemtl lamp\nf 2 3 4\nusemtl odd\nf 2 3 4\n"
                                          "usemtl screen\nf 1 2 3\nusemtl dim\nf 1 2 3\n");
  const Mesh& mesh = file.mesh;
  CHECK(mesh.material_of == std::vector<std::uint16_t>{0, 1, 2, 3, 2, 4, 5, 6});
  REQUIRE(mesh.materials.size() == 7);
  CHECK(mesh.materials[0].albedo == glm::vec3(0.5F));
  CHECK(mesh.materials[1].name == "red wall");
  CHECK(mesh.materials[1].albedo == glm::vec3(0.5F, 0.25F, 1));
  REQUIRE(mesh.materials[1].texture);
  CHECK(mesh.materials[1].texture->at(0, 0) == glm::vec3(1, 0, 0));
  CHECK(mesh.materials[2].albedo == glm::vec3(0.1F));
  CHECK(mesh.materials[2].emission == glm::vec3(17, 12, 4));
  CHECK_FALSE(mesh.materials[4].texture);
  CHECK_FALSE(mesh.materials[4].emission_texture);
  CHECK(mesh.materials[4].emission == glm::vec3(0));
  CHECK(mesh.materials[5].emission == glm::vec3(1));
  REQUIRE(mesh.materials[5].emission_texture);
  CHECK(mesh.materials[5].emission_texture->at(0, 0) == glm::vec3(1, 0, 0));
  CHECK(mesh.materials[6].emission == glm::vec3(0.5F));
  CHECK(mesh.materials[6].emission_texture == mesh.materials[5].emission_texture);
  std::string warnings;
  for (const std::string& warning : file.warnings) warnings += warning + "\n";
  CHECK(file.warnings.size() == 3);
  CHECK_THAT(warnings, Contains("a colour that is not R G B is left out") &&
                           Contains("a b.mtl: line 10") &&
                           Contains("a texture is left out and the plain colour of its material is "
                                    "used: none.png: No such file") &&
                           Contains("a material is not defined and becomes plain grey: 'missing'"));
}

TEST_CASE("obj: kinds of statements that are left out are told once each", "[io][mesh]") {
  const test::TemporaryDirectory scratch;
  scratch.file("a.mtl",
               "newmtl a\nKd 1 0 0\nKs 1 1 1\nillum 2\nmap_Bump b.png\nnewmtl b\nKs 0 0 0\n");
  const MeshFile file = read(scratch, kSquare +
                                          "mtllib a.mtl\nusemtl a\ns 1\nf 1 2 3\nl 1 2\nl 2 3\n"
                                          "curv 0 1 1 2\n");
  REQUIRE(file.warnings.size() == 1);
  CHECK(file.warnings[0] ==
        "4 kinds of statements are left out: 'Ks' of materials; 'map_Bump' of materials; 'l'; "
        "'curv'");
}

TEST_CASE("obj: a line may name several libraries, with escaped blanks and missing ones",
          "[io][mesh]") {
  const test::TemporaryDirectory scratch;
  scratch.file("one.mtl", "newmtl a\nKd 1 0 0\n");
  scratch.file("two three.mtl", "newmtl b\nKd 0 1 0\n");
  const MeshFile file = read(scratch, kSquare +
                                          "mtllib one.mtl two\\ three.mtl none.mtl\n"
                                          "usemtl a\nf 1 2 3\nusemtl b\nf 1 2 3\n");
  REQUIRE(file.mesh.materials.size() == 2);
  CHECK(file.mesh.materials[0].albedo == glm::vec3(1, 0, 0));
  CHECK(file.mesh.materials[1].albedo == glm::vec3(0, 1, 0));
  REQUIRE(file.warnings.size() == 1);
  CHECK_THAT(file.warnings[0],
             Contains("a material library is left out") && Contains("grey: none.mtl: No such"));
}

TEST_CASE("obj: a texture that is not a picture is reported once, with the reason", "[io][mesh]") {
  const test::TemporaryDirectory scratch;
  scratch.file("a.png", "no picture");
  scratch.file("a.mtl", "newmtl a\nmap_Kd a.png\nnewmtl b\nmap_Kd a.png\n");
  const MeshFile file =
      read(scratch, kSquare + "mtllib a.mtl\nusemtl a\nf 1 2 3\nusemtl b\nf 1 2 3\n");
  REQUIRE(file.warnings.size() == 1);
  CHECK_THAT(file.warnings[0], EndsWith("is used: a.png: not a PNG, JPEG, BMP, HDR, TGA or EXR "
                                        "picture"));
}

TEST_CASE("obj: a texture that is named in several ways is loaded as one picture", "[io][mesh]") {
  const test::TemporaryDirectory scratch;
  write_png(scratch.path() / "a.png", {1, 1, {glm::vec3(1, 0, 0)}});
  scratch.file("a.mtl", "newmtl a\nmap_Kd a.png\nnewmtl b\nmap_Kd .\\././x/..//a.png\n");
  const Mesh mesh =
      read(scratch, kSquare + "mtllib a.mtl\nusemtl a\nf 1 2 3\nusemtl b\nf 1 2 3\n").mesh;
  REQUIRE(mesh.materials.size() == 2);
  REQUIRE(mesh.materials[0].texture);
  CHECK(mesh.materials[0].texture == mesh.materials[1].texture);
}

// This would take ten minutes if the library were read for each of the lines.
TEST_CASE("obj: a library that is named on 30,000 lines is read once", "[io][mesh]") {
  const test::TemporaryDirectory scratch;
  std::string library = "newmtl a\nKd 1 0 0\n";
  for (int i = 0; i < 40'000; ++i) library += "newmtl m" + std::to_string(i) + "\nKd 1 1 1\n";
  scratch.file("a.mtl", library);
  std::string lines;
  for (int i = 0; i < 15'000; ++i) lines += "mtllib a.mtl\nmtllib ./a.mtl none.mtl\n";
  const MeshFile file = read(scratch, kSquare + lines + "usemtl a\nf 1 2 3\n");
  CHECK(file.mesh.materials[0].albedo == glm::vec3(1, 0, 0));
  REQUIRE(file.warnings.size() == 1);
  CHECK_THAT(file.warnings[0], Contains("a material library is left out"));
}

TEST_CASE("textures: pictures with more pixels than their files justify are left out",
          "[io][mesh]") {
  const test::TemporaryDirectory scratch;
  const Image white{100, 100, std::vector<glm::vec3>(10'000, glm::vec3(1))};
  std::vector<std::string> pictures;
  for (const char* name : {"a.png", "b.png", "c.png"}) {
    write_png(scratch.path() / name, white);
    pictures.push_back(slurp(scratch.path() / name));
  }
  const std::uint64_t bytes = pictures[0].size();
  REQUIRE(256 * bytes > 10'000);  // so that the bytes of one more justify its pixels, as in a file
  MeshWarnings warnings;
  TextureLoader loader(scratch / "a.obj", warnings, nullptr, 0);
  for (const char* name : {"a.png", "./a.png", "b.png", "c.png"}) CHECK(loader.load(name));
  CHECK(warnings.lines().empty());

  const auto decode = [&](TextureLoader& from, const std::string& name) {
    return from.decode(name, ByteRange(std::as_bytes(std::span(pictures[0]))), 0);
  };
  TextureLoader poor(scratch / "a.obj", warnings, nullptr, 25'000);
  CHECK(decode(poor, "image 0"));
  CHECK(decode(poor, "image 1"));
  CHECK_FALSE(decode(poor, "image 2"));
  REQUIRE(warnings.lines().size() == 1);
  CHECK_THAT(warnings.lines()[0],
             EndsWith("image 2: 100 x 100 pixels are more than the 5000 that may still be loaded"));
  CHECK(poor.load("a.png"));  // by its own bytes
}

TEST_CASE("obj: files that break a rule are refused by line", "[io][mesh]") {
  const test::TemporaryDirectory scratch;
  CHECK_THAT(fault(scratch, kSquare + "f 1 2 0\n"),
             EndsWith("line 5: an index refers to no vertex"));
  CHECK_THAT(fault(scratch, kSquare + "f 1 2 -5\n"),
             EndsWith("line 5: an index refers to no vertex"));
  CHECK_THAT(fault(scratch, kSquare + "f 1 2 x\n"),
             EndsWith("line 5: an index refers to no vertex"));
  CHECK_THAT(fault(scratch, kSquare + "f 1 2 4294967296\n"), EndsWith("refers to no vertex"));
  CHECK_THAT(fault(scratch, kSquare + "f 1 2 5\n"),
             EndsWith("polygon 0: an index refers to no vertex"));
  CHECK_THAT(fault(scratch, kSquare + "f 1/1 2/1 3/1\n"),
             EndsWith("polygon 0: an index refers to no vertex"));
  CHECK_THAT(fault(scratch, kSquare + "f 1//1 2//1 3//1\n"),
             EndsWith("an index refers to no vertex"));
  CHECK_THAT(fault(scratch, "v 1 2\n"), EndsWith("line 1: the vertex has too few values"));
  CHECK_THAT(fault(scratch, "v 1 2 3.1+e2\n"), EndsWith("line 1: a value is not a number"));
  CHECK_THAT(fault(scratch, "v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"),
             EndsWith("vertex 0: the position is not finite"));
  CHECK_THAT(fault(scratch, kSquare + "l 1 2\np 1\nf 1 2\n"),
             EndsWith("a.obj: the mesh has no triangle"));
  CHECK_THAT(fault(scratch, ""), EndsWith("a.obj: the mesh has no triangle"));
}

TEST_CASE("obj: every truncation gives a mesh or a refusal", "[io][mesh]") {
  const test::TemporaryDirectory scratch;
  const std::string whole =
      kSquare + "vt 0 0\nvn 0 0 1\nusemtl a\nf 1/1/1 2/1/1 \\\n3/1/1 4/1/1\nf -1 -2 -3\n";
  for (std::size_t size = 0; size < whole.size(); ++size) {
    const std::string text = fault(scratch, whole.substr(0, size));
    CHECK((text.empty() || text.find("a.obj: ") != std::string::npos));
  }
}
