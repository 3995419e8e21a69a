// Prints how many points a container holds, and the first of them.
//
//   read_points FILE.ptcx
#include <cstdio>
#include <exception>

#include <ptc/format/morton.h>
#include <ptc/store/point_scan.h>
#include <ptc/store/reader.h>

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fputs("usage: read_points FILE.ptcx\n", stderr);
    return 2;
  }
  try {
    const ptc::ContainerReader container(argv[1]);
    std::printf("%llu points on %zu pages\n",
                static_cast<unsigned long long>(container.superblock().points),
                container.point_pages().size());

    // Every page is verified as it is read: damaged bytes are an error that names them.
    const ptc::Frame& frame = container.header().frame;
    ptc::PointScan scan(container);
    if (!scan.next()) return 0;
    for (std::uint32_t i = 0; i < scan.count() && i < 5; ++i) {
      const ptc::PointRecord point = scan.points()[i];
      const auto position = frame.to_position(ptc::decode_morton(point.key));
      std::printf("%g %g %g  radius %g\n", position[0], position[1], position[2],
                  static_cast<double>(point.radius));
    }
    return 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "read_points: %s\n", error.what());
    return 1;
  }
}
