// Internal to the glTF reader: the JSON of a document, its buffers, and the accessors into them.
// Source: Khronos, "glTF 2.0 Specification", sections 3.6 (buffers), 4 (GLB).
//
//   accessor --> buffer view --> buffer --> a file, a data URI, or the binary chunk of a .glb
//   (numbers)    (a range)       (bytes)
//
// Each arrow is an index or a name that the file gives, so it is checked when it is followed.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

namespace ptc {

/// A .gltf file with its buffers, or a .glb file. Buffers are read when they are first needed.
class GltfDocument {
 public:
  using Json = nlohmann::json;

  /// Reads and parses the file, but no other file.
  /// @throws DataError when it is neither a JSON object nor a GLB of version 2; std::system_error
  explicit GltfDocument(const std::filesystem::path& path);

  /// Returns the path of the file.
  [[nodiscard]] const std::filesystem::path& path() const noexcept { return path_; }
  /// Returns the JSON of the document.
  [[nodiscard]] const Json& root() const noexcept { return root_; }

  /// Refuses the file. @throws DataError "PATH: RULE"
  [[noreturn]] void fail(const std::string& rule) const;

  /// Returns root()[array][index]. @throws DataError when it does not exist
  [[nodiscard]] const Json& at(const char* array, std::uint64_t index) const;
  /// Returns the number of entries of root()[array]; 0 when there is no such array.
  [[nodiscard]] std::size_t count(const char* array) const;
  /// Returns the index or size object[key], or nothing when `object` lacks the key.
  /// @throws DataError when it is not an unsigned integer
  [[nodiscard]] std::optional<std::uint64_t> unsigned_at(const Json& object, const char* key) const;
  /// Returns the number object[key], or `otherwise` when `object` lacks the key.
  /// @throws DataError when it is not a finite number
  [[nodiscard]] double number_at(const Json& object, const char* key, double otherwise) const;
  /// Returns the `N` numbers of object[key], or nothing when `object` lacks the key.
  /// @throws DataError when it is not an array of `N` numbers
  template <std::size_t N>
  [[nodiscard]] std::optional<std::array<double, N>> numbers_at(const Json& object,
                                                                const char* key) const;

  /// Returns the bytes of bufferViews[index], which live as long as this document.
  /// @throws DataError when the view does not exist or lies outside its buffer; std::system_error
  [[nodiscard]] std::span<const std::byte> view(std::uint64_t index);
  /// Returns the bytes to which a URI leads: those of a data URI, or of a file whose path is
  /// relative to this one. @throws DataError, std::system_error
  [[nodiscard]] std::vector<std::byte> fetch(const std::string& uri) const;
  /// Returns the file name for which a URI stands; escapes such as %20 are resolved.
  [[nodiscard]] static std::string file_name(const std::string& uri);

  /// The elements of an accessor.
  struct Elements {
    std::size_t count = 0;       ///< number of elements
    std::vector<double> values;  ///< count x components
  };
  /// Reads the elements of accessors[index]. Normalised integers are scaled to [0, 1] or [-1, 1].
  /// @param components  numbers in each element
  /// @param expected    number of elements that there must be, if it is known
  /// @throws DataError when the accessor breaks a rule or has another shape; std::system_error
  [[nodiscard]] Elements read_accessor(std::uint64_t index, std::size_t components,
                                       std::optional<std::size_t> expected = std::nullopt);
  /// Returns the size of the file and of the buffers that were read so far, bytes.
  [[nodiscard]] std::uint64_t bytes_read() const noexcept { return bytes_read_; }

 private:
  void parse(std::span<const std::byte> text);
  void read_chunks(std::span<const std::byte> file);
  std::span<const std::byte> buffer(std::uint64_t index);
  [[nodiscard]] std::vector<std::byte> read_part(const std::filesystem::path& name) const;

  std::filesystem::path path_;
  Json root_;
  std::vector<std::byte> binary_chunk_;
  std::vector<std::optional<std::vector<std::byte>>> buffers_;  // read when first needed
  std::map<std::string, std::uint64_t> buffer_of_file_;         // first buffer that names the file
  std::uint64_t bytes_read_ = 0;
};

template <std::size_t N>
std::optional<std::array<double, N>> GltfDocument::numbers_at(const Json& object,
                                                              const char* key) const {
  const auto found = object.find(key);
  if (found == object.end()) return std::nullopt;
  if (!found->is_array() || found->size() != N) {
    fail(std::string(key) + " does not have " + std::to_string(N) + " numbers");
  }
  std::array<double, N> numbers{};
  for (std::size_t i = 0; i < N; ++i) {
    if (!(*found)[i].is_number()) fail(std::string(key) + " holds a value that is not a number");
    numbers[i] = (*found)[i].template get<double>();
  }
  return numbers;
}

}  // namespace ptc
