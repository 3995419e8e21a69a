// Internal to the glTF reader: what JSON will take in memory.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include <nlohmann/json.hpp>

namespace ptc {

/// Measures the memory that parsed JSON takes, without keeping it.
/// It stops where arrays and objects are nested deeper than kMaxDepth.
class JsonMeter : public nlohmann::json_sax<nlohmann::json> {
 public:
  static constexpr int kMaxDepth = 128;

  [[nodiscard]] std::uint64_t bytes() const noexcept { return bytes_; }
  [[nodiscard]] bool too_deep() const noexcept { return too_deep_; }

  bool null() override { return value(0); }
  bool boolean(bool /*value*/) override { return value(0); }
  bool number_integer(number_integer_t /*value*/) override { return value(0); }
  bool number_unsigned(number_unsigned_t /*value*/) override { return value(0); }
  bool number_float(number_float_t /*value*/, const string_t& /*text*/) override {
    return value(0);
  }
  bool string(string_t& text) override { return value(text.size()); }
  bool binary(binary_t& /*value*/) override { return value(0); }
  bool key(string_t& text) override {
    bytes_ += text.size();
    return true;
  }
  bool start_object(std::size_t /*elements*/) override { return open(); }
  bool end_object() override { return close(); }
  bool start_array(std::size_t /*elements*/) override { return open(); }
  bool end_array() override { return close(); }
  // The parser that keeps the values reports what is no JSON
  bool parse_error(std::size_t /*at*/, const std::string& /*token*/,
                   const nlohmann::detail::exception& /*error*/) override {
    return false;
  }

 private:
  bool value(std::size_t string_bytes) {
    constexpr std::uint64_t kValueBytes = 96;  // of a member of an object, its key included
    constexpr std::uint64_t kCopies = 3;       // of a string, while it is read and kept
    bytes_ += kValueBytes + kCopies * string_bytes;
    return true;
  }
  bool open() {
    too_deep_ |= ++depth_ > kMaxDepth;
    return value(0) && !too_deep_;
  }
  bool close() {
    --depth_;
    return true;
  }

  std::uint64_t bytes_ = 0;
  int depth_ = 0;
  bool too_deep_ = false;
};

}  // namespace ptc
