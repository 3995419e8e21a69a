// Requests for ranges of a file on a server over HTTP (RFC 9110, section 14), sent again where a
// failure may pass.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>

#include "engine/io/file/url.h"

namespace ptc {

/// What tells a file from another one of its name.
struct FileIdentity {
  std::uint64_t size = 0;
  std::string version;  ///< ETag or Last-Modified, or empty
  bool operator==(const FileIdentity&) const = default;
};

/// The server of one URL.   Threads: get() may be called concurrently.
///
/// A request that fails in a way that may pass (no connection, one that breaks off, the statuses
/// 408, 429, 500, 502, 503 and 504) is sent again for what is still missing, up to kTries times
/// without a byte, with pauses that double from kFirstPause on or are as long as the server asks
/// for.
class WebServer {
 public:
  static constexpr unsigned kTries = 5;
  static constexpr double kFirstPause = 0.2, kLongestPause = 30;       ///< seconds
  static constexpr std::uint64_t kMostBytes = std::uint64_t{1} << 42;  ///< of a file

  /// Takes bytes of an answer, in their order.
  using Sink = std::function<void(std::uint64_t offset, std::span<const std::byte>)>;

  /// @throws DataError as web_request()
  explicit WebServer(std::string url);

  /// Asks for bytes until all have come, or the file ends.
  /// @param identity  what each answer must be of; without a value, the first one tells it
  /// @throws std::system_error that names the URL: ENOENT for the statuses 404 and 410, EACCES for
  ///         401 and 403, EIO for other failures, ELIBACC without libcurl, ENOTSUP where libcurl
  ///         lacks an option; DataError for a URL that is malformed, a server that does not answer
  ///         requests for ranges, and a file that is another one than `identity` or has gone; what
  ///         the sink throws
  void get(std::uint64_t offset, std::uint64_t bytes, std::optional<FileIdentity>& identity,
           const Sink& sink) const;

  /// Refuses something of the file.
  /// @throws DataError that names the URL
  [[noreturn]] void refuse(const std::string& what) const;

 private:
  struct Answer;
  class Connection;

  [[noreturn]] void fail(int error, const std::string& what) const;
  [[nodiscard]] bool accepts(const Answer& answer, std::optional<FileIdentity>& identity) const;

  std::string url_;
  WebRequest request_;
};

}  // namespace ptc
