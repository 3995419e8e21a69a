// Internal to the LAS reader and writer: the texts that keep what a LAS header and its records say,
// so that the file can be written again.
//
// `las.header` is a JSON object. Texts of the header have bytes as code points, so that bytes that
// are not UTF-8 survive, and no zeros at their ends:
//
//   version          "1.2"                        system_id, software   text
//   format           0 to 10                      day, year             of creation
//   record_length    bytes of a point record      global_encoding       bits
//   scale, offset    arrays of x, y and z         guid                  16 bytes in hexadecimal
//   file_source_id   number                       colour_bits           8 or 16 in fields of 16
//   bits;
//                                                                       0 where there is no colour
//
// `las.vlrs` is base64 (RFC 4648, section 4, padded) of records one after another, each as a VLR: a
// header of 54 bytes and its payload. An extended record becomes such a record. The records about
// compression, of users "laszip encoded" and "copc", are not among them.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "engine/io/cloud/las_header.h"

namespace ptc {

/// Returns the text `las.header`.
/// @param colour_bits  0, 8 or 16
[[nodiscard]] std::string make_las_header_text(const LasHeader& header, unsigned colour_bits);

/// The text `las.vlrs`, and what is not in it.
struct LasRecordsText {
  std::string base64;               ///< empty when no record is kept
  std::vector<LasRecord> left_out;  ///< records that do not fit 16 KiB
};

/// Returns the text `las.vlrs` of a file. @throws std::system_error
[[nodiscard]] LasRecordsText make_las_records_text(const InputFile& file, const LasHeader& header);

}  // namespace ptc
