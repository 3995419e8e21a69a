// Normals by the Point Cloud Library, which `ptcbench scan --pcl` compares with those of PTCX.
//
//   pcl_normals POINTS NORMALS FACTS
//
// POINTS has three doubles a point, NORMALS will have three floats a point, and FACTS, in JSON, the
// CPU time in seconds and the bytes of memory that PCL took beyond those of the points.
#include <sys/resource.h>

#include <array>
#include <cstdio>
#include <ctime>
#include <exception>
#include <fstream>
#include <vector>

#include <nlohmann/json.hpp>
#include <pcl/features/normal_3d.h>
#include <pcl/point_types.h>
#include <pcl/search/kdtree.h>

namespace {

constexpr int kNeighbours = 30;

long resident_kib() {
  rusage used{};
  getrusage(RUSAGE_SELF, &used);
  return used.ru_maxrss;
}

void estimate(const char* points, const char* normals, const char* facts) {
  const pcl::PointCloud<pcl::PointXYZ>::Ptr cloud(new pcl::PointCloud<pcl::PointXYZ>);
  std::ifstream in(points, std::ios::binary);
  std::array<double, 3> p{};
  while (in.read(reinterpret_cast<char*>(p.data()), sizeof p)) {
    cloud->emplace_back(static_cast<float>(p[0]), static_cast<float>(p[1]),
                        static_cast<float>(p[2]));
  }
  const long before = resident_kib();
  const std::clock_t start = std::clock();
  pcl::NormalEstimation<pcl::PointXYZ, pcl::Normal> estimation;
  estimation.setInputCloud(cloud);
  estimation.setSearchMethod(std::make_shared<pcl::search::KdTree<pcl::PointXYZ>>());
  estimation.setKSearch(kNeighbours);
  pcl::PointCloud<pcl::Normal> found;
  estimation.compute(found);
  const double seconds = static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
  std::ofstream out(normals, std::ios::binary);
  for (const pcl::Normal& n : found) {
    const std::array<float, 3> normal{n.normal_x, n.normal_y, n.normal_z};
    out.write(reinterpret_cast<const char*>(normal.data()), sizeof normal);
  }
  std::ofstream(facts) << nlohmann::json{
      {"normals", seconds}, {"all", seconds}, {"bytes", 1024 * (resident_kib() - before)}};
}

}  // namespace

int main(int argc, char** argv) try {
  if (argc != 4) {
    std::fputs("usage: pcl_normals POINTS NORMALS FACTS\n", stderr);
    return 2;
  }
  estimate(argv[1], argv[2], argv[3]);
  return 0;
} catch (const std::exception& error) {
  std::fprintf(stderr, "pcl_normals: %s\n", error.what());
  return 1;
}
