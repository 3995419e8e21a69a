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
#include <functional>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "engine/io/file/file.h"
#include "engine/io/image/byte_range.h"
#include "engine/io/mesh/gltf_meshopt.h"

namespace ptc {

/// A .gltf file with its buffers, or a .glb file. What is in memory is the JSON, buffers in data
/// URIs, and buffer views that meshoptimizer compressed (EXT_meshopt_compression), once they were
/// used; other buffers are read from their files piece by piece.
class GltfDocument {
 public:
  using Json = nlohmann::json;

  /// Reads and parses the JSON, but no other file.
  /// @param memory_bytes  cap on the memory of the JSON and of decompressed buffer views
  /// @throws DataError when the file is neither a JSON object nor a GLB of version 2, or the JSON
  ///         is nested too deep; LimitError when it takes more memory; std::system_error
  GltfDocument(const std::filesystem::path& path, std::uint64_t memory_bytes);

  /// Returns the path of the file.
  [[nodiscard]] const std::filesystem::path& path() const noexcept { return path_; }
  /// Returns the JSON of the document.
  [[nodiscard]] const Json& root() const noexcept { return root_; }

  /// Returns the object object[key], or null.
  [[nodiscard]] static const Json* member(const Json& object, const char* key);
  /// Returns an extension of an object, or null.
  [[nodiscard]] static const Json* extension(const Json& object, const char* name);

  /// Says whether a mesh or a node has a weight of a morph target other than 0.
  [[nodiscard]] static bool has_weights(const Json& object);

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

  /// Finds the bytes of bufferViews[index], which are valid as long as this document.
  /// @throws DataError when the view does not exist or lies outside its buffer; std::system_error
  [[nodiscard]] ByteRange view(std::uint64_t index);
  /// Returns the bytes of a data URI. @throws DataError
  [[nodiscard]] std::vector<std::byte> decode_uri(const std::string& uri) const;
  /// Returns the file name for which a URI stands; escapes such as %20 are resolved.
  [[nodiscard]] static std::string file_name(const std::string& uri);

  /// Where the elements of an accessor lie.
  struct Elements {
    std::uint64_t count = 0;  ///< number of elements
    std::size_t components = 0;
    std::uint64_t buffer = 0;              ///< index of the buffer
    std::uint64_t offset = 0, stride = 0;  ///< of the first element, and between two, bytes
    std::uint64_t type = 0;                ///< componentType
    bool normalised = false;
    bool has_view = false;  ///< else all elements are 0, but for those that are replaced
    /// Elements of an accessor that is sparse, which others take the place of.
    struct Replaced {
      std::uint64_t count = 0;
      std::uint64_t of = 0;                              ///< elements of the accessor
      std::uint64_t index_type = 0;                      ///< componentType of their indices
      std::uint64_t index_buffer = 0, index_offset = 0;  ///< where these lie, ascending
      std::uint64_t value_buffer = 0, value_offset = 0;  ///< where the others lie
    };
    Replaced replaced{};
    std::uint64_t first = 0;     ///< index of the first element in the accessor
    std::uint64_t accessor = 0;  ///< index of the accessor

    /// Returns some of the elements.
    [[nodiscard]] Elements part(std::uint64_t from, std::uint64_t many) const noexcept {
      Elements some = *this;
      some.offset += from * stride;
      some.first += from;
      some.count = many;
      return some;
    }
  };
  /// Finds what accessors[index] says of its elements, but not where they lie: its buffer, offset
  /// and stride are 0. @throws as find_elements()
  [[nodiscard]] Elements find_shape(std::uint64_t index, std::size_t components,
                                    std::optional<std::uint64_t> expected = std::nullopt) const;
  /// Finds the elements of accessors[index].
  /// @param components  numbers in each element
  /// @param expected    number of elements that there must be, if it is known. An accessor without
  ///                    bufferView must be sparse and needs it, for no bytes justify its number
  /// @throws DataError when the accessor breaks a rule or has another shape; std::system_error
  [[nodiscard]] Elements find_elements(std::uint64_t index, std::size_t components,
                                       std::optional<std::uint64_t> expected = std::nullopt);
  /// Reads elements, in their order. Normalised integers are scaled to [0, 1] or [-1, 1].
  /// @param take  is called with the numbers of each element
  /// @throws DataError when the file does not give the bytes, or when indices of a sparse accessor
  ///         do not ascend; std::system_error
  void read(const Elements& elements,
            const std::function<void(std::span<const double>)>& take) const;
  /// Returns the memory of the JSON, bytes.
  [[nodiscard]] std::uint64_t json_bytes() const noexcept { return json_bytes_; }
  /// Returns the memory that all compressed buffer views will take, bytes.
  /// @throws DataError when one breaks a rule; LimitError when there is less memory
  [[nodiscard]] std::uint64_t view_bytes();
  /// Returns the size of the file and of the buffers that were used so far, bytes.
  [[nodiscard]] std::uint64_t bytes_read() const noexcept { return bytes_read_; }

 private:
  /// The bytes of a buffer: in a file, or in memory.
  struct Buffer {
    const InputFile* file = nullptr;  ///< null: `held`
    std::uint64_t offset = 0;         ///< in the file
    std::uint64_t length = 0;         ///< that there is
    std::vector<std::byte> held;

    /// Returns some of the bytes, which are valid as long as this.
    [[nodiscard]] ByteRange part(std::uint64_t at, std::uint64_t size) const;
  };
  /// A buffer view, checked.
  struct View {
    std::uint64_t buffer = 0, offset = 0, length = 0;
  };

  void parse(const std::vector<std::byte>& text, std::uint64_t memory_bytes);
  [[nodiscard]] std::vector<std::byte> read_text(std::uint64_t offset, std::uint64_t length,
                                                 std::uint64_t memory_bytes) const;
  void read_chunks(std::uint64_t memory_bytes);
  /// Returns a buffer with as many bytes as it declares.
  const Buffer& buffer(std::uint64_t index);
  [[nodiscard]] View find_view(std::uint64_t index);
  void find_replaced(const Json& sparse, const std::string& name, Elements& found);
  class Replacement;
  /// A stream of meshoptimizer.
  struct Stream {
    View view;  ///< of its bytes
    MeshoptView how;
  };
  /// Returns the stream of a buffer view that is compressed, or nothing.
  [[nodiscard]] std::optional<Stream> find_stream(std::uint64_t index);
  /// Returns a view of decompressed bytes.
  [[nodiscard]] View decompress(std::uint64_t index, const Stream& stream);
  [[nodiscard]] View checked_view(const Json& description, const std::string& name);
  [[nodiscard]] InputFile open_part(const std::filesystem::path& name) const;

  std::filesystem::path path_;
  InputFile file_;
  Json root_;
  Buffer binary_chunk_;
  // Buffers of the file, each found when it is first needed, and then those of decompressed views
  std::vector<std::optional<Buffer>> buffers_;
  std::map<std::uint64_t, View> decompressed_;  // by index of the view
  std::uint64_t view_room_;                     // memory for these, bytes
  std::uint64_t views_taken_ = 0;               // of it
  std::map<std::string, InputFile> files_;      // of buffers, by name
  std::uint64_t bytes_read_ = 0;
  std::uint64_t json_bytes_ = 0;
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
