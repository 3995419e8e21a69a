// Emits pages and saves the open ones. A state holds open pages as payloads; loading them applies
// the checks that a reader applies to pages of a file, so that a damaged state cannot build a tree.
#include "engine/octree/page_order.h"

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "format/point_page.h"

namespace ptc {
namespace {

constexpr std::uint32_t kProvisional = 0x80000000;        // bit of a number that is no rank yet
constexpr std::size_t kHeldBytes = std::size_t{4} << 20;  // most bytes of pages that are held

/// Copies bytes into a vector, whose memory is aligned so that payloads can be read as numbers.
std::vector<std::byte> aligned(std::span<const std::byte> bytes) {
  return {bytes.begin(), bytes.end()};
}

/// Calls visit(group, i, reference) for every interior child of a node page.
template <class Visit>
void for_each_interior(const NodePage& page, const Visit& visit) {
  for (std::uint32_t slot = 0; slot < page.size(); ++slot) {
    const GroupView group = page[slot];
    for (int i = 0; i < group.size(); ++i) {
      if (const ChildRef ref = group.child(i); ref.interior) visit(group, i, ref);
    }
  }
}

}  // namespace

ContainerWriter::Page point_page(std::span<const PointRecord> points, std::uint8_t point_bytes) {
  return {.summary = {.type = PageType::point,
                      .record_count = static_cast<std::uint32_t>(points.size()),
                      .first_key = points.front().key.high,
                      .last_key = points.back().key.high},
          .payload = encode_point_page(points, point_bytes)};
}

PageOrder::PageOrder(ContainerWriter& writer, std::uint32_t points_per_page, int levels_per_stream)
    : writer_(writer),
      points_per_page_(points_per_page),
      levels_per_stream_(levels_per_stream),
      payload_limit_(payload_limit(writer.header().page_shift)),
      may_emit_(writer.header().point_bytes != kPointBytes),
      most_held_(std::min(kMaxTailPages - 1, kHeldBytes >> writer.header().page_shift)),
      streams_(static_cast<std::size_t>(kMaxLevel / levels_per_stream + 1)),
      cut_(streams_.size()) {}

void PageOrder::Range::include(const GroupView& group) {
  first = std::min(first, group.cell().high);
  last = std::max(last, group.cell().high);
  min_level = std::min(min_level, static_cast<std::uint8_t>(group.level()));
}

ChildRef PageOrder::add(const GroupView& group, std::uint64_t end) {
  if (group.emits() && !may_emit_)
    throw std::invalid_argument("points emit light, and the container has no room for emission");
  // Emit the point pages that begin at or before the group's end.
  while (!points_.empty() && next_point_ <= end) take_points();
  // Put the group on the page of its stream, or on a new one if it does not fit.
  Stream& stream = streams_[static_cast<std::size_t>(group.level() / levels_per_stream_)];
  const auto size = static_cast<std::size_t>(group.size());
  if (stream.open && !stream.open->encoder.fits(size, group.emits())) close(stream);
  if (!stream.open) open(stream);
  stream.open->keys.include(group);
  return {.interior = true, .page = stream.open->page, .slot = stream.open->encoder.add(group)};
}

/// Opens the next page of a stream. A held one makes the deepest held stream leave when there are
/// more than the tail has room for.
void PageOrder::open(Stream& stream) {
  if (holds(stream)) {
    stream.open.emplace(Open{kProvisional | static_cast<std::uint32_t>(ranks_.size()),
                             NodePageEncoder(payload_limit_)});
    ranks_.push_back(kNoPage);
    ++held_pages_;
    while (held_pages_ > most_held_) evict();
    return;
  }
  stream.open.emplace(Open{writer_.reserve_page(PageType::node), NodePageEncoder(payload_limit_)});
}

/// Ends the open page of a stream, which is emitted or held.
void PageOrder::close(Stream& stream) {
  Open page = std::move(*stream.open);
  stream.open.reset();
  Page content{.summary = {.type = PageType::node,
                           .level = page.keys.min_level,
                           .record_count = page.encoder.size(),
                           .first_key = page.keys.first,
                           .last_key = page.keys.last},
               .payload = page.encoder.take()};
  if (holds(stream)) {
    stream.held.push_back({page.page, std::move(content)});
  } else {
    emit(page.page, std::move(content));
  }
}

/// Gives ranks to the pages of the deepest stream that is held, and emits those that are full.
void PageOrder::evict() {
  Stream& stream = streams_[--cut_];
  const auto place = [&](std::uint32_t provisional) {
    --held_pages_;
    return ranks_[provisional & ~kProvisional] = writer_.reserve_page(PageType::node);
  };
  for (Held& page : std::exchange(stream.held, {})) emit(place(page.page), std::move(page.content));
  if (stream.open) stream.open->page = place(stream.open->page);
}

void PageOrder::emit(std::uint32_t rank, Page page) {
  page.summary.rank = rank;
  place_references(page);
  whole_.push_back(std::move(page));
}

/// Replaces provisional numbers by ranks. They are known: what a page refers to lies deeper.
void PageOrder::place_references(Page& page) const {
  const NodePage nodes(page.payload.data(), page.summary.record_count);
  for_each_interior(nodes, [&](const GroupView& group, int i, const ChildRef& ref) {
    if (ref.page < kProvisional) return;
    const auto at = static_cast<std::size_t>(group.bytes().data() - page.payload.data());
    set_reference(std::span(page.payload).subspan(at), i, placed(ref));
  });
}

ChildRef PageOrder::placed(ChildRef ref) const noexcept {
  if (ref.interior && ref.page >= kProvisional) ref.page = ranks_[ref.page & ~kProvisional];
  return ref;
}

bool PageOrder::knows(std::uint32_t page) const {
  return page >= kProvisional ? (page & ~kProvisional) < ranks_.size()
                              : page < writer_.state().node_pages;
}

void PageOrder::finish() {
  while (!points_.empty()) take_points();
  for (std::size_t i = streams_.size(); i-- > 0;) {
    if (streams_[i].open) close(streams_[i]);
  }
}

void PageOrder::keep_tail() {
  for (std::size_t i = cut_; i-- > 0;) {
    for (Held& page : streams_[i].held) {
      page.content.summary.rank = writer_.reserve_page(PageType::node);
      ranks_[page.page & ~kProvisional] = page.content.summary.rank;
      place_references(page.content);
      writer_.keep_page(page.content.summary, page.content.payload);
    }
  }
}

void PageOrder::take_points() {
  whole_.push_back(std::move(points_.front()));
  whole_.back().summary.rank = writer_.reserve_page(PageType::point);
  points_.pop_front();
  next_point_ += points_per_page_;
}

void PageOrder::save(StateWriter& state) const {
  // Save the point pages that wait, the numbers of pages that are or were held, and all streams.
  state.put(next_point_);
  state.put(std::uint64_t{points_.size()});
  for (const Page& page : points_) {
    state.put(page.summary.record_count);
    state.put_bytes(page.payload);
  }
  state.put(std::uint64_t{cut_});
  state.put(std::uint64_t{ranks_.size()});
  for (const std::uint32_t rank : ranks_) state.put(rank);
  for (const Stream& stream : streams_) {
    save_open(stream, state);
    state.put(std::uint64_t{stream.held.size()});
    for (const Held& page : stream.held) {
      state.put(page.content.summary.record_count);
      state.put(page.page);
      state.put_bytes(page.content.payload);
    }
  }
}

void PageOrder::save_open(const Stream& stream, StateWriter& state) const {
  state.put(std::uint32_t{stream.open ? stream.open->encoder.size() : 0});
  if (!stream.open) return;
  NodePageEncoder copy = stream.open->encoder;
  state.put(stream.open->page);
  state.put_bytes(copy.take());
}

void PageOrder::load(StateReader& state, std::uint64_t points) {
  // Load the point pages that wait.
  next_point_ = state.get_count(points);
  for (auto pages = state.get<std::uint64_t>(); pages > 0; --pages) {
    const std::vector<PointRecord> records = load_points(state, writer_.header().point_bytes);
    state.require(!records.empty() && records.size() <= points_per_page_,
                  "a page of the state has no points or too many");
    points_.push_back(point_page(records, writer_.header().point_bytes));
  }
  // Load the numbers of pages that are or were held.
  cut_ = static_cast<std::size_t>(state.get_count(streams_.size()));
  ranks_.resize(static_cast<std::size_t>(state.get_count(kMaxPages)));
  for (std::uint32_t& rank : ranks_) {
    rank = state.get<std::uint32_t>();
    state.require(rank == kNoPage || rank < writer_.state().node_pages,
                  "a page of the state has a rank that was not given out");
  }
  // Load the streams.
  held_pages_ = static_cast<std::size_t>(std::ranges::count(ranks_, kNoPage));
  for (Stream& stream : streams_) {
    load_open(state, stream, points);
    load_held(state, stream, points);
  }
}

/// Loads and checks the payload of a node page.
NodePage PageOrder::load_groups(StateReader& state, std::vector<std::byte>& payload,
                                std::uint32_t groups, std::uint64_t points) const {
  payload = aligned(state.get_bytes());
  const NodePage page(payload, groups, kNoPage, points, may_emit_);
  for_each_interior(page, [&](const GroupView& /*group*/, int /*i*/, const ChildRef& ref) {
    state.require(knows(ref.page), "a group of the state refers to a page that there is not");
  });
  return page;
}

void PageOrder::load_open(StateReader& state, Stream& stream, std::uint64_t points) {
  const auto groups = state.get<std::uint32_t>();
  if (groups == 0) return;
  // Open the page under the number that it had.
  const auto number = state.get<std::uint32_t>();
  state.require(knows(number) && (number >= kProvisional) == holds(stream),
                "an open page of the state has a number that was not given out");
  stream.open.emplace(Open{number, NodePageEncoder(payload_limit_)});
  // Check its groups, and add them again.
  std::vector<std::byte> payload;
  const NodePage page = load_groups(state, payload, groups, points);
  for (std::uint32_t slot = 0; slot < groups; ++slot) {
    const auto size = static_cast<std::size_t>(page[slot].size());
    state.require(stream.open->encoder.fits(size, page[slot].emits()),
                  "an open page of the state is too long");
    stream.open->keys.include(page[slot]);
    stream.open->encoder.add(page[slot]);
  }
}

void PageOrder::load_held(StateReader& state, Stream& stream, std::uint64_t points) {
  const std::uint64_t count = state.get_count(holds(stream) ? kMaxTailPages : 0);
  for (std::uint64_t i = 0; i < count; ++i) {
    const auto groups = state.get<std::uint32_t>();
    Held& held = stream.held.emplace_back();
    held.page = state.get<std::uint32_t>();
    state.require(held.page >= kProvisional && knows(held.page),
                  "a held page of the state has a number that was not given out");
    const NodePage page = load_groups(state, held.content.payload, groups, points);
    Range keys;
    for (std::uint32_t slot = 0; slot < groups; ++slot) keys.include(page[slot]);
    held.content.summary = {.type = PageType::node,
                            .level = keys.min_level,
                            .record_count = groups,
                            .first_key = keys.first,
                            .last_key = keys.last};
  }
}

void save_points(std::span<const PointRecord> points, StateWriter& state) {
  state.put(static_cast<std::uint32_t>(points.size()));
  state.put_bytes(points.empty() ? std::vector<std::byte>()
                                 : encode_point_page(points, kEmittingPointBytes));
}

std::vector<PointRecord> load_points(StateReader& state, std::uint8_t point_bytes) {
  const auto count = state.get<std::uint32_t>();
  const std::vector<std::byte> payload = aligned(state.get_bytes());
  if (count == 0 && payload.empty()) return {};
  const PointPage page(payload, count, point_bytes);
  page.verify();
  std::vector<PointRecord> points;
  for (std::uint32_t i = 0; i < count; ++i) points.push_back(page[i]);
  return points;
}

}  // namespace ptc
