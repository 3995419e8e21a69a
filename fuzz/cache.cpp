// Property, for any sequence of operations on a page cache over a container: a page is what a
// direct read returns, stays the same while its guard lives, and is refused only where
// a direct read is refused. The counts of the cache add up.
//
// The container has two forms, each sound or damaged, and a step may put the other form in its
// place. So a page may be that of either form. A step is one of:
//
//   change the form of the file   1 of 32        remove a reader   1 of 32
//   add a reader if there is none at its seat, and get a page: mostly an existing one, often the
//   same, at times of any number
#include <algorithm>
#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <stdexcept>
#include <vector>

#include "engine/cache/page_cache.h"
#include "format/error.h"
#include "fuzz/byte_source.h"
#include "fuzz/memory_file.h"
#include "fuzz/require.h"
#include "fuzz/seal.h"
#include "tests/store/sample.h"

namespace {

using namespace ptc;
using fuzz::require;
using Bytes = std::vector<std::byte>;

// Makes a container whose points emit light when `later` is true; it has void pages and pages of
// later types then.
Bytes make_sample(Codec codec, std::uint32_t points, bool later = false) {
  test::SampleOptions options;
  options.writer.codec = codec;
  options.points = points;
  if (later) {
    options.writer.point_bytes = kEmittingPointBytes;
    options.void_every = 2;
    options.later = {PageType{128}, PageType{200}, PageType{200}};
    options.tail_pages = 4;
  }
  const auto path = fuzz::MemoryFile::directory() / "sample.ptcx";
  test::write_sample(path, options);
  return test::read_file(path);
}

// Returns one of six containers, by codec, number of points and kinds of pages.
const Bytes& sample(std::size_t which) {
  static const std::array<Bytes, 6> samples{
      make_sample(Codec::raw, 0),          make_sample(Codec::raw, 130),
      make_sample(Codec::zstd, 300),       make_sample(Codec::lz4, 700),
      make_sample(Codec::zstd, 400, true), make_sample(Codec::raw, 130, true)};
  return samples[which % samples.size()];
}

// Changes up to three bytes of a file and mostly repairs the checksums.
Bytes damage(Bytes file, fuzz::ByteSource& from) {
  const std::size_t changes = from.take() % 4;
  const bool sealed = from.take() % 4 != 0;
  for (std::size_t i = 0; i < changes; ++i) {
    const std::uint32_t place = from.below(static_cast<std::uint32_t>(file.size()));
    file[place] = from.take<std::byte>();
  }
  if (sealed && changes > 0) fuzz::seal(file);
  return file;
}

// The payload of each page as a direct read returns it, or nothing where that is refused.
using Payloads = std::vector<std::optional<Bytes>>;

Payloads read_directly(const ContainerReader& container) {
  Payloads payloads(container.page_count());
  PageDecoder decoder;
  for (std::uint32_t page = 0; page < container.page_count(); ++page) {
    Bytes payload(container.page_payload_limit());
    try {
      payload.resize(container.read_page(page, payload, decoder).raw_bytes);
      payloads[page] = std::move(payload);
    } catch (const FormatError&) {
    }
  }
  return payloads;
}

// A cache over one file, with up to four readers and a seat for one too many.
class Session {
 public:
  Session(const fuzz::MemoryFile& file, const std::array<Bytes, 2>& forms,
          const ContainerReader& container)
      : file_(file), forms_(forms), container_(container) {
    for (std::size_t i = 2; i-- > 0;) {  // backwards, so that the file ends in its first form
      file_.write(forms_[i]);
      payloads_[i] = read_directly(container_);
    }
  }

  void run(fuzz::ByteSource& from) {
    // Choose options.
    CacheOptions options;
    options.threads = 1 + from.take() % kReaders;
    options.local_slots = from.take() % 3 == 0 ? 0 : 1U << from.take() % 10;
    const std::uint8_t kind = from.take();
    options.back_end = kind % 2 == 0 ? BackEnd::pread : BackEnd::mmap;
    options.replacement = kind / 2 % 2 == 0 ? Replacement::clock : Replacement::lru;
    const std::uint64_t frames = from.take() % 24;
    options.memory_bytes = PageCache::bytes_for(container_, options.threads, frames) + from.take();

    // Take steps until the bytes are used up.
    try {
      PageCache cache(container_, options);
      while (!from.empty()) step(cache, options, from);
      for (Seat& seat : seats_) leave(seat);
      check_counts(cache.statistics(), frames);
    } catch (const std::invalid_argument&) {  // a cap below the minimum, or more slots than frames
      require(frames < std::uint64_t{2} * options.threads || options.local_slots > 0);
    }
  }

