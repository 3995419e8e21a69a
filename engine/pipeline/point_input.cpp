#include "engine/pipeline/point_input.h"

#include <algorithm>
#include <utility>

#include "engine/base/error.h"
#include "engine/pipeline/convert/container_source.h"
#include "engine/pipeline/convert/convert.h"
#include "engine/pipeline/convert/level_source.h"
#include "engine/pipeline/scene_record.h"
#include "engine/pipeline/shade/shading_channels.h"
#include "engine/store/box_pages.h"

namespace ptc {
namespace {

/// The points of a container, together with it.
class OwnedPoints : public PointSource {
 public:
  OwnedPoints(std::unique_ptr<const ContainerReader> container, const Selection& selection)
      : container_(std::move(container)), points_(open_selected(*container_, selection)) {}

  std::size_t next(std::span<Surfel> out) override { return points_->next(out); }
  [[nodiscard]] bool skip(std::uint64_t surfels) override { return points_->skip(surfels); }
  [[nodiscard]] std::span<const std::byte> attributes() const noexcept override {
    return points_->attributes();
  }

 private:
  std::unique_ptr<const ContainerReader> container_;
  std::unique_ptr<PointSource> points_;
};

/// Returns the pages that hold what a selection needs.
SourcePages pages_of(const ContainerReader& container, const Selection& selection) {
  SourcePages pages;
  if (selection.box) pages.ranks = pages_in_box(container, *selection.box);
  if (!selection.channels) return pages;
  pages.groups.emplace();
  for (const Channel& channel : container.meta().channels) {
    const bool kept =
        std::ranges::find(*selection.channels, channel.name) != selection.channels->end();
    const bool needed = kept || (!selection.classes.empty() && channel.name == kClassChannel);
    if (needed && std::ranges::find(*pages.groups, channel.group) == pages.groups->end())
      pages.groups->push_back(channel.group);
  }
  return pages;
}

PointFile open_container(const std::filesystem::path& path, const Selection& selection) {
  auto container = std::make_unique<const ContainerReader>(path);
  PointFile file;
  PointFileInfo& info = file.info;
  if (selection.takes_all()) info.count = container->superblock().points;
  info.has_normals = info.has_radius = true;
  info.has_radiance = !sky_is_gathered(*container);
  info.has_emission = may_emit(*container) && !selection.level;
  info.has_albedo = !selection.level && has_colours(container->meta().text);
  info.text = container->meta().text;
  for (const char* made :
       {kInputsKey, kSpacingKey, kRoundingKey, kAlbedoKey, "shading", "salvaged"})
    info.text.erase(made);
  if (!selection.level)
    info.channels = kept_channels(channels_without_index(*container), selection, path);
  Selection own = selection;
  if (!own.channels && !own.level && info.channels.size() < container->meta().channels.size()) {
    own.channels.emplace();
    for (const Channel& channel : info.channels) own.channels->push_back(channel.name);
  }
  file.source = std::make_unique<OwnedPoints>(std::move(container), own);
  return file;
}

}  // namespace

bool holds_points(const std::filesystem::path& path) {
  return is_container(path) || is_point_file(path);
}

std::unique_ptr<PointSource> open_selected(const ContainerReader& container,
                                           const Selection& selection) {
  if (selection.level) {
    if (!selection.classes.empty())
      throw RequestError("classes", container.path().string() +
                                        ": the clusters of a level have no "
                                        "class");
    if (selection.channels)
      throw RequestError("channels", container.path().string() +
                                         ": the clusters of a level have "
                                         "no channels");
    return select_points(open_level(container, *selection.level, selection.box), {},
                         {.box = selection.box, .every = selection.every}, container.path());
  }
  auto points = std::make_unique<ContainerSource>(container, pages_of(container, selection));
  if (selection.takes_all() && !selection.channels) return points;
  const std::vector<Channel> channels = points->channels();
  return select_points(std::move(points), channels, selection, container.path());
}

PointFile open_point_input(const std::filesystem::path& path, const Selection& selection) {
  if (is_container(path)) return open_container(path, selection);
  if (selection.level) {
    throw RequestError("level",
                       path.string() + ": only a container has levels: build one from the cloud");
  }
  PointFile file = open_points(path);
  file.info.channels = join_shading(std::move(file.info.channels));
  if (selection.takes_all() && !selection.channels) return file;
  PointFileInfo& info = file.info;
  file.source = select_points(std::move(file.source), info.channels, selection, path);
  if (!selection.takes_all()) info.count.reset();
  std::vector<Channel> kept = kept_channels(info.channels, selection, path);
  // Without the channel that says which one is a point's, the scanners mean nothing
  const auto has_scan = [](const std::vector<Channel>& channels) {
    return std::ranges::find(channels, "scan", &Channel::name) != channels.end();
  };
  if (has_scan(info.channels) && !has_scan(kept)) info.scanners.clear();
  info.channels = std::move(kept);
  return file;
}

}  // namespace ptc
