// Rows of pictures as the renderer makes them: what flickers as a camera or an object moves.
//
//   frames of a moving camera                 a slice of the field: one row of pixels of
//   +-----+ +-----+ +-----+                   each frame below that of the frame before
//   |     | |     | |     |                   ..........
//   |-----| |-----| |-----|  --------------->  ..........   surfaces draw slanted lines,
//   +-----+ +-----+ +-----+                     ..........  and what pops breaks them
//
// The truth is exact for every sample, so a step of the picture beyond the true one is ours alone.
#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "engine/pipeline/render/render_picture.h"
#include "tools/bench/chart/flip.h"
#include "tools/bench/stability/panel_pictures.h"
#include "tools/bench/stability/row.h"

namespace ptc::bench {
namespace {

constexpr double kPictureSpacing = 0.04;
constexpr double kClear = 0.5;  // spacings from a wall, from which on a pixel is clear of it

/// A floor with a wall, a block, a pole, a thin post and a table.
/// @param scale  of all radiance
std::vector<Panel> furniture(float scale) {
  std::vector<Panel> panels;
  const auto light = [&](float r, float g, float b) { return scale * glm::vec3(r, g, b); };
  panels.push_back(panel({-2, -2, 0}, {4, 0, 0}, {0, 4, 0}, light(0.5F, 0.5F, 0.5F)));
  panels.push_back(panel({-2, 1.5, 0}, {4, 0, 0}, {0, 0, 2}, light(0.8F, 0.1F, 0.1F)));
  add_block(panels, {-1.2, 0.2, 0}, {-0.7, 0.7, 0.5}, light(0.2F, 0.6F, 0.3F));
  add_block(panels, {0.1, -0.4, 0}, {0.35, -0.15, 0.9}, light(0.3F, 0.3F, 0.8F));
  add_block(panels, {-0.5, -0.6, 0}, {-0.42, -0.52, 0.7}, light(0.9F, 0.9F, 0.3F));
  add_block(panels, {0.7, 0.3, 0.3}, {1.5, 0.9, 0.36}, light(0.7F, 0.7F, 0.7F));
  panels.push_back(panel({0.7, 0.3, 0.3}, {0, 0.6, 0}, {0.8, 0, 0}, light(0.7F, 0.7F, 0.7F)));
  return panels;
}

/// Returns furniture() that is dark but for a lamp of 0.15 x 0.15 above it.
std::vector<Panel> furniture_with_lamp() {
  constexpr glm::vec3 kLamp(40, 36, 28);
  std::vector<Panel> panels = furniture(0.1F);
  add_block(panels, {0.4, -0.9, 1.2}, {0.55, -0.75, 1.25}, kLamp);
  panels.push_back(panel({0.4, -0.9, 1.2}, {0, 0.15, 0}, {0.15, 0, 0}, kLamp));
  return panels;
}

/// Returns a camera of small pictures in a scene whose z points up.
Camera small_camera(const glm::dvec3& position, const glm::dvec3& look_at) {
  return {.position = position, .look_at = look_at, .up = {0, 0, 1}, .width = 16, .height = 11};
}

/// A camera at the height of the table, which looks along the floor as it passes.
Camera grazing_camera(unsigned frame) {
  return small_camera({-1.0013 + 0.00993 * frame, -1.9, 0.25}, {-0.3 + 0.0061 * frame, 0.5, 0.15});
}

/// A camera just above the floor, close to where the post and the pole touch it.
Camera close_camera(unsigned frame) {
  const double way = 0.00793 * frame;
  return small_camera({-0.9013 + way, -1.3, 0.3}, {-0.4631 + way, -0.5, 0.02});
}

/// Pictures that follow one another, ours beside the true ones.
struct Frames {
  unsigned width = 0, height = 0;
  std::vector<std::vector<glm::vec3>> ours;
  std::vector<TruePicture> truth;

