#include "engine/io/file/web_server.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <chrono>
#include <condition_variable>
#include <exception>
#include <memory>
#include <mutex>
#include <new>
#include <string_view>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "engine/base/error.h"
#include "engine/io/file/curl_library.h"

namespace ptc {
namespace {

constexpr long kConnectSeconds = 30;
constexpr long kSlowBytes = 1000, kSlowSeconds = 30;  // a transfer below this rate is given up
constexpr long kMostRedirections = 5;

std::string_view trimmed(std::string_view text) {
  const auto blank = [](char letter) {
    return letter == ' ' || letter == '\t' || letter == '\r' || letter == '\n';
  };
  while (!text.empty() && blank(text.front())) text.remove_prefix(1);
  while (!text.empty() && blank(text.back())) text.remove_suffix(1);
  return text;
}

/// Takes a number off the front of a text. Returns whether there was one.
bool take_number(std::string_view& text, std::uint64_t& number) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc()) return false;
  text.remove_prefix(static_cast<std::size_t>(end - text.data()));
  return true;
}

bool take(std::string_view& text, std::string_view prefix) {
  if (!text.starts_with(prefix)) return false;
  text.remove_prefix(prefix.size());
  return true;
}

bool may_pass(CURLcode code) {
  constexpr std::array kPassing = {CURLE_COULDNT_RESOLVE_PROXY,
                                   CURLE_COULDNT_RESOLVE_HOST,
                                   CURLE_COULDNT_CONNECT,
                                   CURLE_PARTIAL_FILE,
                                   CURLE_OPERATION_TIMEDOUT,
                                   CURLE_SSL_CONNECT_ERROR,
                                   CURLE_GOT_NOTHING,
                                   CURLE_SEND_ERROR,
                                   CURLE_RECV_ERROR,
                                   CURLE_HTTP2,
                                   CURLE_HTTP2_STREAM,
                                   CURLE_AGAIN};
  return std::ranges::find(kPassing, code) != kPassing.end();
}

bool may_pass(long status) {
  constexpr std::array kPassing = {408L, 429L, 500L, 502L, 503L, 504L};
  return std::ranges::find(kPassing, status) != kPassing.end();
}

}  // namespace

/// What a server has answered to one request, while it comes in.
struct WebServer::Answer {
  std::uint64_t offset = 0, wanted = 0;  ///< what was asked for
  const Sink* sink = nullptr;            ///< takes the body of status 206
  std::uint64_t got = 0;                 ///< bytes of it that have come
  std::exception_ptr failure;            ///< of the sink
  long status = 0;
  bool too_long = false;
  bool has_range = false;
  std::uint64_t first = 0, total = 0;  ///< of Content-Range
  std::uint64_t length = 0;            ///< Content-Length, where it is told
  bool has_length = false;
  std::string etag, modified, encoding;

  void take_header(std::string_view line) {
    if (line.starts_with("HTTP/")) {  // of the next answer, behind a redirection
      const std::size_t blank = std::min(line.find(' '), line.size());
      std::string_view rest = trimmed(line.substr(blank));
      std::uint64_t number = 0;
      const bool told = take_number(rest, number);
      *this = {.offset = offset,
               .wanted = wanted,
               .sink = sink,
               .status = told ? static_cast<long>(number) : 0};
      return;
    }
    const std::size_t colon = line.find(':');
    if (colon == std::string_view::npos) return;
    std::string name(line.substr(0, colon));
    std::ranges::transform(name, name.begin(), [](char c) {
      return c >= 'A' && c <= 'Z' ? static_cast<char>(c + 32) : c;
    });
    std::string_view value = trimmed(line.substr(colon + 1));
    if (name == "etag") etag = value;
    if (name == "last-modified") modified = value;
    if (name == "content-encoding") encoding = value;
    if (name == "content-range") take_range(value);
    if (name == "content-length") has_length = take_number(value, length) && value.empty();
  }

  /// "bytes 0-9/200", or with status 416 "bytes */200".
  void take_range(std::string_view value) {
    std::uint64_t last = 0;
    has_range = take(value, "bytes ") &&
                (take(value, "*") ||
                 (take_number(value, first) && take(value, "-") && take_number(value, last))) &&
                take(value, "/") && take_number(value, total) && value.empty();
  }

  [[nodiscard]] std::string version() const { return etag.empty() ? modified : etag; }
};

