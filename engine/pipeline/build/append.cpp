#include "engine/pipeline/build/append.h"

#include <algorithm>
#include <string>

#include "engine/base/error.h"
#include "engine/pipeline/build/attributes.h"
#include "engine/pipeline/scene_record.h"
#include "engine/store/commit.h"

namespace ptc {
namespace {

/// Returns the codec of the scene's point pages. Single pages that do not compress are stored raw,
/// so only a scene whose first 16 pages are all raw counts as raw.
Codec codec_of(const ContainerReader& scene) {
  constexpr std::size_t kPages = 16;
  const PageNumbers::Range pages = scene.point_pages();
  for (const std::uint32_t page : pages.subrange(0, std::min(pages.size(), kPages))) {
    if (const Codec codec = scene.read_page_header(page).coding.codec; codec != Codec::raw)
      return codec;
  }
  return Codec::raw;
}

}  // namespace

void check_extensible(const ContainerReader& scene) {
  at_offset(scene.file(), 0, [&] { check_copyable(scene.header()); });
  const std::vector<Channel>& channels = scene.meta().channels;
  if (channels.empty() || channels.front().group >= kFirstInputGroup) return;
  throw DataError(scene.path().string() + ": the appended points would have no " +
                  channels.front().name +
                  ": append to the scene as it was before it was shaded, and shade the result");
}

void adopt_profile(BuildRequest& request, const ContainerReader& scene) {
  const Codec codec = codec_of(scene);
  if (scene.meta().text.contains(kRoundingKey)) {
    request.profile = codec == Codec::lz4 ? Profile::fast : Profile::compact;
  } else if (scene.superblock().points > 0) {
    request.profile = codec == Codec::raw ? Profile::raw : Profile::exact;
  }
}

void adopt_page_size(BuildRequest& request, const ContainerReader& scene) {
  request.page_shift = scene.header().page_shift;
}

void adopt_leaves(BuildRequest& request, const ContainerReader& scene) {
  request.tree.leaf_points = std::max(1U, scene.superblock().leaf_points);
}

Meta extended_meta(const Meta& scene, const Meta& added) {
  Meta meta = scene;
  meta.channels = added.channels;
  for (const auto& [key, value] : added.text) {
    const auto [at, is_new] = meta.text.try_emplace(key, value);
    if (!is_new && key == kInputsKey) at->second += " " + value;
  }
  meta.text.erase(kViewpointKey);
  // Colours of either are colours of the whole
  if (has_colours(scene.text) || has_colours(added.text)) meta.text.erase(kAlbedoKey);
  // The record has room for one spacing: drop it when old and new points differ in theirs
  const auto was = scene.text.find(kSpacingKey), is = added.text.find(kSpacingKey);
  const bool same = was != scene.text.end() && is != added.text.end() && was->second == is->second;
  if (!same) meta.text.erase(kSpacingKey);
  return meta;
}

}  // namespace ptc
