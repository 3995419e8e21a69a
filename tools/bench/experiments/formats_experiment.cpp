// The experiment `ptcbench formats`: its table columns and its options.
#include "tools/bench/experiments/experiment.h"
#include "tools/bench/experiments/formats_bench.h"

namespace ptc::bench {
namespace {

constexpr char kFormatsReading[] =
    "Points of the procedural city with a colour, an intensity, a class and a time, written in "
    "each "
    "format and read again; further files are only read. Reading is what a build does: all values "
    "of each point are decoded and checked, and its record is added to the sort, which has not "
    "sorted yet when the clock stops. laspy and Open3D read the file into arrays in memory, Open3D "
    "without what is neither place nor colour; what is timed of them is that call, or the one that "
    "writes. CPU time is that of all threads together. Difference: the largest one between a "
    "coordinate that was written and the one that is read again, in units of 1 m; in a row of a "
    "library that reads, between its coordinates and those that ptcx reads.";

const Columns<FormatRow>& formats_columns() {
  using R = FormatRow;
  static const Columns<R> columns{
      {"file", {"file"}, &R::file},
      {"work", {"work"}, &R::work},
      {"method", {"method"}, &R::method},
      {"points", {"points"}, &R::points},
      {"bytes_per_point",
       {"bytes/point", "{:.1f}"},
       [](const R& r) { return static_cast<double>(r.bytes) / static_cast<double>(r.points); }},
      {"cpu_us_per_point",
       {"CPU us/point", "{:.3f}"},
       [](const R& r) { return scaled(r.cpu, 1e6 / static_cast<double>(r.points)); }},
      {"wall_us_per_point",
       {"wall us/point", "{:.3f}"},
       [](const R& r) { return scaled(r.wall, 1e6 / static_cast<double>(r.points)); }},
      {"points_per_cpu_second",
       {"million points/CPU s", "{:.2f}", 1e6},
       [](const R& r) { return r.rate(); }},
      {"difference", {"difference", "{:.2g}"}, &R::difference}};
  return columns;
}

}  // namespace

Report report_of(const std::vector<FormatRow>& rows, unsigned runs) {
  return {.name = "formats",
          .title = "Reading and writing of point files",
          .reading = kFormatsReading,
          .runs = runs,
          .tables = {tabulate<FormatRow>({.name = "rows"}, formats_columns(), rows)}};
}

Experiment make_formats_experiment() {
  const auto options = std::make_shared<FormatsOptions>();
  const auto declare = [=](Declaration& d) {
    d.files(options->files, "Files of points that are read, too");
    d.city_points(options->points, "2M", 20'000);
    d.repeats(options->repeats, 1);
    d.file("--python", options->python,
           "A Python interpreter with the packages laspy, lazrs and open3d, which are then "
           "measured, too");
  };
  return {.name = "formats",
          .purpose = "Time of reading and writing point files, next to laspy and Open3D",
          .quick = "20k points, 1 run",
          .declare = declare,
          .run = [=](const Bench& b) { return measure_rows(measure_formats, *options, b); }};
}

}  // namespace ptc::bench
