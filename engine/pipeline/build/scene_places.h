// Internal to the reader of scene files: the places of objects, and keys of what moves.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "engine/io/mesh/mesh.h"
#include "engine/scene/json_fields.h"

namespace ptc {

/// Checks that places fit in memory.
/// @param where  names what gives them
/// @throws LimitError
void check_places(std::uint64_t places, std::uint64_t memory_bytes, const std::string& where);

/// Reads a file of places: a line for each, with 3, 8, 12 or 16 numbers.
/// @param before  places that there are already
/// @throws DataError, LimitError, std::system_error
[[nodiscard]] std::vector<Placement> read_places(const std::filesystem::path& path,
                                                 std::uint64_t before, std::uint64_t memory_bytes);

/// Reads the place of an object; nothing where no member gives one. @throws DataError
[[nodiscard]] std::optional<Placement> read_place(JsonFields& fields);

/// Reads the frame of a key.
/// @param before  that of the key before; empty: it is the first one
/// @throws DataError
[[nodiscard]] double read_frame(JsonFields& key, const std::optional<double>& before);

/// Reads the keys of an object. Each has the parts of a place that the object gives, but for those
/// that it gives itself.
/// @param fields  of the object
/// @param where   names it
/// @param at      the frame whose place is wanted; empty: that of the first key
/// @throws DataError
[[nodiscard]] Placement read_keys(JsonFields& fields, const Json& keys, const std::string& where,
                                  const std::optional<double>& at);

}  // namespace ptc
