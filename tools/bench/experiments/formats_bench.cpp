// From a city in memory to files, and from files to a sort:
//
//   city --> PointWriter --> file --> open_points() --> records --> ExternalSorter
//                              |            `--------> positions -.
//                              '--> laspy, Open3D ---> positions --+--> largest difference
//
// A library runs in an interpreter of its own. What is timed of it is the call that reads or writes
// the file; what it reads stays in its memory and is not sorted.
#include "tools/bench/experiments/formats_bench.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <fstream>
#include <utility>

#include <fmt/format.h>

#include "engine/base/error.h"
#include "engine/io/cloud/point_writer.h"
#include "engine/io/cloud/points.h"
#include "engine/io/cloud/record.h"
#include "engine/parallel/thread_pool.h"
#include "engine/scene/procedural/city.h"
#include "engine/sort/external_sort.h"
#include "tools/bench/experiments/rival_run.h"
#include "tools/bench/references/timed_runs.h"
#include "tools/bench/scenes/work_file.h"

namespace ptc::bench {
namespace {

constexpr std::size_t kBlock = 1 << 14;  // surfels that are read or written at once

/// The program that runs the libraries. Arguments: library, work, file, written file, positions,
/// facts.
constexpr char kLibraries[] = R"(import json, sys, time
import numpy

library, work, path, written, positions, facts = sys.argv[1:]
if library == "laspy":
    import laspy
    def read(path): return laspy.read(path)
    def write(cloud, path): cloud.write(path)
    def places(cloud): return numpy.stack([cloud.x, cloud.y, cloud.z], axis=1)
else:
    import open3d
    def read(path): return open3d.io.read_point_cloud(path)
    def write(cloud, path): open3d.io.write_point_cloud(path, cloud)
    def places(cloud): return numpy.asarray(cloud.points)

cpu, wall = time.process_time(), time.perf_counter()
cloud = read(path)
if work == "write":
    cpu, wall = time.process_time(), time.perf_counter()
    write(cloud, written)
cpu, wall = time.process_time() - cpu, time.perf_counter() - wall
places(cloud).astype(numpy.float64).tofile(positions)
json.dump({"cpu": cpu, "wall": wall}, open(facts, "w"))
)";

struct Format {
  OutputFormat format;
  const char* ending;
  bool read = true;  ///< PTCX reads it, too
};
constexpr Format kFormats[] = {
    {OutputFormat::ply, ".ply"},          {OutputFormat::las, ".las"},
    {OutputFormat::pcd, ".pcd"},          {OutputFormat::xyz, ".xyz"},
    {OutputFormat::bgeo, ".bgeo"},        {OutputFormat::ptc, ".ptc"},
    {OutputFormat::usdc, ".usdc", false}, {OutputFormat::usda, ".usda", false}};

/// Returns the libraries that read and write files of an ending.
std::vector<std::string> libraries_of(const std::string& ending) {
  if (ending == ".las" || ending == ".laz") return {"laspy"};
  if (ending == ".ply" || ending == ".pcd" || ending == ".xyz" || ending == ".pts")
    return {"Open3D"};
  return {};
}

/// A scan of the city: points with a colour, an intensity, a class and a time.
struct City {
  explicit City(std::uint64_t points) {
    const auto source = make_city(points);
    std::vector<Surfel> block(kBlock);
    while (const std::size_t count = source->next(block))
      surfels.insert(surfels.end(), block.begin(),
                     block.begin() + static_cast<std::ptrdiff_t>(count));
    info = {.count = surfels.size(),
            .channels = {{.name = "intensity", .type = ChannelType::u16},
                         {.name = "classification", .type = ChannelType::u8},
                         {.name = "gps_time", .type = ChannelType::f64}},
            .has_albedo = true};
    rows.resize(surfels.size() * row_bytes(info.channels));
    std::byte* row = rows.data();
    for (std::size_t i = 0; i < surfels.size(); ++i) {
      Surfel& surfel = surfels[i];
      info.bounds.add(surfel.position);
      const auto intensity = static_cast<std::uint16_t>(i * 40503 >> 4);
      const auto kind = static_cast<std::uint8_t>(surfel.normal.y > 0.5F ? 2 : 6);
      const double time = 1e8 + 1e-5 * static_cast<double>(i);
      for (const auto& [value, bytes] :
           {std::pair<const void*, std::size_t>(&intensity, 2), {&kind, 1}, {&time, 8}}) {
        std::memcpy(row, value, bytes);
        row += bytes;
      }
      surfel.normal = glm::vec3(0);
      surfel.radius = 0;
      surfel.radiance = glm::vec3(0);
    }
  }

  PointWriteInfo info;
  std::vector<Surfel> surfels;
  std::vector<std::byte> rows;
};

void write_city(const City& city, OutputFormat format, const std::filesystem::path& path) {
  const auto writer = create_points(path, format, city.info);
  const std::size_t bytes = row_bytes(city.info.channels);
  for (std::size_t at = 0; at < city.surfels.size(); at += kBlock) {
    const std::size_t count = std::min(kBlock, city.surfels.size() - at);
    writer->write(std::span(city.surfels).subspan(at, count),
                  std::span(city.rows).subspan(at * bytes, count * bytes));
  }
  writer->finish();
}

std::vector<glm::dvec3> positions_of(const std::filesystem::path& path) {
  const PointFile file = open_points(path);
  std::vector<glm::dvec3> positions;
  std::vector<Surfel> block(kBlock);
  while (const std::size_t count = file.source->next(block)) {
    for (std::size_t i = 0; i < count; ++i) positions.push_back(block[i].position);
  }
  return positions;
}

/// Returns the largest difference between coordinates.
double difference(const std::vector<glm::dvec3>& a, const std::vector<glm::dvec3>& b,
                  const std::string& what) {
  if (a.size() != b.size())
    throw DataError(fmt::format("formats: {}: {} points in place of {}", what, a.size(), b.size()));
  double most = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    for (int axis = 0; axis < 3; ++axis) most = std::max(most, std::abs(a[i][axis] - b[i][axis]));
  }
  return most;
}