/// A handle of libcurl, with the connections that it keeps open. Handles are used again; where all
/// are in use, the next one has to wait.
class WebServer::Connection {
 public:
  Connection() {
    std::unique_lock lock(pool().mutex);
    pool().returned.wait(lock, [] { return !pool().idle.empty() || pool().made < kMost; });
    if (pool().idle.empty()) {
      pool().idle.reserve(kMost);
      handle_ = curl_library().easy_init();
      if (handle_ == nullptr) throw std::bad_alloc();
      ++pool().made;
    } else {
      handle_ = pool().idle.back();
      pool().idle.pop_back();
    }
  }
  ~Connection() {
    const std::lock_guard lock(pool().mutex);
    pool().idle.push_back(handle_);  // there is room
    pool().returned.notify_one();
  }
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  /// Sends one request for what `answer` wants, and takes its answer.
  CURLcode get(const WebRequest& request, Answer& answer) {
    const CurlLibrary& curl = curl_library();
    const auto set = [&](CURLoption option, auto value) {
      const CURLcode code = curl.easy_setopt(handle_, option, value);
      if (code != CURLE_OK) {
        throw std::system_error(ENOTSUP, std::generic_category(),
                                fmt::format("libcurl's option {}: {}", static_cast<int>(option),
                                            curl.easy_strerror(code)));
      }
    };
    const std::string range =
        fmt::format("{}-{}", answer.offset, answer.offset + answer.wanted - 1);
    const auto free_headers = [&](curl_slist* list) {
      curl.easy_setopt(handle_, CURLOPT_HTTPHEADER, nullptr);
      curl.slist_free_all(list);
    };
    std::unique_ptr<curl_slist, decltype(free_headers)> headers(nullptr, free_headers);
    if (!request.token.empty()) {
      headers.reset(curl.slist_append(nullptr, ("x-amz-security-token: " + request.token).c_str()));
    }
    set(CURLOPT_URL, request.url.c_str());
    set(CURLOPT_RANGE, range.c_str());
    set(CURLOPT_PROTOCOLS_STR, "http,https");
    set(CURLOPT_REDIR_PROTOCOLS_STR, request.url.starts_with("https:") ? "https" : "http,https");
    // A signature is for one server, and the token of its session is not for another one
    set(CURLOPT_FOLLOWLOCATION, request.signature.empty() ? 1L : 0L);
    set(CURLOPT_SUPPRESS_CONNECT_HEADERS, 1L);
    set(CURLOPT_MAXREDIRS, kMostRedirections);
    set(CURLOPT_NOSIGNAL, 1L);
    set(CURLOPT_CONNECTTIMEOUT, kConnectSeconds);
    set(CURLOPT_LOW_SPEED_LIMIT, kSlowBytes);
    set(CURLOPT_LOW_SPEED_TIME, kSlowSeconds);
    set(CURLOPT_USERAGENT, "ptcx");
    set(CURLOPT_HTTPHEADER, headers.get());
    set(CURLOPT_ERRORBUFFER, error_.data());
    set(CURLOPT_HEADERFUNCTION, &take_header);
    set(CURLOPT_HEADERDATA, &answer);
    set(CURLOPT_WRITEFUNCTION, &take_body);
    set(CURLOPT_WRITEDATA, &answer);
    if (!request.authorities.empty()) set(CURLOPT_CAINFO, request.authorities.c_str());
    if (request.signature.empty()) {
      set(CURLOPT_NETRC, static_cast<long>(CURL_NETRC_OPTIONAL));
      set(CURLOPT_AWS_SIGV4, static_cast<const char*>(nullptr));
      set(CURLOPT_USERPWD, static_cast<const char*>(nullptr));
    } else {
      set(CURLOPT_NETRC, static_cast<long>(CURL_NETRC_IGNORED));
      set(CURLOPT_AWS_SIGV4, request.signature.c_str());
      set(CURLOPT_USERPWD, request.key.c_str());
    }
    error_[0] = '\0';
    return curl.easy_perform(handle_);
  }

  /// Returns what libcurl says of the request that failed.
  [[nodiscard]] std::string error(CURLcode code) const {
    if (error_[0] != '\0') return error_.data();
    return curl_library().easy_strerror(code);
  }

  /// Returns the pause that the server asked for, seconds; 0 for none.
  [[nodiscard]] double asked_pause() const {
    curl_off_t seconds = 0;
    curl_library().easy_getinfo(handle_, CURLINFO_RETRY_AFTER, &seconds);
    return static_cast<double>(seconds);
  }

