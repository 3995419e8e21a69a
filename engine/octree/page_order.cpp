// Emits pages and saves the open ones. A state holds open pages as payloads; loading them applies
// the checks that a reader applies to pages of a file, so that a damaged state cannot build a tree.
#include "engine/octree/page_order.h"

#include <algorithm>
#include <utility>

#include "format/point_page.h"

namespace ptc {
namespace {

/// Copies bytes into a vector, whose memory is aligned so that payloads can be read as numbers.
std::vector<std::byte> aligned(std::span<const std::byte> bytes) {
  return {bytes.begin(), bytes.end()};
}

}  // namespace

ContainerWriter::Page point_page(std::span<const PointRecord> points) {
  return {.summary = {.type = PageType::point,
                      .record_count = static_cast<std::uint32_t>(points.size()),
                      .first_key = points.front().key.high,
                      .last_key = points.back().key.high},
          .payload = encode_point_page(points)};
}

PageOrder::PageOrder(ContainerWriter& writer, std::uint32_t points_per_page, int levels_per_stream)
    : writer_(writer),
      points_per_page_(points_per_page),
      levels_per_stream_(levels_per_stream),
      payload_limit_((std::size_t{1} << writer.header().page_shift) - kPageHeaderBytes),
      streams_(static_cast<std::size_t>(kMaxLevel / levels_per_stream + 1)) {}

void PageOrder::Range::include(const GroupView& group) {
  first = std::min(first, group.cell().high);
  last = std::max(last, group.cell().high);
  min_level = std::min(min_level, static_cast<std::uint16_t>(group.level()));
}

ChildRef PageOrder::add(const GroupView& group, std::uint64_t end) {
  // Emit the point pages that begin at or before the group's end.
  while (!points_.empty() && next_point_ <= end) take_points();
  // Put the group on the page of its stream, or on a new one if it does not fit.
  std::optional<Stream>& stream =
      streams_[static_cast<std::size_t>(group.level() / levels_per_stream_)];
  if (stream && !stream->encoder.fits(static_cast<std::size_t>(group.size()))) flush(stream);
  if (!stream) stream.emplace(Stream{writer_.reserve_page(), NodePageEncoder(payload_limit_)});
  stream->keys.include(group);
  return {.interior = true, .page = stream->page, .slot = stream->encoder.add(group)};
}

void PageOrder::finish() {
  while (!points_.empty()) take_points();
  for (auto stream = streams_.rbegin(); stream != streams_.rend(); ++stream) {
    if (*stream) flush(*stream);
  }
}

void PageOrder::take_points() {
  whole_.push_back(std::move(points_.front()));
  whole_.back().id = writer_.reserve_page();
  points_.pop_front();
  next_point_ += points_per_page_;
}

void PageOrder::flush(std::optional<Stream>& stream) {
  whole_.push_back({.id = stream->page,
                    .summary = {.type = PageType::node,
                                .level = stream->keys.min_level,
                                .record_count = stream->encoder.size(),
                                .first_key = stream->keys.first,
                                .last_key = stream->keys.last},
                    .payload = stream->encoder.take()});
  stream.reset();
}

void PageOrder::save(StateWriter& state) const {
  // Save the point pages that wait, then the open page of every stream.
  state.put(next_point_);
  state.put(std::uint64_t{points_.size()});
  for (const Page& page : points_) {
    state.put(page.summary.record_count);
    state.put_bytes(page.payload);
  }
  for (const std::optional<Stream>& stream : streams_) {
    state.put(std::uint32_t{stream ? stream->encoder.size() : 0});
    if (!stream) continue;
    NodePageEncoder copy = stream->encoder;
    state.put(stream->page);
    state.put_bytes(copy.take());
  }
}

void PageOrder::load(StateReader& state, std::uint64_t points) {
  next_point_ = state.get_count(points);
  for (auto pages = state.get<std::uint64_t>(); pages > 0; --pages) {
    const std::vector<PointRecord> records = load_points(state);
    state.require(!records.empty() && records.size() <= points_per_page_,
                  "a page of the state has no points or too many");
    points_.push_back(point_page(records));
  }
  for (std::optional<Stream>& stream : streams_) load_stream(state, stream, points);
}

void PageOrder::load_stream(StateReader& state, std::optional<Stream>& stream,
                            std::uint64_t points) {
  const auto groups = state.get<std::uint32_t>();
  if (groups == 0) return;
  // Open the page under the number that it had.
  const std::uint32_t pages = writer_.state().pages;
  const auto number = state.get<std::uint32_t>();
  state.require(number < pages, "an open page of the state has a number that was not given out");
  stream.emplace(Stream{number, NodePageEncoder(payload_limit_)});
  // Check its groups, and add them again.
  const std::vector<std::byte> payload = aligned(state.get_bytes());
  const NodePage page(payload, groups, pages, points);
  for (std::uint32_t slot = 0; slot < groups; ++slot) {
    state.require(stream->encoder.fits(static_cast<std::size_t>(page[slot].size())),
                  "an open page of the state is too long");
    stream->keys.include(page[slot]);
    stream->encoder.add(page[slot]);
  }
}

void save_points(std::span<const PointRecord> points, StateWriter& state) {
  state.put(static_cast<std::uint32_t>(points.size()));
  state.put_bytes(points.empty() ? std::vector<std::byte>() : encode_point_page(points));
}

std::vector<PointRecord> load_points(StateReader& state) {
  const auto count = state.get<std::uint32_t>();
  const std::vector<std::byte> payload = aligned(state.get_bytes());
  if (count == 0 && payload.empty()) return {};
  const PointPage page(payload, count);
  page.verify();
  std::vector<PointRecord> points;
  for (std::uint32_t i = 0; i < count; ++i) points.push_back(page[i]);
  return points;
}

}  // namespace ptc
