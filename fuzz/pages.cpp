// Property, for any bytes: the decoders of file header, superblock, page header, meta, point and
// node pages, codecs and packed columns return values that can be read completely, or throw
// FormatError.
//
// The first four bytes are the number of records (two bytes), the codec and the filter; a payload
// follows.
#include <cstdint>
#include <span>
#include <vector>

#include "format/codec.h"
#include "format/container.h"
#include "format/error.h"
#include "format/node_page.h"
#include "format/point_page.h"
#include "format/schema.h"

namespace {

// Runs a body, which may throw FormatError but nothing else.
template <class Body>
void expect_format_error(const Body& body) {
  try {
    body();
  } catch (const ptc::FormatError&) {
  }
}

void read_nodes(std::span<const std::byte> bytes, std::uint32_t count) {
  const ptc::NodePage page(bytes, count, 1000, 1'000'000);
  for (std::uint32_t slot = 0; slot < page.size(); ++slot) (void)page.decode(slot);
}

void read_points(std::span<const std::byte> bytes, std::uint32_t count) {
  const ptc::PointPage page(bytes, count);
  page.verify();
  for (std::uint32_t i = 0; i < page.size(); ++i) (void)page[i];
}

void decode_payload(std::span<const std::byte> bytes, std::uint32_t count, ptc::Coding coding) {
  std::vector<std::byte> payload(ptc::point_page_bytes(count));
  ptc::PageDecoder().decode(coding, bytes, payload, {count, ptc::packed_point_columns()});
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 4) return 0;
  const std::span<const std::byte> bytes(reinterpret_cast<const std::byte*>(data), size);
  const std::span<const std::byte> body = bytes.subspan(4);
  const std::uint32_t count = data[0] | std::uint32_t{data[1]} << 8;
  expect_format_error([&] { (void)ptc::decode_file_header(bytes); });
  expect_format_error([&] { (void)ptc::decode_superblock(bytes, {}, size); });
  expect_format_error([&] { (void)ptc::decode_page_header(bytes, {}); });
  expect_format_error([&] { (void)ptc::decode_meta(body); });
  expect_format_error([&] { read_nodes(body, count); });
  expect_format_error([&] { read_points(body, count); });
  const ptc::Coding coding{static_cast<ptc::Codec>(data[2] % 3),
                           static_cast<ptc::Filter>(data[3] % 2)};
  if (count > 0 && coding.codec != ptc::Codec::raw) {
    expect_format_error([&] { decode_payload(body, count, coding); });
  }
  return 0;
}
