// Reading and writing the files of a build that can be continued.
//
// The manifest is written twice: without a table when the build begins, so that the next build
// knows which spill files to remove, and with the table when all points have entered the sort.
//
//   begin()                keep()                   save() ...              remove()
//   request | spills | -   request | spills | plan  id | place | writer     all files,
//                          and sorter, hash = id    | state of the build    the manifest last
#include "engine/pipeline/build/resume.h"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <sstream>
#include <system_error>
#include <utility>

#include <fmt/format.h>

#include "engine/base/background.h"
#include "engine/base/error.h"
#include "engine/io/file/disk_space.h"
#include "engine/io/file/remote_file.h"
#include "engine/io/file/url.h"
#include "engine/pipeline/build/build_inputs.h"
#include "engine/pipeline/build/scene_file.h"
#include "format/checksum.h"

namespace ptc {
namespace {

const char* name_of(Profile profile) {
  switch (profile) {
    case Profile::raw:
      return "raw";
    case Profile::exact:
      return "exact";
    case Profile::fast:
      return "fast";
    case Profile::compact:
      return "compact";
  }
  return "unknown";
}

std::string text_of(const Selection& selection) {
  std::string text = fmt::format("every {}", selection.every);
  if (const auto& box = selection.box) {
    text += fmt::format(" box {} {} {} {} {} {}", box->low.x, box->low.y, box->low.z, box->high.x,
                        box->high.y, box->high.z);
  }
  for (const std::uint64_t number : selection.classes) text += fmt::format(" class {}", number);
  if (selection.level) text += fmt::format(" level {}", *selection.level);
  if (!selection.channels) return text;
  text += " channels";
  for (const std::string& name : *selection.channels) text += " " + name;
  return text;
}

/// Returns a line "NAME: VALUE" for everything that the bytes of the container follow from. Names
/// of fields stand in backquotes, as in a RequestError.
std::string text_of(const BuildRequest& request) {
  // Record the program and the files, by size and time of change
  std::string text;
  const auto line = [&](const char* name, const auto& value) {
    text += fmt::format("{}: {}\n", name, value);
  };
  line("the program", writer_name());
  const auto file = [&](const char* name, const std::filesystem::path& path) {
    if (is_url(path)) {
      const RemoteFile remote(path.string());
      line(name, fmt::format("{}, {} bytes, version {}", file_name(path), remote.size(),
                             remote.version()));
      return;
    }
    const auto changed = std::filesystem::last_write_time(path).time_since_epoch().count();
    const std::string whole = std::filesystem::absolute(path).string();
    line(name,
         fmt::format("{}, {} bytes, changed {}", whole, std::filesystem::file_size(path), changed));
  };
  for (const std::filesystem::path& input : request.inputs) file("an input", input);
  for (const std::filesystem::path& named :
       read_scene_objects(request.inputs, nullptr, request.run.memory_bytes).named)
    file("a file of the scene", named);
  if (!request.append.empty()) file("`append`", request.append);

  // Record the settings of the surfels
  const SamplingOptions& sampling = request.sampling;
  line("`city_points`", request.city_points);
  line("the selection", text_of(request.selection));
  line("the axis that points up", request.up);
  line("`original_order`", request.original_order);
  line("`remove_duplicates`", request.remove_duplicates);
  line("`backdrop`", request.backdrop);
  line("`one_sided`", request.one_sided);
  line("the lights", request.lights ? to_json(*request.lights) : "of the scene");
  line("`sampling.count`", sampling.count);
  line("`sampling.spacing`", sampling.spacing);
  line("the camera", sampling.camera ? to_json(*sampling.camera) : "none");
  line("`sampling.adapts`", sampling.adapts);
  line("`sampling.pixels_per_surfel`", sampling.pixels_per_surfel);
  line("`sampling.finest`", sampling.finest);
  const LightSampling& rays = sampling.lights;
  line("the rays to lights", fmt::format("{} {} {}", rays.sun_rays, rays.area_rays, rays.sky_rays));

  // Record the settings of the container
  line("`tree.leaf_points`", request.tree.leaf_points);
  line("`tree.levels_per_stream`", request.tree.levels_per_stream);
  line("`page_shift`", fmt::format("{} bytes", 1U << request.page_shift));
  line("`profile`", name_of(request.profile));
  return text;
}

/// Describes the first line in which two texts of text_of() differ, for an error.
std::string difference(const std::string& before, const std::string& now) {
  std::istringstream old_lines(before), new_lines(now);
  std::string old_line, new_line;
  while (std::getline(new_lines, new_line)) {
    if (!std::getline(old_lines, old_line)) old_line.clear();
    if (old_line != new_line) break;
  }
  const auto name_end = new_line.find(": ");
  const std::string name = new_line.substr(0, name_end);
  if (!old_line.starts_with(name + ": ")) {
    return fmt::format("'{}', where this one has '{}'", old_line, new_line);
  }
  return fmt::format("{} was '{}', not '{}'", name, old_line.substr(name_end + 2),
                     new_line.substr(name_end + 2));
}

std::filesystem::path with_ending(const std::filesystem::path& path, const char* ending) {
  return path.parent_path() / (path.filename().string() + ending);
}

void remove_file(const std::filesystem::path& path) noexcept {
  ::unlink(path.c_str());
}

/// Writes the absolute paths of files to a state.
void put_files(std::span<const std::filesystem::path> files, StateWriter& state) {
  state.put(std::uint64_t{files.size()});
  for (const std::filesystem::path& file : files)
    state.put_text(std::filesystem::absolute(file).string());
}

std::vector<std::filesystem::path> get_files(StateReader& state) {
  std::vector<std::filesystem::path> files;
  for (std::uint64_t count = state.get_count(1 << 20); count > 0; --count)
    files.emplace_back(state.get_text());
  return files;
}

void put_plan(const BuildPlan& plan, StateWriter& state) {
  state.put(plan.frame.origin);
  state.put(plan.frame.edge);
  state.put_bytes(plan.uuid);
  state.put(static_cast<std::uint8_t>(plan.emits));
  state.put_bytes(encode_meta(plan.meta, plan.point_bytes()));
  state.put(static_cast<std::uint8_t>(plan.scan.has_value()));
  if (!plan.scan) return;
  state.put(static_cast<std::uint8_t>(plan.scan->radii));
  state.put(static_cast<std::uint8_t>(plan.scan->aerial));
  state.put(to_array(plan.scan->up));
  state.put(std::uint64_t{plan.scan->scanners.size()});
  for (const glm::dvec3& scanner : plan.scan->scanners) state.put(to_array(scanner));
}

BuildPlan get_plan(StateReader& state) {
  BuildPlan plan;
  plan.frame.origin = state.get<std::array<double, 3>>();
  plan.frame.edge = state.get<double>();
  const std::span<const std::byte> uuid = state.get_bytes();
  state.require(uuid.size() == plan.uuid.size(), "the container's UUID has another length");
  std::ranges::copy(uuid, plan.uuid.begin());
  plan.emits = state.get<std::uint8_t>() != 0;
  plan.meta = decode_meta(state.get_bytes(), plan.point_bytes());
  if (state.get<std::uint8_t>() == 0) return plan;
  const auto place = [&] {
    const auto at = state.get<std::array<double, 3>>();
    return glm::dvec3(at[0], at[1], at[2]);
  };
  ScanOptions& scan = plan.scan.emplace();
  scan.radii = state.get<std::uint8_t>() != 0;
  scan.aerial = state.get<std::uint8_t>() != 0;
  scan.up = place();
  for (std::uint64_t count = state.get_count(1 << 20); count > 0; --count)
    scan.scanners.push_back(place());
  return plan;
}

}  // namespace

Resumption::Resumption(const BuildRequest& request, const std::filesystem::path& target)
    : manifest_(with_ending(target, ".resume")),
      pages_(with_ending(target, ".resume-pages")),
      at_(with_ending(target, ".resume-at")),
      request_(text_of(request)) {
  if (request.mesh) {
    throw RequestError("resume",
                       "`resume` needs inputs from files: a mesh in memory is lost when a build "
                       "is interrupted");
  }
  // Name the spill files after the whole path: two outputs may share a temporary directory
  const std::string whole = std::filesystem::absolute(target).lexically_normal().string();
  const std::uint64_t name = xxh3_64(std::as_bytes(std::span(whole)));
  for (const std::filesystem::path& directory : temp_dirs(request.run, target)) {
    spills_.push_back(directory / fmt::format("{}.resume-spill-{:016x}-{}",
                                              target.filename().string(), name, spills_.size()));
  }
  // Lock the unfinished container, and open the files of an interrupted build
  lock_ = std::make_unique<FileLock>(pages_);
  try {
    if (std::filesystem::exists(manifest_)) load_manifest();
    if (plan_ && std::filesystem::exists(at_)) load_checkpoint();
  } catch (const DataError& error) {
    if (std::filesystem::file_size(pages_) == 0) remove_file(pages_);  // the lock may have made it
    refuse(error);
  }
  if (!plan_) begin();
}

void Resumption::refuse(const DataError& error) const {
  std::vector<std::filesystem::path> files{manifest_, at_, pages_};
  files.insert(files.end(), spills_.begin(), spills_.end());
  files.insert(files.end(), attribute_spills_.begin(), attribute_spills_.end());
  throw DataError(fmt::format("{}; to start again, remove {}", error.what(), names_text(files)));
}

void Resumption::load_manifest() {
  // Compare the request that the files belong to
  const std::vector<std::byte> bytes = read_state(manifest_);
  StateReader state(bytes, manifest_.string());
  const std::string request = state.get_text();
  if (request != request_) {
    throw DataError(fmt::format("{}: it belongs to another build: {}", manifest_.string(),
                                difference(request, request_)));
  }

  // Remove the spill files of a sort that did not end
  std::vector<std::filesystem::path> spills = get_files(state);
  std::vector<std::filesystem::path> attribute_spills = get_files(state);
  const std::span<const std::byte> sorted = state.get_bytes();
  state.end();
  if (sorted.empty()) {  // the build was killed before the end of its sort
    std::ranges::for_each(spills, remove_file);
    std::ranges::for_each(attribute_spills, remove_file);
    sort_unfinished_ = true;
    return;
  }

  // Take over the plan and the state of the sorter
  spills_ = std::move(spills);
  attribute_spills_ = std::move(attribute_spills);
  StateReader rest(sorted, manifest_.string());
  plan_ = get_plan(rest);
  const std::span<const std::byte> sorter = rest.get_bytes();
  rest.end();
  sorter_.assign(sorter.begin(), sorter.end());
  id_ = xxh3_64(sorted);
}

void Resumption::load_checkpoint() {
  const std::vector<std::byte> bytes = read_state(at_);
  StateReader state(bytes, at_.string());
  if (state.get<std::uint64_t>() != id_) return;  // left by an earlier build: this one has none yet
  Checkpoint& checkpoint = checkpoint_.emplace();
  checkpoint.place.points = state.get<std::uint64_t>();
  checkpoint.place.last_key = {state.get<std::uint64_t>(), state.get<std::uint64_t>()};
  checkpoint.writer = {state.get<std::uint32_t>(), state.get<std::uint32_t>(),
                       state.get<std::uint64_t>()};
  const std::span<const std::byte> build = state.get_bytes();
  checkpoint.build.assign(build.begin(), build.end());
  state.end();
}

void Resumption::begin() {
  remove_file(at_);
  for (const auto& path : {manifest_, pages_, at_, state_temporary(manifest_)}) {
    unsorted_.push_back(std::make_unique<TemporaryName>(path));
  }
  for (const auto& path : spills_) unsorted_.push_back(std::make_unique<TemporaryName>(path));
  write_manifest({});
}

void Resumption::write_manifest(const std::vector<std::byte>& sorted) const {
  StateWriter state;
  state.put_text(request_);
  put_files(spills_, state);
  put_files(attribute_spills_, state);
  state.put_bytes(sorted);
  write_state(manifest_, state.take());
}

void Resumption::add_spills(std::size_t groups) {
  if (groups == 0) return;
  for (std::size_t group = 0; group < groups; ++group) {
    for (const std::filesystem::path& spill : spills_) {
      attribute_spills_.push_back(with_ending(spill, fmt::format("-{}", group).c_str()));
      unsorted_.push_back(std::make_unique<TemporaryName>(attribute_spills_.back()));
    }
  }
  write_manifest({});
}

void Resumption::keep(const BuildPlan& plan, ExternalSorter& sorter, AttributeSorts& attributes) {
  StateWriter sorted, state;
  put_plan(plan, sorted);
  sorter.keep(state);
  attributes.keep(state);
  sorted.put_bytes(state.take());
  const std::vector<std::byte> bytes = sorted.take();
  write_manifest(bytes);
  id_ = xxh3_64(bytes);
  for (const auto& name : unsorted_) name->release();
}

std::vector<std::byte> Resumption::encode(const Checkpoint& checkpoint) const {
  StateWriter state;
  state.put(id_);
  state.put(checkpoint.place.points);
  state.put(checkpoint.place.last_key.high);
  state.put(checkpoint.place.last_key.low);
  state.put(checkpoint.writer.point_pages);
  state.put(checkpoint.writer.node_pages);
  state.put(checkpoint.writer.end);
  state.put_bytes(checkpoint.build);
  return state.take();
}

void Resumption::save(std::span<const std::byte> checkpoint) const {
  write_state(at_, checkpoint);
}

// The manifest goes last: if the removal is interrupted, it still names the files that are left.
void Resumption::remove() noexcept {
  std::ranges::for_each(spills_, remove_file);
  std::ranges::for_each(attribute_spills_, remove_file);
  remove_file(state_temporary(at_));
  remove_file(state_temporary(manifest_));
  remove_file(at_);
  remove_file(pages_);
  remove_file(manifest_);
}

CheckpointSaver::CheckpointSaver(const Resumption& resumption, ContainerWriter& writer,
                                 ExternalSorter& sorter,
                                 std::uint64_t (*first_needed)(std::uint64_t))
    : resumption_(resumption), writer_(writer), sorter_(sorter), first_needed_(first_needed) {}

CheckpointSaver::~CheckpointSaver() {
  if (saving_.valid()) saving_.wait();
}

void CheckpointSaver::save(const BuildPlace& place, std::vector<std::byte> build) {
  if (saving_.valid()) saving_.get();
  // What is encoded takes the place of the state before the next one is made.
  std::vector<std::byte> checkpoint =
      resumption_.encode({place, writer_.state(), std::move(build)});
  saving_ = in_background([this, points = place.points, checkpoint = std::move(checkpoint)] {
    writer_.sync();
    resumption_.save(checkpoint);
    sorter_.discard_before(first_needed_(points));
  });
}

}  // namespace ptc
