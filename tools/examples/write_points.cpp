// Writes a container of points that a program makes: a lit sphere, under an octree.
//
//   write_points OUTPUT.ptcx
#include <cmath>
#include <cstdio>
#include <exception>
#include <numbers>

#include <ptc/io/cloud/record.h>
#include <ptc/octree/build_pages.h>
#include <ptc/parallel/thread_pool.h>
#include <ptc/sort/external_sort.h>

namespace {

// Point i of n that are spread evenly over a sphere of radius 1: a disc of 1/n of its area, lit
// from above.
ptc::Surfel point_of_sphere(int i, int n) {
  const double z = 1 - (2 * i + 1.0) / n, ring = std::sqrt(1 - z * z);
  const double turn = i * std::numbers::pi * (3 - std::sqrt(5.0));
  ptc::Surfel surfel;
  surfel.position = {ring * std::cos(turn), ring * std::sin(turn), z};
  surfel.normal = surfel.position;
  surfel.radius = static_cast<float>(std::sqrt(2 * std::numbers::pi / n));  // area = 2 r^2
  surfel.albedo = {0.7F, 0.7F, 0.7F};
  surfel.radiance = surfel.albedo * static_cast<float>(z > 0 ? z : 0);
  return surfel;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fputs("usage: write_points OUTPUT.ptcx\n", stderr);
    return 2;
  }
  try {
    // The lattice of the file; records of points in it, sorted along the Z-curve under a cap.
    constexpr int kPoints = 100'000;
    const ptc::Frame frame = ptc::frame_around({-1, -1, -1}, {1, 1, 1});
    const ptc::ThreadPool threads;
    ptc::ExternalSorter sorter({.memory_bytes = std::uint64_t{64} << 20}, threads, {});
    for (int i = 0; i < kPoints; ++i) {
      const ptc::PointRecord record = ptc::to_record(point_of_sphere(i, kPoints), frame);
      sorter.add({&record, 1});
    }

    // Pages of points and nodes, then the directory. The file appears when finish() returns.
    ptc::ContainerWriter writer(argv[1], {.frame = frame});
    ptc::Progress silent;
    const auto sorted = sorter.finish();
    writer.finish({}, ptc::build_pages(*sorted, writer, {}, threads, silent));
    return 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "write_points: %s\n", error.what());
    return 1;
  }
}
