// What a measurement ran on, and when: the head of a file of results.
#pragma once

#include <cstdint>
#include <span>
#include <string>

namespace ptc::bench {

struct Circumstances {
  std::string processor;           ///< model
  unsigned cores = 0;              ///< that this process may use
  std::uint64_t memory_bytes = 0;  ///< of the machine
  std::string system;              ///< kernel and its release
  std::string instructions;        ///< instruction set of the loops over pixels
  double load = 0;                 ///< mean number of running threads over the minute before
  std::string commit;              ///< of the source tree
  bool changed = false;            ///< the tree had changes that were not committed
  std::string date;                ///< UTC, "2025-01-31 12:00"
  std::string command;
};

/// The machine, the time and the commit that the program was built from.
/// @param command  of the program, as main() has it
/// @param commit   in place of the one that was built, where that is not known
[[nodiscard]] Circumstances circumstances_of(std::span<char* const> command,
                                             const std::string& commit);

/// A command line as anybody may read it: of each path only its last name stays, with the option in
/// front of it, and words with blanks are in quotes.
[[nodiscard]] std::string public_command(std::span<char* const> command);

}  // namespace ptc::bench