  void add(std::vector<glm::vec3> picture, TruePicture true_picture) {
    ours.push_back(std::move(picture));
    truth.push_back(std::move(true_picture));
  }
};

/// What flickers in some frames.
struct Flicker {
  double largest = 0;        ///< step of a pixel beyond 1.5 of the true one
  double largest_clear = 0;  ///< the same where no wall is within kClear
  double share = 0;  ///< share of the pixels of all frames whose step is beyond kAllowedStep
  unsigned row = 0;  ///< of the pixel of the largest one
};

Flicker flicker_of(const Frames& frames) {
  Flicker found;
  std::size_t beyond = 0;
  const std::size_t pixels = frames.ours.front().size();
  for (std::size_t f = 1; f < frames.ours.size(); ++f) {
    const TruePicture &before = frames.truth[f - 1], &now = frames.truth[f];
    for (std::size_t i = 0; i < pixels; ++i) {
      const glm::vec3 step = glm::abs(frames.ours[f][i] - frames.ours[f - 1][i]),
                      true_step = glm::abs(now.light[i] - before.light[i]),
                      excess = step - 1.5F * true_step;
      const double most = std::max({excess.r, excess.g, excess.b});
      beyond += most > kAllowedStep ? 1 : 0;
      if (most > found.largest) {
        found.largest = most;
        found.row = static_cast<unsigned>(i / frames.width);
      }
      if (std::min(before.clearance[i], now.clearance[i]) >= kClear)
        found.largest_clear = std::max(found.largest_clear, most);
    }
  }
  found.share =
      static_cast<double>(beyond) / static_cast<double>(pixels * (frames.ours.size() - 1));
  return found;
}

/// Returns the mean visible difference between our change and the true one from frame to frame,
/// both shown at half their size around grey.
double temporal_flip(const Frames& frames) {
  double sum = 0;
  for (std::size_t f = 1; f < frames.ours.size(); ++f) {
    Image ours{frames.width, frames.height, {}}, truth = ours;
    for (std::size_t i = 0; i < frames.ours[f].size(); ++i) {
      ours.pixels.push_back(0.5F + 0.5F * (frames.ours[f][i] - frames.ours[f - 1][i]));
      truth.pixels.push_back(0.5F +
                             0.5F * (frames.truth[f].light[i] - frames.truth[f - 1].light[i]));
    }
    sum += mean_flip(ours, truth);
  }
  return sum / static_cast<double>(frames.ours.size() - 1);
}

/// The most that figures of moving pictures may be.
struct MotionBounds {
  double largest, largest_clear, share, flip, rms;
};

/// Sums frames up. The field is a slice through them, along the row of the largest step.
Outcome finished_pictures(const Frames& frames, const MotionBounds& bounds) {
  const Flicker flicker = flicker_of(frames);
  Field slice{.width = frames.width, .height = static_cast<unsigned>(frames.ours.size())};
  double square = 0;
  for (std::size_t f = 0; f < frames.ours.size(); ++f) {
    square += std::pow(rms_difference(frames.ours[f], frames.truth[f].light), 2);
    for (std::size_t x = 0; x < frames.width; ++x) {
      slice.ours.push_back(frames.ours[f][flicker.row * frames.width + x]);
      slice.truth.push_back(frames.truth[f].light[flicker.row * frames.width + x]);
    }
  }
  const double rms = std::sqrt(square / static_cast<double>(frames.ours.size()));
  return {
      .figures =
          {{"largest step of a pixel beyond 1.5 of the true one", flicker.largest, bounds.largest},
           {"the same half a spacing and more from walls", flicker.largest_clear,
            bounds.largest_clear},
           {"pixels whose step is beyond that by 0.5 % of white", flicker.share, bounds.share},
           {"temporal FLIP: of steps beside true ones, mean", temporal_flip(frames), bounds.flip},
           {"light, RMS error", rms, bounds.rms}},
      .field = std::move(slice)};
}

/// Pictures by a camera that moves through a scene.
Frames fly(const PanelPictures& pictures, Camera (*camera)(unsigned),
           unsigned count = kMovingFrames) {
  Frames frames{.width = camera(0).width, .height = camera(0).height};
  for (unsigned f = 0; f < count; ++f)
    frames.add(pictures.render(camera(f)), pictures.truth(camera(f)));
  return frames;
}

Outcome along_the_floor(const Lab& lab) {
  const PanelPictures pictures(lab, furniture(1), kPictureSpacing, glm::vec3(1));
  return finished_pictures(fly(pictures, grazing_camera), {0.025, 0.0125, 0.002, 0.004, 0.0035});
}

Outcome at_contacts(const Lab& lab) {
  const PanelPictures pictures(lab, furniture(1), kPictureSpacing, glm::vec3(1));
  return finished_pictures(fly(pictures, close_camera), {0.025, 0.0125, 0.002, 0.004, 0.0035});
}

Outcome with_lamp(const Lab& lab) {
  const PanelPictures pictures(lab, furniture_with_lamp(), kPictureSpacing, glm::vec3(0));
  return finished_pictures(fly(pictures, grazing_camera, kMovingFrames / 2),
                           {0.07, 0.07, 0.45, 0.015, 0.015});
}

/// Writes panels as an OBJ file.
void write_obj(const std::filesystem::path& path, std::span<const Panel> panels) {
  std::ofstream text(path);
  for (const Panel& panel : panels) {
    for (const glm::dvec3& c : panel.corners) text << fmt::format("v {} {} {}\n", c.x, c.y, c.z);
    text << "f -4 -3 -2 -1\n";
  }
}

/// A block that slides along a floor and past a pole, in front of a wall, as the scene file of a
/// sequence has it: what moves is sampled anew in each frame. No surface has light of its own.
class SlidingBlock {
 public:
  explicit SlidingBlock(const Lab& lab)
      : still_file_(lab.work, ".still.obj"),
        block_file_(lab.work, ".block.obj"),
        scene_file_(lab.work, ".scene.json") {
    still_ = {panel({-1.5, -1, 0}, {3, 0, 0}, {0, 1.8, 0}, glm::vec3(0)),
              panel({-1.5, 0.8, 0}, {3, 0, 0}, {0, 0, 1}, glm::vec3(0))};
    add_block(still_, {0.1, 0.3, 0}, {0.3, 0.5, 0.7}, glm::vec3(0));
    add_block(block_, {-0.2, -0.2, 0}, {0.2, 0.1, 0.3}, glm::vec3(0));
    // Closed blocks are solids, whose surfels have one side
    still_.push_back(panel({0.1, 0.3, 0}, {0, 0.2, 0}, {0.2, 0, 0}, glm::vec3(0)));
    block_.push_back(panel({-0.2, -0.2, 0}, {0, 0.3, 0}, {0.4, 0, 0}, glm::vec3(0)));
    write_obj(still_file_.path(), still_);
    write_obj(block_file_.path(), block_);
    const auto name = [](const WorkFile& file) { return file.path().filename().string(); };
    std::ofstream(scene_file_.path())
        << fmt::format(R"({{"ptcx_scene": 1, "objects": [{{"file": "{}"}}, {{"file": "{}", )",
                       name(still_file_), name(block_file_))
        << fmt::format(R"("keys": [{{"frame": 1, "translate": [{}, 0, 0]}}, )", kFrom)
        << fmt::format(R"({{"frame": {}, "translate": [{}, 0, 0]}}]}}]}})", kMovingFrames, kTo);
  }

