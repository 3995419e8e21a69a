// Builds a container of a mesh or cloud, and shades every point of it.
//
//   build_and_shade INPUT OUTPUT.ptcx
#include <cstdio>
#include <exception>
#include <filesystem>

#include <ptc/ptc.h>

int main(int argc, char** argv) {
  if (argc != 3) {
    std::fputs("usage: build_and_shade INPUT OUTPUT.ptcx\n", stderr);
    return 2;
  }
  const std::filesystem::path input = argv[1], output = argv[2];
  const std::filesystem::path scene = output.string() + ".scene.ptcx";
  ptc::Progress silent;
  try {
    // Points and an octree over them. A file of the same name is replaced only when all is written.
    ptc::BuildRequest build;
    build.inputs = {input};
    build.lights = ptc::LightRig{.sky = {.radiance = {1, 1, 1}}};
    build.sampling.count = 200'000;  // of a mesh; a cloud keeps its points
    build.run.memory_bytes = std::uint64_t{1} << 30;
    const ptc::BuildReport built = ptc::build_container(build, scene, silent);
    std::printf("built %llu points\n", static_cast<unsigned long long>(built.superblock.points));

    // Occlusion, sky light and one bounce for each of them, as channels of a new container.
    ptc::ShadeRequest shade;
    shade.scene = scene;
    shade.error = 0.05;
    shade.run = build.run;
    const ptc::LightingReport shaded = ptc::shade_container(shade, output, silent);
    std::printf("shaded %llu points\n", static_cast<unsigned long long>(shaded.receivers));
    std::filesystem::remove(scene);
    return 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "build_and_shade: %s\n", error.what());
    return 1;
  }
}