 private:
  static constexpr std::size_t kMost = 8;
  struct Pool {
    std::mutex mutex;
    std::condition_variable returned;
    std::vector<CURL*> idle;
    std::size_t made = 0;
  };
  static Pool& pool() {
    static Pool& handles = *new Pool;  // threads may read until the process ends
    return handles;
  }
  static std::size_t take_header(char* line, std::size_t size, std::size_t count, void* to) {
    auto& answer = *static_cast<Answer*>(to);
    return guarded(answer, size * count, [&] { answer.take_header({line, size * count}); });
  }
  /// Does something with bytes of an answer. libcurl must not see its exceptions.
  /// @return how many were taken: all or, after an exception, none
  template <class Take>
  static std::size_t guarded(Answer& answer, std::size_t bytes, const Take& take) {
    try {
      take();
      return bytes;
    } catch (...) {
      answer.failure = std::current_exception();
      return 0;
    }
  }
  /// Takes bytes of the body. Another body than that of the range is not read to its end.
  static std::size_t take_body(char* bytes, std::size_t size, std::size_t count, void* to) {
    auto& answer = *static_cast<Answer*>(to);
    if (answer.status != 206) return 0;
    answer.too_long = size * count > answer.wanted - answer.got;
    if (answer.too_long) return 0;
    return guarded(answer, size * count, [&] {
      (*answer.sink)(answer.offset + answer.got, std::as_bytes(std::span(bytes, size * count)));
      answer.got += size * count;
    });
  }

  CURL* handle_ = nullptr;
  std::array<char, CURL_ERROR_SIZE> error_{};
};

WebServer::WebServer(std::string url) : url_(std::move(url)), request_(web_request(url_)) {}

void WebServer::refuse(const std::string& what) const {
  throw DataError(url_ + ": " + what);
}

void WebServer::fail(int error, const std::string& what) const {
  throw std::system_error(error, std::generic_category(), fmt::format("get {}: {}", url_, what));
}

void WebServer::get(std::uint64_t offset, std::uint64_t bytes,
                    std::optional<FileIdentity>& identity, const Sink& sink) const {
  Connection connection;
  for (unsigned failed = 0; bytes > 0;) {
    Answer answer{.offset = offset, .wanted = bytes, .sink = &sink};
    const CURLcode code = connection.get(request_, answer);
    if (answer.failure) std::rethrow_exception(answer.failure);
    const bool cut_short = answer.status == 206 && answer.got == 0;  // perhaps in its headers
    if (!cut_short && accepts(answer, identity)) {
      offset += answer.got;
      bytes -= answer.got;
      if (answer.got > 0) failed = 0;
      if (bytes == 0 || offset >= identity->size) return;
      if (code == CURLE_OK && answer.got > 0) continue;  // servers may limit what they send
    }
    std::string why = connection.error(code);
    if (code == CURLE_OK || answer.status >= 400) {
      why = answer.status == 206 ? "an answer is shorter than it says"
                                 : fmt::format("the server answers with status {}", answer.status);
    }
    if (code == CURLE_URL_MALFORMAT || code == CURLE_UNSUPPORTED_PROTOCOL) refuse(why);
    if (!may_pass(answer.status) && answer.status != 206 && !may_pass(code)) fail(EIO, why);
    if (++failed == kTries) fail(EIO, fmt::format("{}, {} times", why, failed));
    const double pause = std::max(connection.asked_pause(), kFirstPause * (1U << (failed - 1)));
    std::this_thread::sleep_for(std::chrono::duration<double>(std::min(pause, kLongestPause)));
  }
}

/// Looks at what a server answered.
/// @return true if its bytes are right, false if what is missing has to be asked for again
bool WebServer::accepts(const Answer& answer, std::optional<FileIdentity>& identity) const {
  const long status = answer.status;
  if (status < 200 || status / 100 == 3 || may_pass(status)) return false;  // see libcurl's code
  const bool is_gone = status == 404 || status == 410, is_closed = status == 401 || status == 403;
  if (identity && (is_gone || is_closed)) {
    refuse(fmt::format("the server answers with status {}: the file {} since it was opened", status,
                       is_gone ? "has gone" : "has been closed to you"));
  }
  if (is_gone) fail(ENOENT, fmt::format("status {}", status));
  if (is_closed) fail(EACCES, fmt::format("status {}", status));
  const bool is_empty = (status == 416 && answer.has_range && answer.total == 0) ||
                        (status == 200 && answer.has_length && answer.length == 0);
  if (is_empty && !identity) {
    identity = FileIdentity{};
    return true;
  }
  if (status == 200)
    refuse("the server does not answer requests for ranges of bytes, which reading takes");
  if (status != 206 && status != 416)
    fail(EIO, fmt::format("the server answers with status {}", status));
  const FileIdentity found{.size = answer.total, .version = answer.version()};
  if (!answer.has_range) refuse("the server does not tell the range of its answer");
  if (found.size > kMostBytes)
    refuse(
        fmt::format("the server says that the file has {} bytes; 4 TiB can be read", found.size));
  if (identity && found != *identity) refuse("the file has changed since it was opened");
  if (status == 416 || answer.first != answer.offset || answer.too_long)
    refuse(fmt::format("offset {}: the server answers with another range", answer.offset));
  if (!answer.encoding.empty() && answer.encoding != "identity")
    refuse(fmt::format("the server sends the file encoded as {}", answer.encoding));
  identity = found;
  return true;
}

}  // namespace ptc
