// The registry of the temporary names that a fatal signal removes.
//
// A temporary file must disappear when the process ends, whether by an exception (destructors) or
// by a signal that a user or the system sends to end it (a handler that walks the registry). The
// handler may run in any thread at any time:
//
//   create_temporary()            handler
//   block fatal signals           block fatal signals
//   take the lock                 take the lock, never release it
//   create file, add name         unlink all names
//   release, unblock              end the process
//
// Whoever changes the registry holds the lock with fatal signals blocked in its own thread. So a
// handler that waits for the lock never waits for the thread that it interrupted. A file and its
// name appear in one step that no signal can divide. After the handler no file can appear.
#pragma once

#include <filesystem>

namespace ptc {

/// Creates a file and registers its name in one step that no handled signal can divide.
/// @param owner  by which the name is forgotten
/// @return the descriptor, or -1 and errno
[[nodiscard]] int create_temporary(const void* owner, const std::filesystem::path& path);

/// Registers a name. The file need not exist.
void add_temporary(const void* owner, const std::filesystem::path& path);

/// Removes a name from the registry. It allocates nothing, because it is called while an exception
/// propagates, perhaps for lack of memory.
void forget_temporary(const void* owner) noexcept;

}  // namespace ptc