 private:
  static constexpr unsigned kReaders = 4;
  struct Seat {
    std::unique_ptr<PageReader> reader;
    std::optional<PageGuard> view;  ///< pins a page of the reader
    const Bytes* shows = nullptr;   ///< the payload that `view` must keep
  };

  void step(PageCache& cache, const CacheOptions& options, fuzz::ByteSource& from) {
    const std::uint8_t what = from.take();
    Seat& seat = seats_[from.take() % seats_.size()];
    if (what % 32 == 0) return file_.write(forms_[from.take() % 2]);
    if (what % 32 == 1) return leave(seat);
    if (!seat.reader && !sit(cache, options, seat)) return;
    // Get a page, then check the views of all seats.
    const std::uint32_t page =
        what % 8 == 2 ? from.take<std::uint32_t>() : from.take() % (container_.page_count() + 1);
    get(seat, page);
    for (const Seat& other : seats_)
      require(other.shows == nullptr || shows(*other.view, *other.shows));
  }

  // Removes the reader from a seat, after its view, which must not outlive it.
  static void leave(Seat& seat) {
    seat.shows = nullptr;
    seat.view.reset();
    seat.reader.reset();
  }

  // Adds a reader at a seat, and checks that it is refused exactly when all are in use.
  bool sit(PageCache& cache, const CacheOptions& options, Seat& seat) {
    const auto sitting =
        std::ranges::count_if(seats_, [](const Seat& s) { return s.reader != nullptr; });
    try {
      seat.reader = std::make_unique<PageReader>(cache);
      require(sitting < options.threads);
      return true;
    } catch (const std::invalid_argument&) {
      require(sitting == options.threads);
      return false;
    }
  }

  // Gets a page and compares it with the direct reads of both forms.
  void get(Seat& seat, std::uint32_t page) {
    seat.shows = nullptr;
    seat.view.reset();
    try {
      seat.view.emplace(seat.reader->pin(page));
    } catch (const FormatError&) {
      ++lookups_;
      return require(page < container_.page_count() &&
                     (!payloads_[0][page] || !payloads_[1][page]));
    } catch (const std::invalid_argument&) {
      return require(page >= container_.page_count());
    }
    ++lookups_;
    require(page < container_.page_count() &&
            seat.view->record_count() == container_.entry(page).record_count);
    for (const Payloads& form : payloads_) {
      if (form[page] && shows(*seat.view, *form[page])) seat.shows = &*form[page];
    }
    require(seat.shows != nullptr &&
            reinterpret_cast<std::uintptr_t>(seat.view->payload()) % 64 == 0);
  }

  // Says whether a view holds a payload.
  static bool shows(const PageGuard& view, const Bytes& payload) {
    return std::ranges::equal(std::span(view.payload(), view.bytes()), payload);
  }

  void check_counts(const CacheStatistics& counts, std::uint64_t frames) const {
    require(counts.lookups == lookups_);
    require(counts.lookups == counts.local_hits + counts.shared_hits + counts.misses);
    require(counts.evictions <= counts.misses && counts.peak_frames <= counts.frames);
    require(counts.frames <= std::max<std::uint64_t>(frames, 1) &&
            counts.peak_frames <= counts.misses);
    require(counts.hit_rate() >= 0 && counts.hit_rate() <= 1);
  }

  const fuzz::MemoryFile& file_;
  const std::array<Bytes, 2>& forms_;
  const ContainerReader& container_;
  std::array<Payloads, 2> payloads_;  // of each form
  std::array<Seat, kReaders + 1> seats_;
  std::uint64_t lookups_ = 0;  // calls of get() that the cache must count
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::ByteSource from(data, size);
  const Bytes& whole = sample(from.take());
  std::array<Bytes, 2> forms;
  for (Bytes& form : forms) form = damage(whole, from);
  const fuzz::MemoryFile file(forms[0], "a.ptcx");
  std::optional<ContainerReader> container;
  try {
    container.emplace(file.path());
  } catch (const FormatError&) {
    return 0;
  }
  Session(file, forms, *container).run(from);
  return 0;
}
