#include "engine/io/file/remote_file.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <chrono>
#include <condition_variable>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string_view>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "engine/base/error.h"
#include "engine/io/file/curl_library.h"
#include "engine/io/file/file.h"
#include "engine/io/file/url.h"

namespace ptc {
namespace {

constexpr long kConnectSeconds = 30;
constexpr long kSlowBytes = 1000, kSlowSeconds = 30;  // a transfer below this rate is given up
constexpr long kMostRedirections = 5;

/// What tells a file from another one of its name.
struct Identity {
  std::uint64_t size = 0;
  std::string version;  // ETag or Last-Modified, or empty
  bool operator==(const Identity&) const = default;
};

/// Takes bytes of an answer, in their order.
using Sink = std::function<void(std::uint64_t offset, std::span<const std::byte>)>;

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

/// What a server has answered to one request, while it comes in.
struct Answer {
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
class Connection {
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

/// Asks a server for bytes of a URL.
class Server {
 public:
  explicit Server(std::string url) : url_(std::move(url)) {}
  /// Asks for bytes until all have come, or the file ends.
  /// @param identity  what each answer must be of; without a value, the first one tells it
  void get(std::uint64_t offset, std::uint64_t bytes, std::optional<Identity>& identity,
           const Sink& sink) const {
    Connection connection;
    for (unsigned failed = 0; bytes > 0;) {
      Answer answer{.offset = offset, .wanted = bytes, .sink = &sink};
      const CURLcode code = connection.get(web_request(url_), answer);
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
        why = answer.status == 206
                  ? "an answer is shorter than it says"
                  : fmt::format("the server answers with status {}", answer.status);
      }
      if (code == CURLE_URL_MALFORMAT || code == CURLE_UNSUPPORTED_PROTOCOL) refuse(why);
      if (!may_pass(answer.status) && answer.status != 206 && !may_pass(code)) fail(EIO, why);
      if (++failed == RemoteFile::kTries) fail(EIO, fmt::format("{}, {} times", why, failed));
      const double pause =
          std::max(connection.asked_pause(), RemoteFile::kFirstPause * (1U << (failed - 1)));
      std::this_thread::sleep_for(
          std::chrono::duration<double>(std::min(pause, RemoteFile::kLongestPause)));
    }
  }

  [[noreturn]] void refuse(const std::string& what) const { throw DataError(url_ + ": " + what); }

 private:
  [[noreturn]] void fail(int error, const std::string& what) const {
    throw std::system_error(error, std::generic_category(), fmt::format("get {}: {}", url_, what));
  }

  /// Looks at what a server answered.
  /// @return true if its bytes are right, false if what is missing has to be asked for again
  [[nodiscard]] bool accepts(const Answer& answer, std::optional<Identity>& identity) const {
    const long status = answer.status;
    if (status < 200 || status / 100 == 3 || may_pass(status)) return false;  // see libcurl's code
    const bool is_gone = status == 404 || status == 410, is_closed = status == 401 || status == 403;
    if (identity && (is_gone || is_closed)) {
      refuse(fmt::format("the server answers with status {}: the file {} since it was opened",
                         status, is_gone ? "has gone" : "has been closed to you"));
    }
    if (is_gone) fail(ENOENT, fmt::format("status {}", status));
    if (is_closed) fail(EACCES, fmt::format("status {}", status));
    const bool is_empty = (status == 416 && answer.has_range && answer.total == 0) ||
                          (status == 200 && answer.has_length && answer.length == 0);
    if (is_empty && !identity) {
      identity = Identity{};
      return true;
    }
    if (status == 200)
      refuse("the server does not answer requests for ranges of bytes, which reading takes");
    if (status != 206 && status != 416)
      fail(EIO, fmt::format("the server answers with status {}", status));
    const Identity found{.size = answer.total, .version = answer.version()};
    if (!answer.has_range) refuse("the server does not tell the range of its answer");
    if (found.size > RemoteFile::kMostBytes)
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

  std::string url_;
};

}  // namespace

/// The blocks of a file that have come, for all RemoteFiles of its URL.
class RemoteFile::Copy {
 public:
  /// Returns the copy of a URL that is open or was opened last, if the server tells that the file
  /// is still the same. Else it opens another one.
  static std::shared_ptr<Copy> open(const std::string& url) {
    struct Copies {
      std::mutex mutex;
      std::map<std::string, std::weak_ptr<Copy>> by_url;
      std::shared_ptr<Copy> last;  // programs open a file, look at it, and open it again
    };
    static auto& copies = *new Copies;  // threads may open files until the process ends
    std::unique_lock lock(copies.mutex);
    const std::shared_ptr<Copy> known = copies.by_url[url].lock();
    lock.unlock();
    const bool same = known && !known->version().empty() && known->is_current();
    const std::shared_ptr<Copy> opened = same ? known : std::make_shared<Copy>(url);
    lock.lock();
    std::erase_if(copies.by_url, [](const auto& copy) { return copy.second.expired(); });
    copies.by_url[url] = opened;
    copies.last = opened;
    return opened;
  }

  explicit Copy(const std::string& url) : server_(url) {
    try {
      open_spool();
      server_.get(0, kBlockBytes, identity_, sink());
    } catch (const NoRoom&) {
      is_full_ = true;
      server_.get(0, 1, identity_, kNoSink);
    }
    blocks_.resize((size() + kBlockBytes - 1) / kBlockBytes);
    if (!blocks_.empty() && !is_full_) blocks_[0] = Block::held;
  }

