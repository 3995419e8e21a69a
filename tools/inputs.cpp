#include "tools/inputs.h"

#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <system_error>

#include <fmt/format.h>
#include <glob.h>

#include "engine/base/error.h"
#include "engine/io/cloud/points.h"
#include "engine/io/file/url.h"
#include "engine/io/text/byte_stream.h"
#include "engine/io/text/text.h"
#include "engine/pipeline/build/scene_file.h"
#include "engine/pipeline/light/built_scene.h"
#include "engine/pipeline/point_input.h"
#include "format/text.h"
#include "tools/common.h"
#include "tools/option_text.h"
#include "tools/options.h"
#include "tools/scene_options.h"

namespace ptc {
namespace {

bool is_pattern(const std::string& name) {
  return !is_url(name) && name.find_first_of("*?[") != std::string::npos &&
         !std::filesystem::exists(name);
}

/// Says whether the name of a file ends as those of meshes and clouds do.
bool has_input_ending(const std::filesystem::path& path) {
  const std::vector<std::string> endings = input_endings();
  return std::ranges::any_of(endings, [&](const auto& e) { return has_ending(path, e); });
}

}  // namespace

InputFiles::InputFiles(const std::vector<std::filesystem::path>& arguments,
                       const std::string& format, const RunOptions& run,
                       const std::filesystem::path& output) {
  for (const std::filesystem::path& argument : arguments) {
    const std::string name = argument.string();
    if (name == "-") {
      add_standard_input(format, roomiest_temp_dir(run, output));
    } else if (name.starts_with('@')) {
      add_list(name.substr(1));
    } else if (is_pattern(name)) {
      add_matches(argument);
    } else if (std::filesystem::is_directory(argument)) {
      add_directory(argument);
    } else {
      add(argument);
    }
  }
}

void InputFiles::add(const std::filesystem::path& path) {
  check_input(path);
  paths_.push_back(path);
  if (!names_.empty()) names_ += ' ';
  names_ += printable(file_name(path));
}

void InputFiles::add_directory(const std::filesystem::path& directory) {
  std::vector<std::filesystem::path> found;
  for (const auto& entry : std::filesystem::directory_iterator(directory)) {
    if (entry.is_regular_file() && has_input_ending(entry.path())) found.push_back(entry.path());
  }
  if (found.empty())
    throw DataError(directory.string() + ": the directory holds no mesh and no cloud");
  // A text beside clouds tells about them
  const auto is_text = [](const std::filesystem::path& path) {
    return has_ending(path, ".txt") || has_ending(path, ".csv");
  };
  if (!std::ranges::all_of(found, is_text)) std::erase_if(found, is_text);
  std::ranges::sort(found);
  for (const auto& path : found) add(path);
}

void InputFiles::add_matches(const std::filesystem::path& pattern) {
  glob_t matches{};
  const int failure = ::glob(pattern.c_str(), 0, nullptr, &matches);
  const std::vector<std::filesystem::path> found(matches.gl_pathv,
                                                 matches.gl_pathv + matches.gl_pathc);
  ::globfree(&matches);
  if (failure != 0 || found.empty()) throw DataError(pattern.string() + ": no file matches");
  for (const auto& path : found) add(path);
}

void InputFiles::add_list(const std::filesystem::path& list) {
  check_input(list);
  ByteStream stream(list);
  std::string_view line;
  while (stream.next_line(line)) {
    const std::string_view name = Words(line).rest();
    if (name.empty() || name.front() == '#') continue;
    // Names are relative to the list, so that it can be used from anywhere
    add(is_url(name) ? std::filesystem::path(name) : list.parent_path() / name);
  }
  if (paths_.empty()) throw DataError(list.string() + ": the list names no file");
}

void InputFiles::add_standard_input(const std::string& format,
                                    const std::filesystem::path& directory) {
  // Copy it, because the input of a build is read twice
  const std::filesystem::path path =
      directory / fmt::format(".stdin-{}{}{}", getpid(), format.empty() ? "" : ".", format);
  temporary_.push_back(std::make_unique<TemporaryName>(path));
  OutputFile file(path);
  std::vector<std::byte> buffer(std::size_t{1} << 20);
  for (;;) {
    const ssize_t count = ::read(STDIN_FILENO, buffer.data(), buffer.size());
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) throw std::system_error(errno, std::generic_category(), "read standard input");
    if (count == 0) break;
    file.append(std::span<const std::byte>(buffer).first(static_cast<std::size_t>(count)));
  }
  if (file.size() == 0) {
    throw DataError(temporary_.size() > 1 ? "standard input is named twice, but can be read once"
                                          : "standard input is empty");
  }
  file.publish();
  copy_ = path;
  paths_.push_back(path);
  if (!names_.empty()) names_ += ' ';
  names_ += "stdin";
}

void InputFiles::name_in(Command& command) const {
  if (!copy_.empty()) command.show_as(copy_, "standard input");
}

bool is_build_input(const std::filesystem::path& path) {
  if (has_input_ending(path)) return true;
  try {
    return is_point_file(path);
  } catch (const DataError&) {  // it begins as a PLY or a gzip file does, but breaks its rules
    return false;
  }
}

std::string build_command(const std::filesystem::path& input) {
  std::filesystem::path name = file_name(input);
  if (has_ending(name, ".gz")) name = name.stem();
  return fmt::format("ptcbuild {} -o {}", input.string(), name.replace_extension(".ptcx").string());
}

void add_format(CLI::App& app, std::string& format) {
  app.add_option("--format", format,
                 "Format of standard input, as an ending: las, ply, xyz, ...\n"
                 "Only text needs it: other formats are told by their bytes.")
      ->type_name("FORMAT")
      ->group(kFilesGroup);
}

void SceneArguments::declare(Command& command, const std::string& description) {
  command_ = &command;
  CLI::App& app = command.app();
  std::vector<std::string> endings = input_endings();
  endings.insert(endings.begin(), ".ptcx");
  offer(app.add_option("SCENE", names_,
                       description +
                           "\n"
                           "One container is used as it is. Of clouds, meshes and several files a "
                           "container is built for the run, as ptcbuild builds it. Each argument "
                           "is a file, a directory for all meshes and clouds in it, a pattern, "
                           "@FILE for the files that its lines name, or - for standard input."),
        endings)
      ->type_name("FILE")
      ->required()
      ->group(kFilesGroup);
  add_format(app, format_);
  add_points(app, points_)->group(kFilesGroup);
  add_up(app, up_)->group(kFilesGroup);
}

void SceneArguments::apply(LightingRequest& request, const std::filesystem::path& output,
                           Progress& progress) {
  files_.emplace(names_, format_, request.run, output);
  files_->name_in(*command_);
  request.scene = files_->paths().front();
  request.joined.assign(files_->paths().begin() + 1, files_->paths().end());
  request.scene_names = files_->names();
  request.sampling.count = points_;
  request.up = up_;
  if (is_container_alone(request)) {
    note_unused(command_->app(), {"--up"}, "the scene is a container", progress);
  } else {
    note_unknown_up(files_->paths(), up_, progress);
  }
  if (std::ranges::all_of(object_files(files_->paths()), holds_points))
    note_unused(command_->app(), {"--points"}, "no file of the scene is a mesh", progress);
}

}  // namespace ptc
