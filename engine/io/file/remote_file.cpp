#include "engine/io/file/remote_file.h"

#include <algorithm>
#include <condition_variable>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <system_error>
#include <vector>

#include <fmt/format.h>

#include "engine/io/file/file.h"
#include "engine/io/file/web_server.h"

namespace ptc {

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
    std::optional<FileIdentity> now;
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
    std::optional<FileIdentity> same = identity_;
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

  static inline const WebServer::Sink kNoSink = [](std::uint64_t, std::span<const std::byte>) {};

  void open_spool() {
    try {
      file_.emplace(spool_directory());
    } catch (const std::system_error&) {
      throw NoRoom{};
    }
  }

  /// Takes what comes into the temporary file.
  WebServer::Sink sink() {
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
        std::optional<FileIdentity> same = identity_;
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

  const WebServer server_;
  std::optional<TempFile> file_;
  std::optional<FileIdentity> identity_;
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
