// Long lists of items that move from memory to a temporary file when they become too long.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <type_traits>
#include <vector>

#include "engine/io/file/file.h"

namespace ptc {

/// A list to whose end items are added: in memory until spill(), then in a temporary file.
///
///     items()      | a b c d e f g |
///     spill()      file: a b c d e f g     memory: |
///     push_back()  file: a b c d e f g     memory: | h i | -> the file, kFlushItems at a time
///
/// Threads: one at a time; SpoolReaders may read a list that no longer changes concurrently.
template <typename T>
class Spool {
  static_assert(std::is_trivially_copyable_v<T>);

 public:
  [[nodiscard]] std::uint64_t size() const noexcept { return stored_ + recent_.size(); }
  [[nodiscard]] bool empty() const noexcept { return size() == 0; }
  /// Says whether the items are in a file.
  [[nodiscard]] bool spilled() const noexcept { return file_ != nullptr; }

  /// Adds an item. @throws std::system_error when the file cannot be written
  void push_back(const T& item) {
    recent_.push_back(item);
    if (file_ && recent_.size() >= kFlushItems) flush();
  }
  /// Adds items. @throws as push_back()
  void append(std::span<const T> items) {
    for (const T& item : items) push_back(item);
  }
  /// Adds items of one value up to a size. @throws as push_back()
  void grow(std::uint64_t size_wanted, const T& item) {
    while (size() < size_wanted) push_back(item);
  }
  /// Removes all items.
  void clear() {
    recent_.clear();
    file_.reset();
    stored_ = 0;
  }

  /// The items. @pre not spilled()
  [[nodiscard]] std::vector<T>& items() noexcept { return recent_; }
  [[nodiscard]] const std::vector<T>& items() const noexcept { return recent_; }

  /// Moves the items to a temporary file. @throws std::system_error that names the directory
  void spill(const std::filesystem::path& directory) {
    file_ = std::make_unique<TempFile>(directory);
    end();
  }
  /// Writes what is in memory to the file, if there is one, so that a list which no longer changes
  /// takes none. @throws std::system_error
  void end() {
    if (!file_) return;
    flush();
    recent_ = std::vector<T>();
  }

 private:
  template <typename>
  friend class SpoolReader;
  static constexpr std::size_t kFlushItems = std::max<std::size_t>(1, (1 << 18) / sizeof(T));

  void flush() {
    file_->write_at(stored_ * sizeof(T), std::as_bytes(std::span(recent_)));
    stored_ += recent_.size();
    recent_.clear();
  }

  std::vector<T> recent_;  ///< all items, or the last ones, which are not in the file yet
  std::unique_ptr<TempFile> file_;
  std::uint64_t stored_ = 0;  ///< items in the file
};

/// Reads items of a Spool in any order, through a cache of blocks of its own.
template <typename T>
class SpoolReader {
 public:
  /// @param spool        must outlive this and change no more
  /// @param cache_bytes  of the blocks; raised to one block. Nothing is taken for items in memory
  SpoolReader(const Spool<T>& spool, std::size_t cache_bytes)
      : spool_(spool),
        blocks_(spool.spilled() ? std::max<std::size_t>(1, cache_bytes / kBlockBytes) : 0) {}

  /// Returns an item. @pre index < size() of the spool
  /// @throws std::system_error when the file cannot be read
  [[nodiscard]] T operator[](std::uint64_t index) {
    if (index >= spool_.stored_) return spool_.recent_[index - spool_.stored_];
    const std::uint64_t number = index / kBlockItems;
    Block& block = blocks_[number % blocks_.size()];
    if (block.number != number + 1) load(block, number);
    return block.items[index % kBlockItems];
  }

 private:
  static constexpr std::size_t kBlockItems = std::max<std::size_t>(1, (1 << 14) / sizeof(T));
  static constexpr std::size_t kBlockBytes = kBlockItems * sizeof(T);
  struct Block {
    std::uint64_t number = 0;  ///< from 1 on; 0: empty
    std::vector<T> items;
  };

  void load(Block& block, std::uint64_t number) {
    const std::uint64_t first = number * kBlockItems;
    block.number = 0;
    block.items.resize(std::min<std::uint64_t>(kBlockItems, spool_.stored_ - first));
    spool_.file_->read_at(first * sizeof(T), std::as_writable_bytes(std::span(block.items)));
    block.number = number + 1;
  }

  const Spool<T>& spool_;
  std::vector<Block> blocks_;  ///< block n at place n modulo their number
};

}  // namespace ptc
