// The back ends that read when they are asked; io_uring is in engine/cache/uring_source.cpp.
#include "engine/cache/page_source.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <string>
#include <system_error>

#include "engine/base/memory.h"
#include "engine/cache/direct_descriptor.h"
#include "engine/cache/uring_source.h"
#include "engine/io/file/direct_range.h"

namespace ptc {
namespace {

/// Copies each range through the page cache into a buffer.
class PreadSource : public PageSource {
 public:
  PreadSource(const InputFile& file, std::size_t max_bytes) : file_(file), buffer_(max_bytes) {}

  std::span<const std::byte> read(std::uint64_t offset, std::size_t bytes) override {
    const std::span<std::byte> out(buffer_.data(), bytes);
    file_.read_at(offset, out);
    return out;
  }

 private:
  const InputFile& file_;
  Arena buffer_;
};

/// Reads the whole blocks that a range lies in, past the page cache.
class DirectSource : public PageSource {
 public:
  DirectSource(const InputFile& file, std::size_t max_bytes)
      : file_(file), direct_(file), blocks_(direct_room(max_bytes)) {}

  std::span<const std::byte> read(std::uint64_t offset, std::size_t bytes) override {
    const DirectRange range(offset, bytes);
    const ssize_t got =
        ::pread(direct_.get(), blocks_.data(), range.whole, static_cast<off_t>(range.begin));
    return complete(range, blocks_.data(), got, file_);
  }

 private:
  const InputFile& file_;
  DirectDescriptor direct_;
  Arena blocks_;
};

/// Maps the whole file. Each read releases the pages of the read before, so that resident memory
/// stays within the cap.
class MmapSource : public PageSource {
 public:
  explicit MmapSource(const InputFile& file) : bytes_(file.size()) {
    void* data = ::mmap(nullptr, bytes_, PROT_READ, MAP_SHARED, file.descriptor(), 0);
    if (data == MAP_FAILED)
      throw std::system_error(errno, std::generic_category(), "mmap " + file.path().string());
    data_ = static_cast<std::byte*>(data);
    ::madvise(data_, bytes_, MADV_RANDOM);
  }
  ~MmapSource() override { ::munmap(data_, bytes_); }
  MmapSource(const MmapSource&) = delete;
  MmapSource& operator=(const MmapSource&) = delete;

  std::span<const std::byte> read(std::uint64_t offset, std::size_t bytes) override {
    constexpr std::uint64_t kAround = 65536;  // bytes that the system may map around a fault
    advise(last_offset_, last_bytes_, kAround, MADV_DONTNEED);
    last_offset_ = offset;
    last_bytes_ = bytes;
    // Map the range at once instead of fault by fault. Older systems refuse this, which is
    // harmless.
    advise(offset, bytes, kDirectBytes, MADV_POPULATE_READ);
    return {data_ + offset, bytes};
  }

 private:
  /// Gives advice on a range, widened to multiples of `unit`.
  void advise(std::uint64_t offset, std::size_t bytes, std::uint64_t unit, int advice) noexcept {
    const std::uint64_t begin = offset / unit * unit;
    const std::uint64_t end =
        std::min<std::uint64_t>((offset + bytes + unit - 1) / unit * unit, bytes_);
    ::madvise(data_ + begin, end - begin, advice);
  }

  std::byte* data_ = nullptr;
  std::size_t bytes_;
  std::uint64_t last_offset_ = 0;
  std::size_t last_bytes_ = 0;
};

}  // namespace

DirectDescriptor::DirectDescriptor(const InputFile& file) {
  // Open it by its descriptor, because its path may name another file by now.
  fd_ = open_retrying("/proc/self/fd/" + std::to_string(file.descriptor()), O_RDONLY | O_DIRECT);
  if (fd_ < 0)
    throw std::system_error(errno, std::generic_category(),
                            "open for direct reads (O_DIRECT) " + file.path().string());
}

DirectDescriptor::~DirectDescriptor() {
  ::close(fd_);
}

std::unique_ptr<PageSource> make_page_source(BackEnd back_end, const InputFile& file,
                                             std::size_t max_bytes) {
  if (file.is_remote() && back_end != BackEnd::pread) {
    throw std::system_error(EOPNOTSUPP, std::generic_category(),
                            "read past the page cache " + file.path().string());
  }
  switch (back_end) {
    case BackEnd::mmap:
      return std::make_unique<MmapSource>(file);
    case BackEnd::direct:
      return std::make_unique<DirectSource>(file, max_bytes);
    case BackEnd::io_uring:
      return std::make_unique<UringSource>(file, max_bytes);
    case BackEnd::pread:
      break;
  }
  return std::make_unique<PreadSource>(file, max_bytes);
}

PageSources::PageSources(BackEnd back_end, const ContainerReader& container, std::size_t max_bytes)
    : back_end_(back_end), container_(container), max_bytes_(max_bytes) {
  static_cast<void>(of(0));
}

PageSource& PageSources::of(std::uint32_t part) {
  for (const Open& open : open_) {
    if (open.source && open.part == part) return *open.source;
  }
  Open& replaced = open_[next_++ % kOpen];
  replaced.source.reset();
  replaced.source = make_page_source(back_end_, container_.file(part), max_bytes_);
  replaced.part = part;
  return *replaced.source;
}

std::uint64_t page_source_bytes(BackEnd back_end, std::size_t max_bytes) noexcept {
  const std::uint64_t room = direct_room(max_bytes);
  return back_end == BackEnd::io_uring ? UringSource::kSlots * room + UringSource::kRingBytes
                                       : room;
}

}  // namespace ptc