  /// Asks for a byte, to see whether the file is still the one that was opened and can be read.
  [[nodiscard]] bool is_current() {
    std::optional<Identity> now;
    server_.get(0, 1, now, kNoSink);
    const std::lock_guard lock(mutex_);
    return now == identity_ && !failure_;
  }

  [[nodiscard]] std::uint64_t size() const noexcept { return identity_->size; }
  [[nodiscard]] const std::string& version() const noexcept { return identity_->version; }

  void read_at(std::uint64_t offset, std::span<std::byte> out) {
    if (offset > size() || out.size() > size() - offset) {
      const std::uint64_t end = std::max(offset, size());
      server_.refuse(fmt::format("offset {}: the file ends here and {} bytes are missing", end,
                                 offset + out.size() - end));
    }
    if (out.empty()) return;
    if (bring(offset / kBlockBytes, (offset + out.size() - 1) / kBlockBytes + 1)) {
      file_->read_at(offset, out);
      return;
    }
    std::optional<Identity> same = identity_;
    server_.get(offset, out.size(), same, [&](std::uint64_t at, std::span<const std::byte> bytes) {
      std::memcpy(out.data() + (at - offset), bytes.data(), bytes.size());
    });
  }

 private:
  struct NoRoom {};  // on the disk of the temporary file
  enum class Block : std::uint8_t {
    missing,
    coming,  // a thread has asked for it
    held     // in the temporary file
  };

  /// Leaves room on the disk for what the program and others write.
  static void require_room(std::uint64_t bytes) {
    constexpr std::uint64_t kReserve = std::uint64_t{1} << 30;
    std::error_code unknown;
    const std::filesystem::space_info disk = std::filesystem::space(spool_directory(), unknown);
    if (!unknown && disk.available < bytes + kReserve) throw NoRoom{};
  }

  static inline const Sink kNoSink = [](std::uint64_t, std::span<const std::byte>) {};

  void open_spool() {
    try {
      file_.emplace(spool_directory());
    } catch (const std::system_error&) {
      throw NoRoom{};
    }
  }

  /// Takes what comes into the temporary file.
  Sink sink() {
    return [this](std::uint64_t at, std::span<const std::byte> bytes) {
      try {
        file_->write_at(at, bytes);
      } catch (const std::system_error&) {
        throw NoRoom{};
      }
    };
  }

  /// Asks for the blocks of a range that are missing, and where reads follow on for some behind it.
  /// @return false if the disk is full
  bool bring(std::uint64_t block, std::uint64_t last) {
    std::unique_lock lock(mutex_);
    while (block < last) {
      if (blocks_[block] == Block::held) {
        ++block;
        continue;
      }
      if (failure_) std::rethrow_exception(failure_);
      if (is_full_) return false;
      if (blocks_[block] == Block::coming) {
        arrived_.wait(lock);
        continue;
      }
      // Claim the blocks to ask for
      ahead_ = block == next_ ? std::min(2 * ahead_, kMostAhead) : 1;
      const std::uint64_t most =
          std::min<std::uint64_t>({block + std::max<std::uint64_t>(last - block, ahead_),
                                   block + kMostAhead, blocks_.size()});
      std::uint64_t end = block;
      do blocks_[end++] = Block::coming;
      while (end < most && blocks_[end] == Block::missing);
      next_ = end;
      lock.unlock();
      // Ask
      std::exception_ptr failure;
      bool is_full = false;
      try {
        const std::uint64_t bytes = std::min(end * kBlockBytes, size()) - block * kBlockBytes;
        require_room(bytes);
        std::optional<Identity> same = identity_;
        server_.get(block * kBlockBytes, bytes, same, sink());
      } catch (const NoRoom&) {
        is_full = true;
      } catch (...) {
        failure = std::current_exception();
      }
      // Tell the others
      lock.lock();
      is_full_ = is_full_ || is_full;
      if (failure && !failure_) failure_ = failure;  // others need not wait for it as long again
      const bool came = !failure && !is_full;
      std::fill(blocks_.begin() + static_cast<std::ptrdiff_t>(block),
                blocks_.begin() + static_cast<std::ptrdiff_t>(end),
                came ? Block::held : Block::missing);
      arrived_.notify_all();
    }
    return true;
  }

  const Server server_;
  std::optional<TempFile> file_;
  std::optional<Identity> identity_;
  std::mutex mutex_;
  std::condition_variable arrived_;
  std::vector<Block> blocks_;
  std::uint64_t next_ = 1;      // behind the last request
  std::size_t ahead_ = 1;       // blocks of that request
  bool is_full_ = false;        // the disk of the temporary file
  std::exception_ptr failure_;  // of a request, after which none is sent
};

RemoteFile::RemoteFile(const std::string& url) : copy_(Copy::open(url)) {}

std::uint64_t RemoteFile::size() const noexcept {
  return copy_->size();
}

const std::string& RemoteFile::version() const noexcept {
  return copy_->version();
}

void RemoteFile::read_at(std::uint64_t offset, std::span<std::byte> out) const {
  copy_->read_at(offset, out);
}

std::filesystem::path RemoteFile::spool_directory() {
  const char* const chosen = std::getenv("TMPDIR");
  return chosen != nullptr && *chosen != '\0' ? chosen : "/var/tmp";
}

}  // namespace ptc
