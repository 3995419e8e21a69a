#include "engine/store/page_images.h"

#include <algorithm>
#include <stdexcept>
#include <string>

#include "engine/store/structure.h"
#include "format/checksum.h"
#include "format/error.h"
#include "format/point_page.h"

namespace ptc {

PageSummary summary_of(const PageHeader& page) noexcept {
  return {page.type,         page.group,     page.rank,    page.level,
          page.record_count, page.first_key, page.last_key};
}

void require_of_writer(bool holds, const char* text) {
  if (!holds) throw std::invalid_argument(std::string("container writer: ") + text);
}

void PageImages::prepare(unsigned threads) {
  while (encodings_.size() < threads) {
    encodings_.push_back(std::make_unique<Encoding>(codec_, level_));
  }
}

bool PageImages::fits_page(std::span<const std::byte> payload) const noexcept {
  return !payload.empty() && payload.size() <= payload_limit(header_.page_shift);
}

void PageImages::encode(const PageSummary& summary, std::span<const std::byte> payload,
                        std::span<const PackedColumn> columns, unsigned thread,
                        PageImage& image) const {
  require_of_writer(fits_page(payload), "a payload that is empty or longer than a page");
  if (summary.type == PageType::point) columns = packed_point_columns(header_.point_bytes);
  Encoding& with = *encodings_[thread];
  const Coding coding = with.encoder.encode(payload, with.stored, {summary.record_count, columns});
  take(summary, coding, static_cast<std::uint32_t>(payload.size()), with.stored, image);
}

void PageImages::take(const PageSummary& summary, Coding coding, std::uint32_t raw_bytes,
                      std::span<const std::byte> stored, PageImage& image) const {
  require_of_writer(fits_page(stored), "a stored payload that is empty or longer than a page");
  image.page = {};
  image.page.type = summary.type;
  image.page.coding = coding;
  image.page.rank = summary.rank;
  image.page.stored_bytes = static_cast<std::uint32_t>(stored.size());
  image.page.raw_bytes = raw_bytes;
  image.page.group = summary.group;
  image.page.level = summary.level;
  image.page.record_count = summary.record_count;
  image.page.first_key = summary.first_key;
  image.page.last_key = summary.last_key;
  image.page.payload_xxh3 = xxh3_64(stored);
  image.bytes.resize(extent_bytes(image.page.stored_bytes));
  encode_page_header(image.page, header_.uuid, std::span(image.bytes).first<kPageHeaderBytes>());
  refuse_what_readers_refuse([&] { static_cast<void>(decode_page_header(image.bytes, header_)); });
  const auto rest = std::ranges::copy(stored, image.bytes.begin() + kPageHeaderBytes).out;
  std::fill(rest, image.bytes.end(), std::byte{0});
}

}  // namespace ptc
