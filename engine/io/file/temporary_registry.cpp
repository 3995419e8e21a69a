#include "engine/io/file/temporary_registry.h"

#include <fcntl.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <csignal>
#include <cstddef>
#include <list>
#include <new>
#include <string>

#include "engine/io/file/file.h"

namespace ptc {
namespace {

constexpr std::array kFatalSignals = {SIGINT, SIGTERM, SIGHUP, SIGQUIT, SIGPIPE, SIGXCPU};
std::atomic_flag registry_lock = ATOMIC_FLAG_INIT;

// An absolute name that a fatal signal removes.
struct Temporary {
  const void* owner;
  std::string name;
};

std::list<Temporary>& live_temporaries() {
  // Construct it in static memory and never destroy it: it outlives static destructors and needs
  // no heap.
  alignas(std::list<Temporary>) static std::byte room[sizeof(std::list<Temporary>)];
  static auto* const names = new (room) std::list<Temporary>;
  return *names;
}

// Blocks fatal signals in this thread and returns the signals that were blocked before.
sigset_t block_fatal_signals() {
  sigset_t fatal, before;
  sigemptyset(&fatal);
  for (const int signal : kFatalSignals) sigaddset(&fatal, signal);
  pthread_sigmask(SIG_BLOCK, &fatal, &before);
  return before;
}

// Holds the lock of the registry, with fatal signals blocked.
class RegistryGuard {
 public:
  RegistryGuard() : before_(block_fatal_signals()) {
    while (registry_lock.test_and_set(std::memory_order_acquire)) {
    }
  }
  ~RegistryGuard() {
    registry_lock.clear(std::memory_order_release);
    pthread_sigmask(SIG_SETMASK, &before_, nullptr);
  }
  RegistryGuard(const RegistryGuard&) = delete;
  RegistryGuard& operator=(const RegistryGuard&) = delete;

 private:
  sigset_t before_;
};

void unlink_and_reraise(int signal) {
  remove_temporaries();
  // Because of SA_RESETHAND, the default action follows when this handler returns.
  static_cast<void>(::raise(signal));
}

}  // namespace

int create_temporary(const void* owner, const std::filesystem::path& path) {
  std::list<Temporary> entry{{owner, std::filesystem::absolute(path).string()}};
  auto& names = live_temporaries();
  const RegistryGuard guard;
  const int fd = open_retrying(path, O_RDWR | O_CREAT | O_EXCL, 0666);
  if (fd >= 0) names.splice(names.end(), entry);
  return fd;
}

void forget_temporary(const void* owner) noexcept {
  std::list<Temporary> removed;  // freed after the guard
  auto& names = live_temporaries();
  const RegistryGuard guard;
  for (auto it = names.begin(); it != names.end(); ++it) {
    if (it->owner != owner) continue;
    removed.splice(removed.end(), names, it);
    return;
  }
}

void add_temporary(const void* owner, const std::filesystem::path& path) {
  std::list<Temporary> entry{{owner, std::filesystem::absolute(path).string()}};
  auto& names = live_temporaries();
  const RegistryGuard guard;
  names.splice(names.end(), entry);
}

// Keeps the lock, so that no other thread can create a file before the process ends.
void remove_temporaries() noexcept {
  block_fatal_signals();
  while (registry_lock.test_and_set(std::memory_order_acquire)) {
  }
  for (const Temporary& temporary : live_temporaries()) ::unlink(temporary.name.c_str());
}

void remove_temporaries_on_signal() {
  live_temporaries();  // construct the list here, not in the handler
  for (const int signal : kFatalSignals) {
    struct sigaction before {};
    ::sigaction(signal, nullptr, &before);
    if (before.sa_handler == SIG_IGN) continue;
    struct sigaction action {};
    action.sa_handler = unlink_and_reraise;
    action.sa_flags = static_cast<int>(SA_RESETHAND);
    sigemptyset(&action.sa_mask);
    for (const int other : kFatalSignals) sigaddset(&action.sa_mask, other);
    ::sigaction(signal, &action, nullptr);
  }
}

}  // namespace ptc
