// Inside the glTF reader: the JSON, the buffers, and what accessors see of them. Source: Khronos,
// "glTF 2.0 Specification", sections 3.6 (buffers), 4 (GLB).
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

/// A .gltf with its buffers, or a .glb. Every index and range is checked when it is followed.
class GltfDocument {
 public:
  using Json = nlohmann::json;

  /// @throws DataError, std::system_error
  explicit GltfDocument(const std::filesystem::path& path);

  [[nodiscard]] const std::filesystem::path& path() const noexcept { return path_; }
  [[nodiscard]] const Json& root() const noexcept { return root_; }

  /// @throws DataError "PATH: RULE"
  [[noreturn]] void fail(const std::string& rule) const;

  /// root()[array][index]. @throws DataError when there is none
  [[nodiscard]] const Json& at(const char* array, std::uint64_t index) const;
  /// Number of entries of root()[array].
  [[nodiscard]] std::size_t count(const char* array) const;
  /// An index or size, if `object` has it. @throws DataError when it is no unsigned integer
  [[nodiscard]] std::optional<std::uint64_t> unsigned_at(const Json& object, const char* key) const;
  /// A number, or `otherwise`. @throws DataError when it is no finite number
  [[nodiscard]] double number_at(const Json& object, const char* key, double otherwise) const;
  /// `N` numbers, if `object` has them. @throws DataError when they are others
  template <std::size_t N>
  [[nodiscard]] std::optional<std::array<double, N>> numbers_at(const Json& object,
                                                                const char* key) const;

  /// Bytes of bufferViews[index].
  [[nodiscard]] std::span<const std::byte> view(std::uint64_t index);
  /// What a uri leads to: a data URI or a file beside this one.
  [[nodiscard]] std::vector<std::byte> fetch(const std::string& uri) const;
  /// The file name that a uri stands for: %20 and the like resolved.
  [[nodiscard]] static std::string file_name(const std::string& uri);

  /// Elements of accessors[index], `components` numbers each, normalised integers scaled.
  /// @param expected  how many there must be
  struct Elements {
    std::size_t count = 0;
    std::vector<double> values;  ///< count x components
  };
  [[nodiscard]] Elements read_accessor(std::uint64_t index, std::size_t components,
                                       std::optional<std::size_t> expected = std::nullopt);
  /// Bytes of the file and of the buffers that were read so far.
  [[nodiscard]] std::uint64_t bytes_read() const noexcept { return bytes_read_; }

 private:
  void parse(std::span<const std::byte> text);
  void read_chunks(std::span<const std::byte> file);
  std::span<const std::byte> buffer(std::uint64_t index);

  std::filesystem::path path_;
  Json root_;
  std::vector<std::byte> binary_chunk_;
  std::vector<std::optional<std::vector<std::byte>>> buffers_;  // read when first needed
  std::map<std::string, std::uint64_t> buffer_of_file_;         // the first one of several
  std::uint64_t bytes_read_ = 0;
};

template <std::size_t N>
std::optional<std::array<double, N>> GltfDocument::numbers_at(const Json& object,
                                                              const char* key) const {
  const auto found = object.find(key);
  if (found == object.end()) return std::nullopt;
  if (!found->is_array() || found->size() != N) {
    fail(std::string(key) + " has not " + std::to_string(N) + " numbers");
  }
  std::array<double, N> numbers{};
  for (std::size_t i = 0; i < N; ++i) {
    if (!(*found)[i].is_number()) fail(std::string(key) + " holds what is no number");
    numbers[i] = (*found)[i].template get<double>();
  }
  return numbers;
}

}  // namespace ptc
