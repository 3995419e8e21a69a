#include "engine/pipeline/convert/point_files.h"

#include <algorithm>
#include <utility>

#include <fmt/format.h>

#include "engine/base/error.h"
#include "engine/io/cloud/las_vlrs.h"
#include "engine/io/cloud/point_survey.h"
#include "engine/io/cloud/points.h"
#include "engine/io/cloud/rounding.h"
#include "engine/io/cloud/rounding_survey.h"
#include "engine/io/cloud/written_check.h"
#include "engine/io/file/url.h"
#include "engine/parallel/thread_pool.h"
#include "engine/pipeline/budgets.h"
#include "engine/pipeline/build/attributes.h"
#include "engine/pipeline/convert/container_source.h"
#include "engine/pipeline/point_input.h"
#include "engine/pipeline/scene_record.h"
#include "engine/store/attribute_rows.h"

namespace ptc {
namespace {

constexpr std::size_t kCopyBlock = 1 << 13;  // points that are copied at once

OutputFormat format_of(const std::filesystem::path& target) {
  const std::optional<OutputFormat> format = output_format(target);
  if (format) return *format;
  throw RequestError("target", target.string() +
                                   ": the ending of the name stands for no format of points that "
                                   "can be written");
}

/// Copies all points of a source to a file.
void copy_points(PointSource& source, const std::filesystem::path& target, OutputFormat format,
                 const PointWriteInfo& info, WrittenCheck& check, Progress& progress) {
  note_changed_values(target, info, progress);
  const std::unique_ptr<PointWriter> writer = create_points(target, format, info);
  std::vector<Surfel> block(kCopyBlock);
  while (const std::size_t count = source.next(block)) {
    writer->write(std::span(block).first(count), source.attributes());
    check.add(std::span(block).first(count), source.attributes());
    progress.advance(count);
  }
  writer->finish();
}

/// Which parts of a surfel some point has.
struct SeenParts {
  bool normals = false;
  bool radii = false;
};

/// Counts the points of a source, finds their bounds and measures their channels and what is
/// rounded of them.
SeenParts measure(PointSource& source, std::optional<PointSurvey>& survey,
                  std::optional<RoundingSurvey>& rounding, PointWriteInfo& info,
                  Progress* progress = nullptr) {
  SeenParts seen;
  info.count = 0;
  info.bounds = {};
  std::vector<Surfel> block(kCopyBlock);
  while (const std::size_t count = source.next(block)) {
    for (std::size_t i = 0; i < count; ++i) {
      info.bounds.add(block[i].position);
      seen.normals = seen.normals || block[i].normal != glm::vec3(0);
      seen.radii = seen.radii || block[i].radius > 0;
    }
    info.count += count;
    if (survey) survey->add(source.attributes());
    if (rounding) rounding->add(std::span(block).first(count), source.attributes());
    if (progress) progress->advance(count);
  }
  if (survey) survey->finish(info);
  if (rounding) info.rounding = rounding->rounding();
  return seen;
}

/// Returns what measures the channels of rows; nothing when none is measured.
std::optional<PointSurvey> survey_for(std::optional<OutputFormat> format,
                                      std::span<const Channel> channels) {
  if (!format) return std::nullopt;
  PointSurvey survey(*format, channels);
  return survey.empty() ? std::nullopt : std::optional(std::move(survey));
}

/// Measures channels of all points of a container by their attribute pages alone. A damaged page is
/// passed over: it is an error when its points are written, unless damage is tolerated.
void measure_all(const ContainerReader& container, std::span<const Channel> channels,
                 OutputFormat format, PointWriteInfo& info) {
  AttributeRows rows(container, channel_groups(channels));
  PointSurvey survey(format, rows.channels(), kOriginalIndex);
  std::size_t rank = 0;
  for (const std::uint32_t page : container.point_pages()) {
    try {
      survey.add(rows.read(rank++, container.entry(page).record_count));
    } catch (const FormatError&) {
      continue;
    }
  }
  survey.finish(info);
}

/// Measures what a format rounds of the points of a container. Of a damaged one it is not known.
/// @param info  describes the points that are written
void measure_rounding(const ContainerReader& container, const PointFileOptions& options,
                      OutputFormat format, PointWriteInfo& info) {
  Selection selection = options.selection;
  if (!selection.level) {
    selection.channels.emplace();
    for (const Channel& channel : info.channels) selection.channels->push_back(channel.name);
  }
  RoundingSurvey survey(format, info);
  try {
    const std::unique_ptr<PointSource> source = open_selected(container, selection);
    std::vector<Surfel> block(kCopyBlock);
    while (const std::size_t count = source->next(block))
      survey.add(std::span(block).first(count), source->attributes());
  } catch (const FormatError&) {
    return;
  }
  info.rounding = survey.rounding();
  // A conversion chooses the type of positions by the bounds alone; this must not change its choice
  const double error = float_error(info.bounds);
  if (error > kMostMove * least_spacing(info)) info.rounding->float_error = error;
}

/// Returns the channels of a container that a format wants to know the values of.
/// @param channels  that are written
std::vector<std::string> channels_to_measure(const ContainerReader& container,
                                             const PointFileOptions& options,
                                             std::optional<OutputFormat> format,
                                             std::span<const Channel> channels) {
  if (!format) return {};
  // Points in the order of the curve lie in no grid
  const bool grid = *format == OutputFormat::pcd;
  if (grid && !(options.original_order && has_input_order(container))) return {};
  std::vector<std::string> names = measured_channels(*format, channels);
  if (grid && !names.empty()) names.emplace_back(kOriginalIndex);
  return names;
}

/// Opens the points of a container that the options take, in their order.
/// @param sort_bytes  memory of the sort, which only the order of the input needs
std::unique_ptr<PointSource> open_ordered(const ContainerReader& container,
                                          const PointFileOptions& options,
                                          const std::filesystem::path& target,
                                          std::uint64_t sort_bytes, const Executor& executor) {
  if (!options.original_order) return open_selected(container, options.selection);
  auto points = open_in_input_order(
      container, {.memory_bytes = sort_bytes, .temp_dirs = temp_dirs(options.run, target)},
      executor);
  if (options.selection.takes_all() && !options.selection.channels) return points;
  return select_points(std::move(points), channels_without_index(container), options.selection,
                       container.path());
}

/// Reads a file that was written and compares it with what went into it.
/// @throws DataError when it differs
void compare_written(const std::filesystem::path& target, const PointWriteInfo& info,
                     const WrittenCheck& check, ConvertReport& report, Progress& progress) {
  const Stage stage(report.seconds, progress, "check", info.count, "points");
  const std::vector<std::string> others = check.compare(target, progress);
  if (others.empty()) return;
  progress.note(fmt::format(
      "{}: {} {} not found under {} in the file, and so not compared with what was written.",
      target.filename().string(), fmt::join(others, ", "), others.size() == 1 ? "is" : "are",
      others.size() == 1 ? "its name" : "their names"));
}

}  // namespace

void note_changed_values(const std::filesystem::path& target, const PointWriteInfo& info,
                         Progress& progress) {
  const std::optional<OutputFormat> format = output_format(target);
  if (!format) return;
  for (const std::string& sentence : scaling_notes(*format, info))
    progress.note(target.filename().string() + ": " + sentence);
  for (const std::string& sentence : unknown_losses(*format, info))
    progress.note(target.filename().string() + ": " + sentence);
  if (*format != OutputFormat::las && info.text.contains("crs"))
    progress.note(target.filename().string() + ": " + kLostCrs);
}

PointWriteInfo describe_points(const ContainerReader& container, const PointFileOptions& options,
                               std::optional<OutputFormat> format) {
  const Superblock& superblock = container.superblock();
  const auto& [low, high] = std::pair(superblock.bounds_low, superblock.bounds_high);
  const Selection& selection = options.selection;
  PointWriteInfo info{
      .count = superblock.points,
      .text = container.meta().text,
      .has_normals = true,
      .has_radius = true,
      .has_radiance = superblock.flux != std::array<double, 3>{} && !sky_is_gathered(container),
      .has_albedo = !selection.level && has_colours(container.meta().text),
      .emits = may_emit(container) && !selection.level,
      .colour_from = options.colour_from};
  if (!options.las_records.empty()) info.text[kLasRecordsKey] = options.las_records;
  info.bounds = {{low[0], low[1], low[2]}, {high[0], high[1], high[2]}};
  if (!selection.level) {
    info.channels = kept_channels(
        options.original_order ? channels_without_index(container) : container.meta().channels,
        selection, container.path());
  }
  // Read what the writer must know of the values
  const std::vector<std::string> names =
      channels_to_measure(container, options, format, info.channels);
  Selection reading = selection;
  if (!selection.level) reading.channels = names;
  const std::vector<Channel> measured =
      names.empty() ? std::vector<Channel>()
                    : kept_channels(container.meta().channels, reading, container.path());
  if (!selection.takes_all()) {
    std::optional<PointSurvey> survey;
    if (!names.empty()) survey.emplace(*format, measured, kOriginalIndex);
    std::optional<RoundingSurvey> no_rounding;
    measure(*open_selected(container, reading), survey, no_rounding, info);
  } else if (!names.empty()) {
    measure_all(container, measured, *format, info);
  }
  if (options.measure_rounding && format) measure_rounding(container, options, *format, info);
  return info;
}

PointWriteInfo describe_points(const std::filesystem::path& cloud, const PointFileOptions& options,
                               std::optional<OutputFormat> format, Progress& progress) {
  PointFile file = open_point_input(cloud, options.selection);
  for (const std::string& note : file.info.notes) progress.note(file_name(cloud) + ": " + note);
  PointWriteInfo info{.channels = file.info.channels,
                      .text = file.info.text,
                      .has_normals = file.info.has_normals,
                      .has_radius = file.info.has_radius,
                      .has_radiance = file.info.has_radiance,
                      .has_albedo = file.info.has_albedo,
                      .emits = file.info.has_emission,
                      .colour_from = options.colour_from};
  std::optional<PointSurvey> survey = survey_for(format, info.channels);
  std::optional<RoundingSurvey> rounding;
  if (format && (options.measure_rounding || chooses_positions(*format)))
    rounding.emplace(*format, info);
  const SeenParts seen = measure(*file.source, survey, rounding, info, &progress);
  if (file.info.zeros_mean_none) {
    info.has_normals = seen.normals;
    info.has_radius = seen.radii;
  }
  return info;
}

ConvertReport container_to_points(const ContainerReader& container,
                                  const std::filesystem::path& target,
                                  const PointFileOptions& options, Progress& progress) {
  // Check the request and the memory
  const OutputFormat format = format_of(target);
  if (options.original_order && !has_input_order(container)) {
    throw RequestError("original_order",
                       container.path().string() +
                           ": `original_order` needs the place that each point had in its input: "
                           "build the container with it, too");
  }
  require_request(!(options.original_order && options.selection.level), "level",
                  "`level` takes clusters, which have no place in the input: leave out "
                  "`original_order`");
  MemoryBudget budget = budget_of(options.run.memory_bytes, "this conversion");
  charge_directory(budget, container);
  const std::uint64_t sort_bytes =
      budget.rest("the sort", options.original_order ? input_order_bytes(container) : 0);

  // Write the points
  const PointWriteInfo info = describe_points(container, options, format);
  ConvertReport report{.points = info.count};
  WrittenCheck check(format, info);
  {
    const Stage stage(report.seconds, progress, "convert", info.count, "points");
    const ThreadPool executor(options.run.threads);
    const std::unique_ptr<PointSource> source =
        open_ordered(container, options, target, sort_bytes, executor);
    copy_points(*source, target, format, info, check, progress);
  }
  compare_written(target, info, check, report, progress);
  return report;
}

ConvertReport cloud_to_points(const std::filesystem::path& cloud,
                              const std::filesystem::path& target, const PointFileOptions& options,
                              Progress& progress) {
  const OutputFormat format = format_of(target);
  ConvertReport report;
  PointWriteInfo info;
  {
    const Stage stage(report.seconds, progress, "measure", 0, "points");
    info = describe_points(cloud, options, format, progress);
  }
  report.points = info.count;
  WrittenCheck check(format, info);
  {
    const Stage stage(report.seconds, progress, "convert", info.count, "points");
    copy_points(*open_point_input(cloud, options.selection).source, target, format, info, check,
                progress);
  }
  compare_written(target, info, check, report, progress);
  return report;
}

}  // namespace ptc
