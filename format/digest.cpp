// The content digest: XXH3-128 over the type, group, record count and payload hash of each page,
// but not its place in the file (spec/checksums.md#digest).
#include <xxhash.h>
#ifdef PTC_XXHASH_DISPATCH
#include <xxh_x86dispatch.h>
#endif

#include <new>
#include <utility>

#include "format/bytes.h"
#include "format/container.h"

namespace ptc {
namespace {

XXH3_state_t* state_of(void* state) noexcept {
  return static_cast<XXH3_state_t*>(state);
}

}  // namespace

ContentDigest::ContentDigest() : state_(XXH3_createState()) {
  if (state_ == nullptr) throw std::bad_alloc();
  XXH3_128bits_reset(state_of(state_));
}

ContentDigest::~ContentDigest() {
  XXH3_freeState(state_of(state_));
}

ContentDigest::ContentDigest(ContentDigest&& other) noexcept
    : state_(std::exchange(other.state_, nullptr)) {}

ContentDigest& ContentDigest::operator=(ContentDigest&& other) noexcept {
  std::swap(state_, other.state_);
  return *this;
}

void ContentDigest::add(const DirectoryEntry& entry) {
  std::array<std::byte, 16> record{};
  store(record.data(), 0, static_cast<std::uint8_t>(entry.type));
  store(record.data(), 1, entry.group);
  store(record.data(), 4, entry.record_count);
  store(record.data(), 8, entry.payload_xxh3);
  XXH3_128bits_update(state_of(state_), record.data(), record.size());
}

std::array<std::uint64_t, 2> ContentDigest::value() const {
  const XXH128_hash_t hash = XXH3_128bits_digest(state_of(state_));
  return {hash.low64, hash.high64};
}

std::array<std::uint64_t, 2> content_digest(std::span<const DirectoryEntry> pages) {
  ContentDigest digest;
  for (const DirectoryEntry& page : pages) digest.add(page);
  return digest.value();
}

}  // namespace ptc
