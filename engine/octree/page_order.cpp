// Emits pages and saves the open ones. A state holds open pages as payloads; loading them applies
// the checks that a reader applies to pages of a file, so that a damaged state cannot build a tree.
#include "engine/octree/page_order.h"

#include <algorithm>
#include <bit>
#include <iterator>
#include <stdexcept>
#include <utility>

#include "format/point_page.h"

namespace ptc {
namespace {

constexpr std::uint32_t kProvisional = 0x80000000;  // bit of a number that is no rank yet

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
      held_limit_(held_limit(writer.header().page_shift)),
      leaving_limit_(leaving_limit(writer.header().page_shift)),
      streams_(static_cast<std::size_t>(kMaxLevel / levels_per_stream + 1)),
      cut_(streams_.size()) {}

void PageOrder::Range::include(const GroupView& group) {
  first = std::min(first, group.cell().high);
  last = std::max(last, group.cell().high);
  min_level = std::min(min_level, static_cast<std::uint8_t>(group.level()));
}

std::uint64_t PageOrder::Cells::enter(std::uint64_t next) {
  if (bytes == 0) key = next;
  // The keys differ in so many of their last digits.
  const auto digits =
      static_cast<std::size_t>(std::bit_width(std::exchange(key, next) ^ next) + 2) / 3;
  for (std::size_t h = 0; h < digits; ++h) {
    const std::uint64_t size = bytes - std::exchange(begin[h], bytes);
    mean[h] = mean[h] == 0 ? size : (3 * mean[h] + size) / 4;
  }
  return digits == 0 ? 0 : mean[digits - 1];
}

ChildRef PageOrder::add(const GroupView& group, std::uint64_t end) {
  if (group.emits() && !may_emit_)
    throw std::invalid_argument("points emit light, and the container has no room for emission");
  // Emit the point pages that begin at or before the group's end.
  while (!points_.empty() && next_point_ <= end) take_points();
  // Put the group on the page of its stream, or on a new one if it or its cell does not fit.
  Stream& stream = streams_[static_cast<std::size_t>(group.level() / levels_per_stream_)];
  const std::uint64_t cell_bytes = stream.cells.enter(group.cell().high);
  stream.cells.bytes += group.bytes().size();
  if (stream.open) {
    const NodePageEncoder& page = stream.open->encoder;
    const bool cuts_cell = cell_bytes > page.room() && page.bytes() >= page.room();
    const auto size = static_cast<std::size_t>(group.size());
    if (cuts_cell || !page.fits(size, group.emits())) close(stream);
  }
  if (!stream.open) open(stream);
  stream.open->keys.include(group);
  return {.interior = true, .page = stream.open->page, .slot = stream.open->encoder.add(group)};
}

/// Opens the next page of a stream. A held one makes the deepest held stream leave when there is no
/// room for it.
void PageOrder::open(Stream& stream) {
  if (holds(stream)) {
    stream.open.emplace(Open{kProvisional | static_cast<std::uint32_t>(ranks_.size()),
                             NodePageEncoder(payload_limit_)});
    ranks_.push_back(kNoPage);
    held_bytes_ += payload_limit_;
    while (held_bytes_ > held_limit_) evict();
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
    held_bytes_ -= payload_limit_ - content.payload.size();
    stream.held.push_back({page.page, std::move(content)});
  } else {
    emit(page.page, std::move(content));
  }
}

/// Gives ranks to the pages of the deepest stream that is held, and emits those that are full.
void PageOrder::evict() {
  Stream& stream = streams_[--cut_];
  const auto place = [&](std::uint32_t provisional, std::size_t bytes) {
    held_bytes_ -= bytes;
    return ranks_[provisional & ~kProvisional] = writer_.reserve_page(PageType::node);
  };
  for (Held& page : std::exchange(stream.held, {})) {
    const std::uint32_t rank = place(page.page, page.content.payload.size());
    emit(rank, std::move(page.content));
  }
  if (stream.open) stream.open->page = place(stream.open->page, payload_limit_);
}

void PageOrder::place(std::uint32_t rank, Page& page) const {
  page.summary.rank = rank;
  place_references(page);
}

/// Lets a page leave, together with others.
void PageOrder::emit(std::uint32_t rank, Page page) {
  place(rank, page);
  leaving_bytes_ += page.payload.size();
  leaving_.push_back(std::move(page));
  if (leaving_bytes_ > leaving_limit_ - payload_limit_) emit_leaving();
}

/// Emits the pages that leave: the deepest level first, and each level in the order of ranks.
void PageOrder::emit_leaving() {
  std::ranges::sort(leaving_, [](const Page& a, const Page& b) {
    return std::pair(b.summary.level, a.summary.rank) < std::pair(a.summary.level, b.summary.rank);
  });
  std::ranges::move(leaving_, std::back_inserter(whole_));
  leaving_.clear();
  leaving_bytes_ = 0;
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
  emit_leaving();
}

void PageOrder::finish_held(const Executor& executor) {
  std::vector<Page> pages;
  for (std::size_t i = cut_; i-- > 0;) {
    for (Held& page : std::exchange(streams_[i].held, {})) {
      const std::uint32_t rank = writer_.reserve_page(PageType::node);
      ranks_[page.page & ~kProvisional] = rank;
      place(rank, page.content);
      pages.push_back(std::move(page.content));
    }
  }
  // Keep those for which the tail has room
  const auto kept =
      pages.end() - static_cast<std::ptrdiff_t>(std::min(pages.size(), kMaxTailPages - 1));
  std::vector<Page> tail(std::make_move_iterator(kept), std::make_move_iterator(pages.end()));
  pages.erase(kept, pages.end());
  writer_.write_pages(std::move(pages), executor);
  for (const Page& page : tail) writer_.keep_page(page.summary, page.payload);
}

void PageOrder::take_points() {
  whole_.push_back(std::move(points_.front()));
  whole_.back().summary.rank = writer_.reserve_page(PageType::point);
  points_.pop_front();
  next_point_ += points_per_page_;
}

void PageOrder::save(StateWriter& state) const {
  // Save the point pages that wait, the numbers of pages that are or were held, all streams, and
  // the pages that leave.
  state.reserve(static_cast<std::size_t>(held_bytes_ + leaving_bytes_));
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
    state.put(stream.cells.key);
    state.put(stream.cells.bytes);
    for (const std::uint64_t bytes : stream.cells.begin) state.put(bytes);
    for (const std::uint64_t bytes : stream.cells.mean) state.put(bytes);
    state.put(std::uint64_t{stream.held.size()});
    for (const Held& page : stream.held) save_page(page.page, page.content, state);
  }
  state.put(std::uint64_t{leaving_.size()});
  for (const Page& page : leaving_) save_page(page.summary.rank, page, state);
}

void PageOrder::save_page(std::uint32_t number, const Page& page, StateWriter& state) const {
  state.put(page.summary.record_count);
  state.put(number);
  state.put_bytes(page.payload);
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
  for (Stream& stream : streams_) {
    load_open(state, stream, points);
    stream.cells.key = state.get<std::uint64_t>();
    state.require(stream.cells.key >> 63 == 0, "a key of the state is beyond the curve");
    stream.cells.bytes = state.get<std::uint64_t>();
    for (std::uint64_t& bytes : stream.cells.begin) bytes = state.get<std::uint64_t>();
    for (std::uint64_t& bytes : stream.cells.mean) bytes = state.get<std::uint64_t>();
    load_held(state, stream, points);
  }
  state.require(held_bytes_ <= held_limit_, "the state holds more pages than a build does");
  // Load the pages that leave.
  for (std::uint64_t left = state.get_count(kMaxPages); left > 0; --left) {
    Held page = load_page(state, points);
    state.require(page.page < writer_.state().node_pages,
                  "a page of the state has a rank that was not given out");
    page.content.summary.rank = page.page;
    leaving_bytes_ += page.content.payload.size();
    leaving_.push_back(std::move(page.content));
  }
  state.require(leaving_bytes_ <= leaving_limit_, "more pages of the state leave than fit");
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
  if (holds(stream)) held_bytes_ += payload_limit_;
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
  const std::uint64_t count = state.get_count(holds(stream) ? ranks_.size() : 0);
  for (std::uint64_t i = 0; i < count; ++i) {
    const Held& held = stream.held.emplace_back(load_page(state, points));
    held_bytes_ += held.content.payload.size();
    state.require(held.page >= kProvisional && knows(held.page),
                  "a held page of the state has a number that was not given out");
  }
}

PageOrder::Held PageOrder::load_page(StateReader& state, std::uint64_t points) const {
  const auto groups = state.get<std::uint32_t>();
  Held held{.page = state.get<std::uint32_t>(), .content = {}};
  const NodePage page = load_groups(state, held.content.payload, groups, points);
  Range keys;
  for (std::uint32_t slot = 0; slot < groups; ++slot) keys.include(page[slot]);
  held.content.summary = {.type = PageType::node,
                          .level = keys.min_level,
                          .record_count = groups,
                          .first_key = keys.first,
                          .last_key = keys.last};
  return held;
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
