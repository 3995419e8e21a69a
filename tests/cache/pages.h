// A container for the tests of the cache, together with the contents of its pages.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <random>
#include <span>
#include <system_error>
#include <utility>
#include <vector>

#include <catch2/catch.hpp>

#include "engine/cache/page_cache.h"
#include "tests/store/sample.h"

namespace ptc::test {

/// A container in a directory of its own.
class SceneFile {
 public:
  explicit SceneFile(const SampleOptions& options) { write_sample(path(), options); }
  [[nodiscard]] std::filesystem::path path() const { return scratch_ / "a.ptcx"; }

 private:
  TemporaryDirectory scratch_;
};

/// Returns a number from 0 to n - 1, the same for the same seed on every system.
inline std::uint32_t below(std::uint32_t n, std::mt19937& random) {
  return static_cast<std::uint32_t>(random() % n);
}

/// Returns the back ends that this system has for a file, and warns about missing ones.
inline std::vector<BackEnd> available_back_ends(const InputFile& file) {
  std::vector<BackEnd> found{BackEnd::pread, BackEnd::mmap};
  for (const BackEnd back_end : {BackEnd::direct, BackEnd::io_uring}) {
    try {
      static_cast<void>(make_page_source(back_end, file, 4096));
      found.push_back(back_end);
    } catch (const std::system_error& error) {
      WARN("not tested: " << error.what());
    }
  }
  return found;
}

inline SampleOptions many_pages() {
  SampleOptions options;
  options.points = 3000;
  return options;
}

/// A container and its payloads, as ContainerReader returns them.
class Pages {
 public:
  explicit Pages(const SampleOptions& options = many_pages())
      : file(options), container(file.path()) {
    PageDecoder decoder;
    for (std::uint32_t page = 0; page < count(); ++page) {
      std::vector<std::byte> payload(container.page_payload_limit());
      payload.resize(container.read_page(page, payload, decoder).raw_bytes);
      payloads.push_back(std::move(payload));
    }
  }

  [[nodiscard]] std::uint32_t count() const { return container.page_count(); }
  [[nodiscard]] bool same(std::uint32_t page, const PageGuard& found) const {
    return found.record_count() == container.entry(page).record_count &&
           std::ranges::equal(payloads[page], std::span(found.payload(), found.bytes()));
  }
  /// Returns options that give exactly this many frames.
  [[nodiscard]] CacheOptions options(unsigned threads, std::uint64_t frames,
                                     std::uint32_t local_slots = 0,
                                     BackEnd back_end = BackEnd::pread) const {
    CacheOptions options;
    options.memory_bytes = PageCache::bytes_for(container, threads, frames, back_end);
    options.threads = threads;
    options.back_end = back_end;
    options.local_slots = local_slots;
    return options;
  }

  const SceneFile file;
  const ContainerReader container;
  std::vector<std::vector<std::byte>> payloads;
};

}  // namespace ptc::test
