// Internal to the LAS reader: the texts that keep what a LAS header and its records say,
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
// las_vlrs.h describes `las.vlrs`.
#pragma once

#include <string>
#include <vector>

#include "engine/io/cloud/las_header.h"

namespace ptc {

/// Returns the text `las.header`.
/// @param colour_bits  0, 8 or 16
[[nodiscard]] std::string make_las_header_text(const LasHeader& header, unsigned colour_bits);

/// Returns the text `las.vlrs` of a file, empty when no record is kept: all records together have
/// up to kMaxVlrs bytes, and each that does not fit behind those before it is left out.
/// @param notes  gets what is not in it
/// @throws std::system_error
[[nodiscard]] std::string make_las_records_text(const InputFile& file, const LasHeader& header,
                                                std::vector<std::string>& notes);

}  // namespace ptc
