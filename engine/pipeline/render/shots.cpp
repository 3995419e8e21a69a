#include "engine/pipeline/render/shots.h"

#include <cmath>
#include <numbers>
#include <utility>

#include <fmt/format.h>
#include <glm/gtc/quaternion.hpp>

#include "engine/base/error.h"

namespace ptc {
namespace {

/// The mark of a frame's number in a name.
struct FrameMark {
  std::size_t begin = 0, length = 0;  ///< characters
  int digits = 1;                     ///< that a number has at least
};

/// Finds the last run of # in a name.
std::optional<FrameMark> find_hashes(const std::string& name) {
  const std::size_t end = name.find_last_of('#');
  if (end == std::string::npos) return {};
  const std::size_t before = name.find_last_not_of('#', end);
  const std::size_t begin = before == std::string::npos ? 0 : before + 1;
  return FrameMark{begin, end + 1 - begin, static_cast<int>(end + 1 - begin)};
}

/// Finds %d or %0Nd in a name, as printf() takes them.
std::optional<FrameMark> find_percent(const std::string& name) {
  const std::size_t begin = name.find_last_of('%');
  if (begin == std::string::npos) return {};
  if (name.compare(begin, 2, "%d") == 0) return FrameMark{begin, 2, 1};
  const bool padded = name.size() > begin + 3 && name[begin + 1] == '0' && name[begin + 3] == 'd';
  if (!padded || name[begin + 2] < '1' || name[begin + 2] > '9') return {};
  return FrameMark{begin, 4, name[begin + 2] - '0'};
}

}  // namespace

Moment moment_of(const SequenceRequest& sequence, std::size_t index) {
  const auto frame = static_cast<double>(sequence.frames[index]);
  return {.frame = frame, .seconds = frame / sequence.frames_per_second};
}

void check_sequence(const SequenceRequest& sequence) {
  constexpr std::int64_t kFarthest = 1'000'000'000;
  constexpr std::size_t kMostFrames = 100'000;
  const FrameRange& frames = sequence.frames;
  require_request(frames.first >= -kFarthest && frames.last <= kFarthest, "sequence.frames",
                  "`sequence.frames` holds a number beyond 1,000,000,000");
  require_request(frames.first <= frames.last, "sequence.frames",
                  "the last of `sequence.frames` comes before the first");
  require_request(frames.step > 0, "sequence.frames", "the step of `sequence.frames` is below 1");
  require_request(frames.count() <= kMostFrames, "sequence.frames",
                  "`sequence.frames` are more than 100,000");
  require_request(std::isfinite(sequence.frames_per_second) && sequence.frames_per_second > 0,
                  "sequence.frames_per_second",
                  "`sequence.frames_per_second` is not above 0 and finite");
}

Camera turned_around(Camera camera, const glm::dvec3& middle, const glm::dvec3& up, double angle) {
  const glm::dquat turn = glm::angleAxis(angle, up);
  camera.position = middle + turn * (camera.position - middle);
  camera.look_at = middle + turn * (camera.look_at - middle);
  camera.up = glm::vec3(turn * glm::dvec3(camera.up));
  return camera;
}

double turntable_angle(const SequenceRequest& sequence, std::int64_t frame) {
  if (sequence.turntable == 0) return 0;
  const auto turns = static_cast<std::int64_t>(sequence.turntable);
  return 2 * std::numbers::pi * static_cast<double>((frame - 1) % turns) /
         static_cast<double>(turns);
}

std::optional<std::filesystem::path> frame_name(const std::filesystem::path& path,
                                                std::int64_t frame) {
  std::string name = path.filename().string();
  auto mark = find_hashes(name);
  if (!mark) mark = find_percent(name);
  if (!mark) return {};
  // A minus sign counts as a digit, as printf() has it
  name.replace(mark->begin, mark->length, fmt::format("{:0{}}", frame, mark->digits));
  return path.parent_path() / name;
}

std::vector<PictureTarget> targets_of_frame(std::span<const PictureTarget> targets,
                                            std::int64_t frame) {
  std::vector<PictureTarget> named(targets.begin(), targets.end());
  for (PictureTarget& target : named) {
    auto path = frame_name(target.path, frame);
    if (!path) {
      throw RequestError("targets", target.path.string() +
                                        ": the name of a sequence needs a mark for the number of "
                                        "the frame, such as #### in " +
                                        target.path.stem().string() + ".####" +
                                        target.path.extension().string());
    }
    target.path = std::move(*path);
  }
  return named;
}

}  // namespace ptc