  /// Returns all panels at a frame, counted from 0.
  [[nodiscard]] std::vector<Panel> at(unsigned frame) const {
    std::vector<Panel> panels = still_;
    const double way = kFrom + (kTo - kFrom) * frame / (kMovingFrames - 1);
    for (Panel moved : block_) {
      for (glm::dvec3& corner : moved.corners) corner.x += way;
      panels.push_back(std::move(moved));
    }
    return panels;
  }

  [[nodiscard]] const std::filesystem::path& file() const noexcept { return scene_file_.path(); }

 private:
  static constexpr double kFrom = -0.7013, kTo = 0.6971;
  WorkFile still_file_, block_file_, scene_file_;
  std::vector<Panel> still_, block_;
};

/// An object that moves, in pictures of a sequence under a white sky.
Outcome sliding_block(const Lab& lab) {
  constexpr double kCoarse = 0.06;
  const SlidingBlock scene(lab);
  const WorkFile names(lab.work, ".####.exr");
  RenderRequest request;
  request.scene = scene.file();
  request.sampling.spacing = kCoarse;
  request.camera = small_camera({0.2, -1.3, 0.8}, {0, 0.3, 0.1});
  request.camera->vertical_fov = 0.6F;
  request.lights = LightRig{.sky = {.radiance = glm::vec3(1)}};
  request.bounces = 0;
  request.sequence = SequenceRequest{.frames = {1, kMovingFrames}};
  request.run.threads = lab.executor.threads();
  const std::array targets{PictureTarget{.path = names.path()}};
  Progress silent;
  render_picture(request, targets, silent);
  Frames frames{.width = request.camera->width, .height = request.camera->height};
  for (unsigned f = 0; f < kMovingFrames; ++f) {
    const std::filesystem::path file = *frame_name(names.path(), f + 1);
    std::vector<glm::vec3> ours = read_image(file).pixels;
    std::filesystem::remove(file);
    const std::vector<Panel> panels = scene.at(f);
    const Mesh mesh = mesh_of(panels);
    TruePicture truth =
        true_picture(lab, RayScene(mesh), panels, *request.camera, glm::vec3(1), kCoarse);
    for (glm::vec3& light : ours) light *= 2;  // surfaces reflect half of it
    frames.add(std::move(ours), std::move(truth));
  }
  return finished_pictures(frames, {0.04, 0.01, 0.002, 0.003, 0.004});
}

constexpr std::array kPictureRows = std::to_array<Row>({
    {"15", "camera along a floor with furniture, under a sky", "pixels that flicker",
     along_the_floor},
    {"15", "camera close to where they touch the floor", "pixels that flicker", at_contacts},
    {"15", "camera along the floor, lit by a lamp that is gathered", "light that jumps", with_lamp},
    {"24", "block that slides, in pictures of a sequence", "pixels that flicker", sliding_block},
});

}  // namespace

std::span<const Row> rows_of_pictures() {
  return kPictureRows;
}

}  // namespace ptc::bench
