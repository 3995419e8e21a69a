// Whatever mesh readers leave out or replace is reported to the progress of the run.
#include <algorithm>
#include <fstream>
#include <map>

#include <catch2/catch.hpp>

#include "engine/pipeline/scene_record.h"
#include "engine/ptc.h"
#include "tests/support/notes.h"
#include "tests/support/scenes.h"

using namespace ptc;
using namespace ptc::test;
using Catch::Matchers::Contains;

namespace {

/// A triangle whose texture is missing.
void write_bare(const std::filesystem::path& directory, const std::string& name) {
  std::ofstream(directory / (name + ".mtl")) << "newmtl wood\nmap_Kd " << name << ".png\n";
  std::ofstream(directory / (name + ".obj")) << "mtllib " << name << ".mtl\nusemtl wood\n"
                                             << "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
}

void check_note(const Notes& notes, const std::filesystem::path& mesh) {
  CHECK(std::ranges::count_if(notes.texts, [&](const std::string& text) {
          return text.starts_with(mesh.string() + ": a texture is left out") &&
                 text.find(mesh.stem().string() + ".png: No such file") != std::string::npos;
        }) == 1);
}

}  // namespace

TEST_CASE("warnings: unit and reference system come from one file", "[integration]") {
  using Texts = std::map<std::string, std::string>;
  const auto joined = [](Texts text, const Texts& added, std::size_t notes) {
    Notes progress;
    Texts named_by;
    for (const auto& [key, value] : text) named_by[key] = "first";
    join_texts(text, named_by, added, "second", progress);
    CHECK(progress.texts.size() == notes);
    for (const std::string& note : progress.texts) {
      CHECK_THAT(note, Contains("second: ") && Contains("first"));
    }
    return text;
  };
  CHECK(joined({}, {{"crs", "A"}, {"up", "z"}}, 0) == Texts{{"crs", "A"}, {"up", "z"}});
  CHECK(joined({{"crs", "A"}}, {{"crs", "B"}, {"time", "3"}}, 1) ==
        Texts{{"crs", "A"}, {"time", "3"}});
  CHECK(joined({{"metres_per_unit", "1"}}, {{"crs", "B"}, {"metres_per_unit", "0.3048"}}, 1) ==
        Texts{{"metres_per_unit", "1"}});
  CHECK(joined({{"crs", "A"}}, {{"up", "z"}}, 1) == Texts{{"crs", "A"}, {"up", "z"}});
  CHECK(joined({{"up", "y"}}, {{"up", "z"}}, 1) == Texts{{"up", "y"}});
  CHECK(joined({{"crs", "A"}, {"up", "z"}}, {{"crs", "A"}, {"up", "z"}}, 0).size() == 2);
}

TEST_CASE("warnings: build, append and render note once what a mesh file lacks", "[integration]") {
  const TemporaryDirectory dir;
  write_bare(dir.path(), "a");
  write_bare(dir.path(), "b");
  BuildRequest request{.inputs = {dir / "a.obj", dir / "b.obj"}};
  request.sampling.count = 500;
  request.run.threads = 1;
  Notes build;
  build_container(request, dir / "ab.ptcx", build);
  CHECK(build.texts.size() == 2);
  check_note(build, dir / "a.obj");
  check_note(build, dir / "b.obj");

  request.inputs.pop_back();
  request.append = dir / "ab.ptcx";
  Notes append;
  build_container(request, dir / "aba.ptcx", append);
  CHECK(append.texts.size() == 1);
  check_note(append, dir / "a.obj");

  RenderRequest picture;
  picture.scene = dir / "ab.ptcx";
  picture.meshes = {dir / "b.obj"};
  picture.size = {8, 8};
  picture.samples = 1;
  picture.run.threads = 1;
  Notes render;
  const PictureTarget target{.path = dir / "b.png"};
  render_picture(picture, {&target, 1}, render);
  CHECK(render.texts.size() == 1);
  check_note(render, dir / "b.obj");
}

TEST_CASE("warnings: points whose radius cannot be estimated are counted in a note",
          "[integration]") {
  const TemporaryDirectory dir;
  const auto notes_of = [&](const char* text) {
    std::ofstream(dir / "a.xyz") << text;
    BuildRequest request{.inputs = {dir / "a.xyz"}};
    request.run.threads = 1;
    Notes notes;
    build_container(request, dir / "a.ptcx", notes);
    return notes.texts;
  };
  const std::vector<std::string> lone = notes_of("1 2 3 0 0 1\n1 2 3 0 0 1\n");
  REQUIRE(lone.size() == 2);
  CHECK_THAT(lone[0], Contains("columns 4 to 6 are taken as normals"));
  CHECK_THAT(lone[1], Contains("2 points have no neighbours: their radius is 0"));
  CHECK(notes_of("1 2 3 0 0 1\n1 2 4 0 0 1\n").size() == 1);
}