class FormatsRun : public BenchRun<FormatsOptions, FormatRow> {
 public:
  using BenchRun::BenchRun;

  std::vector<FormatRow> run() {
    progress_.begin("formats", std::size(kFormats) + options_.files.size(), "files");
    const City city(options_.points);
    std::vector<glm::dvec3> written;
    for (const Surfel& surfel : city.surfels) written.push_back(surfel.position);
    for (const Format& format : kFormats) measure_format(city, written, format);
    for (const auto& file : options_.files) {
      read(file, file.filename().string(), positions_of(file));
      finish_file();
    }
    progress_.end();
    return std::move(rows_);
  }

 private:
  void finish_file() {
    report();
    progress_.advance(1);
  }

  void measure_format(const City& city, const std::vector<glm::dvec3>& written,
                      const Format& format) {
    const WorkFile file(work_, std::string("-city") + format.ending);
    TimedRuns runs;
    for (unsigned i = 0; i < options_.repeats; ++i)
      runs.run([&] { write_city(city, format.format, file.path()); });
    FormatRow row{.file = format.ending, .work = "write", .method = "ptcx"};
    std::vector<glm::dvec3> positions;
    if (format.read) {  // what is read again tells how exactly it was written
      positions = positions_of(file.path());
      row.difference = difference(positions, written, format.ending);
    }
    add(std::move(row), file.path(), written.size(), runs);
    for (const std::string& library : libraries_of(format.ending))
      run_library(library, "write", format.ending, file.path(), nullptr);
    if (format.read) read(file.path(), format.ending, positions);
    finish_file();
  }

  void add(FormatRow row, const std::filesystem::path& path, std::size_t points,
           const Costs& costs) {
    row.points = points;
    row.bytes = std::filesystem::file_size(path);
    row.cpu = spread_of(costs.cpu);
    row.wall = spread_of(costs.wall);
    rows_.push_back(std::move(row));
  }

  /// Reads a file into a sort, and by the libraries.
  void read(const std::filesystem::path& path, const std::string& name,
            const std::vector<glm::dvec3>& positions) {
    Bounds bounds;
    for (const glm::dvec3& p : positions) bounds.add(p);
    const Frame frame = frame_around({bounds.low.x, bounds.low.y, bounds.low.z},
                                     {bounds.high.x, bounds.high.y, bounds.high.z});
    std::vector<MortonKey> sample;
    for (std::size_t i = 0; i < positions.size(); i += positions.size() / 4096 + 1)
      sample.push_back(
          encode_morton(frame.to_lattice({positions[i].x, positions[i].y, positions[i].z})));
    TimedRuns runs;
    for (unsigned i = 0; i < options_.repeats; ++i)
      runs.run([&] { sort_file(path, frame, sample, positions.size()); });
    add({.file = name, .work = "read", .method = "ptcx"}, path, positions.size(), runs);
    for (const std::string& library : libraries_of(path.extension().string()))
      run_library(library, "read", name, path, &positions);
  }

  /// Feeds the points of a file to a sort, as a build does.
  void sort_file(const std::filesystem::path& path, const Frame& frame,
                 const std::vector<MortonKey>& sample, std::size_t expected) {
    const ThreadPool executor(run_.threads);
    ExternalSorter sorter(
        {.memory_bytes = run_.memory_bytes, .temp_dirs = {work_}, .expected = expected}, executor,
        sample);
    const PointFile file = open_points(path);
    std::vector<Surfel> block(kBlock);
    std::vector<PointRecord> records(kBlock);
    while (const std::size_t count = file.source->next(block)) {
      executor.for_ranges(count, 1 << 11, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) records[i] = to_record(block[i], frame);
      });
      sorter.add(std::span(records).first(count));
    }
    if (sorter.statistics().points != expected)
      throw DataError("formats: " + path.string() + " gave another number of points");
  }

  /// Measures a library, if there is an interpreter.
  /// @param positions  those that PTCX reads of the file; null: they are not compared
  void run_library(const std::string& library, const std::string& work, const std::string& name,
                   const std::filesystem::path& path, const std::vector<glm::dvec3>* positions) {
    if (options_.python.empty()) return;
    const WorkFile places(work_, "-places"), written(work_, "-written" + path.extension().string());
    Costs costs;
    for (unsigned i = 0; i < options_.repeats; ++i) {
      const auto facts = run_python(
          options_.python, work_, kLibraries,
          {library, work, path.string(), written.path().string(), places.path().string()}, library);
      costs.add({.wall = facts.at("wall").get<double>(), .cpu = facts.at("cpu").get<double>()});
    }
    std::vector<glm::dvec3> read(std::filesystem::file_size(places.path()) / sizeof(glm::dvec3));
    std::ifstream in(places.path(), std::ios::binary);
    in.read(reinterpret_cast<char*>(read.data()),
            static_cast<std::streamsize>(read.size() * sizeof(glm::dvec3)));
    add({.file = name, .work = work, .method = library}, work == "write" ? written.path() : path,
        read.size(), costs);
    if (positions != nullptr) rows_.back().difference = difference(read, *positions, library);
  }
};

}  // namespace

std::vector<FormatRow> measure_formats(const FormatsOptions& options,
                                       const std::filesystem::path& work, const RunOptions& run,
                                       Progress& progress,
                                       const BenchRun<FormatsOptions, FormatRow>::Report& report) {
  return FormatsRun(options, work, run, progress, report).run();
}

}  // namespace ptc::bench
