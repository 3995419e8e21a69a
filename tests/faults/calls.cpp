// A library that is preloaded into a program under test: it interferes with the program's calls on
// files below one directory, with its allocations or threads, and reports what it did. Environment
// variables, set by harness.py, say what to do:
//
//   PTC_FAULTS_DIR     the directory
//   PTC_FAULTS_HOW     what happens: see kHows
//   PTC_FAULTS_AT      number of the call that it happens to, from 1 on, among the calls that it
//   can
//                      happen to; 0: none, and the report gets a line "call CALL" for each
//   PTC_FAULTS_ON      when set, it happens to all further calls, too
//   PTC_FAULTS_REPORT  file that gets a line "hit CALL PATH" and, at the end, "of N" such calls
//   PTC_FAULTS_TRACE   file that gets every call that changes files, as record() writes it
//
// Calls that the C library makes for itself (stdio) are not seen; streams of the C++ library are.
#include <dlfcn.h>
#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <climits>
#include <csignal>
#include <cstdarg>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include <pthread.h>

// The C library's own allocator, found without a search that would allocate.
extern "C" void* __libc_malloc(std::size_t);
extern "C" void* __libc_calloc(std::size_t, std::size_t);
extern "C" void* __libc_realloc(void*, std::size_t);
extern "C" void* __libc_memalign(std::size_t, std::size_t);

namespace {

enum class How { nothing, error, interrupt, cut, none, stop, kill, memory, thread };

struct Known {
  const char* name;
  How how;
  int error;
};
constexpr Known kHows[] = {
    {"eio", How::error, EIO},        // any call fails
    {"enospc", How::error, ENOSPC},  // a call that needs disk space fails
    {"emfile", How::error, EMFILE},  // opening a file fails
    {"stale", How::error, ENOENT},   // a file is not there, as in a stale listing of a file system
    {"eintr", How::interrupt, EINTR},
    {"short", How::cut, 0},      // half of what was asked for is read or written
    {"none", How::none, 0},      // 0 bytes are written
    {"stop", How::stop, 0},      // SIGSTOP before the call
    {"kill", How::kill, 0},      // SIGKILL before the call
    {"memory", How::memory, 0},  // an allocation or a mapping of memory fails, from main() on
    {"thread", How::thread, 0},  // a thread cannot be started
};

enum class Kind { open, create, look, read, write, sync, close, name, other };

How how = How::nothing;
int error_number = 0;
long at = 0;
bool on = false;
const char* directory = nullptr;
const char* report_path = nullptr;
std::atomic<long> calls{0};
std::atomic<bool> in_main{false};
int trace = -1;

constexpr int kMaxFiles = 1024;
char paths[kMaxFiles][PATH_MAX];  // paths of open files below the directory; "": another file
std::atomic_flag trace_lock = ATOMIC_FLAG_INIT;

template <class Function>
Function* next_of(Function*, const char* name) {
  return reinterpret_cast<Function*>(::dlsym(RTLD_NEXT, name));
}

void write_all(int fd, const void* data, std::size_t bytes) {
  static const auto real = next_of(&::write, "write");
  static_cast<void>(real(fd, data, bytes) == 0);
}

int open_log(const char* path) {
  static const auto real = next_of(&::open, "open");
  return real(path, O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0666);
}

__attribute__((format(printf, 1, 2))) void report(const char* format, ...) {
  if (report_path == nullptr) return;
  static const auto real_close = next_of(&::close, "close");
  char line[2 * PATH_MAX];
  va_list values;
  va_start(values, format);
  const int length = std::vsnprintf(line, sizeof line, format, values);
  va_end(values);
  const int fd = open_log(report_path);
  write_all(fd, line, static_cast<std::size_t>(length));
  real_close(fd);
}

__attribute__((constructor)) void read_environment() {
  directory = std::getenv("PTC_FAULTS_DIR");
  report_path = std::getenv("PTC_FAULTS_REPORT");
  on = std::getenv("PTC_FAULTS_ON") != nullptr;
  if (const char* path = std::getenv("PTC_FAULTS_TRACE")) trace = open_log(path);
  if (const char* number = std::getenv("PTC_FAULTS_AT")) at = std::atol(number);
  const char* name = std::getenv("PTC_FAULTS_HOW");
  for (const Known& known : kHows) {
    if (name == nullptr || std::strcmp(name, known.name) != 0) continue;
    how = known.how;
    error_number = known.error;
  }
}

__attribute__((destructor)) void tell_count() {
  report("of %ld\n", calls.load());
}

const char* path_of(int fd) {
  return fd >= 0 && fd < kMaxFiles ? paths[fd] : "";
}

// Returns the absolute path when it is in the directory, otherwise "".
const char* watched(const char* path, char (&whole)[PATH_MAX]) {
  if (directory == nullptr || path == nullptr) return "";
  whole[0] = '\0';
  if (path[0] != '/' && ::getcwd(whole, sizeof whole) != nullptr) std::strncat(whole, "/", 2);
  if (std::strlen(whole) + std::strlen(path) >= sizeof whole) return "";
  std::strcat(whole, path);
  return std::strncmp(whole, directory, std::strlen(directory)) == 0 ? whole : "";
}

bool can_happen(Kind kind) {
  switch (how) {
    case How::nothing:
    case How::memory:
    case How::thread:
      return false;
    case How::error:
      if (error_number == EMFILE) return kind == Kind::open || kind == Kind::create;
      if (error_number == ENOENT) return kind == Kind::open || kind == Kind::look;
      if (error_number == EIO) return true;
      return kind == Kind::create || kind == Kind::write || kind == Kind::sync ||
             kind == Kind::name;
    case How::interrupt:
      return kind != Kind::name && kind != Kind::look && kind != Kind::other;
    case How::cut:
      return kind == Kind::read || kind == Kind::write;
    case How::none:
      return kind == Kind::write;
    case How::stop:
    case How::kill:
      return true;
  }
  return false;
}

bool counted_in() {
  const long number = ++calls;
  return at > 0 && (number == at || (on && number > at));
}

// Returns true when the caller has to interfere with this call itself: to fail or to shorten it.
bool strikes(const char* call, Kind kind, const char* path) {
  if (path[0] == '\0' || !can_happen(kind)) return false;
  const bool hit = counted_in();
  if (at == 0) report("call %s\n", call);
  if (!hit) return false;
  report("hit %s %s\n", call, path);
  if (how == How::stop) ::raise(SIGSTOP);
  if (how == How::kill) ::raise(SIGKILL);
  errno = error_number;
  return how != How::stop;
}

bool allocation_fails() {
  if (how != How::memory || !in_main || !counted_in()) return false;
  if (!on || calls == at) report("hit malloc\n");
  errno = ENOMEM;
  return true;
}

// oneTBB ends a program in which it cannot start a thread: those of its own are not counted.
bool thread_fails(const void* caller) {
  if (how != How::thread || !in_main) return false;
  Dl_info library;
  if (::dladdr(caller, &library) != 0 && std::strstr(library.dli_fname, "libtbb") != nullptr)
    return false;
  if (!counted_in()) return false;
  if (!on || calls == at) report("hit pthread_create\n");
  return true;
}

class TraceGuard {
 public:
  TraceGuard() {
    while (trace >= 0 && trace_lock.test_and_set()) {
    }
  }
  ~TraceGuard() { trace_lock.clear(); }
  TraceGuard(const TraceGuard&) = delete;
  TraceGuard& operator=(const TraceGuard&) = delete;
};

// Appends to the trace: a line "CALL OFFSET BYTES PATH", tab, second path; then the written bytes.
void record(const char* call, const char* path, const char* to = "", long long offset = 0,
            const void* data = nullptr, std::size_t bytes = 0) {
  if (trace < 0 || path[0] == '\0') return;
  char line[2 * PATH_MAX + 100];
  const int length =
      std::snprintf(line, sizeof line, "%s %lld %zu %s\t%s\n", call, offset, bytes, path, to);
  write_all(trace, line, static_cast<std::size_t>(length));
  if (bytes > 0) write_all(trace, data, bytes);
}

int open_watched(int base, const char* path, int flags, mode_t mode) {
  static const auto real = next_of(&::openat, "openat");
  char whole[PATH_MAX];
  const char* const where = watched(path, whole);
  const bool creates = (flags & (O_CREAT | __O_TMPFILE)) != 0;
  if (strikes("open", creates ? Kind::create : Kind::open, where)) return -1;
  const TraceGuard guard;
  const bool is_there =
      where[0] != '\0' && ::access(where, F_OK) == 0;  // then its name does not change
  const int fd = real(base, path, flags, mode);
  if (fd < 0 || fd >= kMaxFiles || where[0] == '\0') return fd;
  std::strcpy(paths[fd], where);
  if (is_there && (flags & O_TRUNC) != 0) record("cut", where);
  if (!is_there && (flags & O_CREAT) != 0) record("create", where);
  return fd;
}

template <class Transfer>
ssize_t read_watched(const char* call, int fd, std::size_t bytes, Transfer transfer) {
  if (!strikes(call, Kind::read, path_of(fd))) return transfer(bytes);
  return how == How::cut ? transfer((bytes + 1) / 2) : -1;
}

template <class Transfer>
ssize_t write_watched(const char* call, int fd, const void* data, std::size_t bytes,
                      long long offset, Transfer transfer) {
  if (strikes(call, Kind::write, path_of(fd))) {
    if (how == How::none) return 0;
    if (how != How::cut) return -1;
    bytes = (bytes + 1) / 2;
  }
  const TraceGuard guard;
  const ssize_t done = transfer(bytes);
  if (done > 0) record("write", path_of(fd), "", offset, data, static_cast<std::size_t>(done));
  return done;
}

template <class Sync>
int sync_watched(const char* call, int fd, Sync real) {
  if (strikes(call, Kind::sync, path_of(fd))) return -1;
  const TraceGuard guard;
  const int result = real(fd);
  if (result == 0) record("sync", path_of(fd));
  return result;
}

int look_watched(const char* call, const char* path, struct stat* out) {
  using Look = int(const char*, struct stat*);
  char whole[PATH_MAX];
  if (strikes(call, Kind::look, watched(path, whole))) return -1;
  return reinterpret_cast<Look*>(::dlsym(RTLD_NEXT, call))(path, out);
}

using Main = int(int, char**, char**);
Main* real_main = nullptr;

int counted_main(int count, char** arguments, char** environment) {
  in_main = true;
  return real_main(count, arguments, environment);
}

}  // namespace

extern "C" {

int __libc_start_main(Main* program, int count, char** arguments, void (*begin)(), void (*end)(),
                      void (*linker)(), void* stack) {
  static const auto real = next_of(&__libc_start_main, "__libc_start_main");
  real_main = program;
  return real(counted_main, count, arguments, begin, end, linker, stack);
}

int open(const char* path, int flags, ...) {
  va_list rest;
  va_start(rest, flags);
  const mode_t mode = (flags & (O_CREAT | __O_TMPFILE)) != 0 ? va_arg(rest, mode_t) : 0;
  va_end(rest);
  return open_watched(AT_FDCWD, path, flags, mode);
}

int open64(const char* path, int flags, ...) __attribute__((alias("open")));

ssize_t read(int fd, void* out, std::size_t bytes) {
  static const auto real = next_of(&::read, "read");
  return read_watched("read", fd, bytes, [&](std::size_t n) { return real(fd, out, n); });
}

ssize_t pread(int fd, void* out, std::size_t bytes, off_t offset) {
  static const auto real = next_of(&::pread, "pread");
  return read_watched("pread", fd, bytes, [&](std::size_t n) { return real(fd, out, n, offset); });
}

ssize_t pread64(int fd, void* out, std::size_t bytes, off64_t offset)
    __attribute__((alias("pread")));

ssize_t write(int fd, const void* data, std::size_t bytes) {
  static const auto real = next_of(&::write, "write");
  if (path_of(fd)[0] == '\0') return real(fd, data, bytes);
  return write_watched("write", fd, data, bytes, ::lseek(fd, 0, SEEK_CUR),
                       [&](std::size_t n) { return real(fd, data, n); });
}

ssize_t pwrite(int fd, const void* data, std::size_t bytes, off_t offset) {
  static const auto real = next_of(&::pwrite, "pwrite");
  return write_watched("pwrite", fd, data, bytes, offset,
                       [&](std::size_t n) { return real(fd, data, n, offset); });
}

ssize_t pwrite64(int fd, const void* data, std::size_t bytes, off64_t offset)
    __attribute__((alias("pwrite")));

int ftruncate(int fd, off_t bytes) noexcept {
  static const auto real = next_of(&::ftruncate, "ftruncate");
  if (strikes("ftruncate", Kind::other, path_of(fd))) return -1;
  const TraceGuard guard;
  const int result = real(fd, bytes);
  if (result == 0) record("cut", path_of(fd), "", bytes);
  return result;
}

int ftruncate64(int fd, off64_t bytes) noexcept __attribute__((alias("ftruncate")));

// Watched because it punches holes into files.
int fallocate(int fd, int mode, off_t offset, off_t bytes) {
  static const auto real = next_of(&::fallocate, "fallocate");
  if (strikes("fallocate", Kind::other, path_of(fd))) return -1;
  char length[24];
  std::snprintf(length, sizeof length, "%lld", static_cast<long long>(bytes));
  const TraceGuard guard;
  const int result = real(fd, mode, offset, bytes);
  if (result == 0) record("hole", path_of(fd), length, offset);
  return result;
}

int fallocate64(int fd, int mode, off64_t offset, off64_t bytes)
    __attribute__((alias("fallocate")));

int fsync(int fd) {
  static const auto real = next_of(&::fsync, "fsync");
  return sync_watched("fsync", fd, real);
}

int fdatasync(int fd) {
  static const auto real = next_of(&::fdatasync, "fdatasync");
  return sync_watched("fdatasync", fd, real);
}

// Closes the descriptor even when it reports failure, as Linux does.
int close(int fd) {
  static const auto real = next_of(&::close, "close");
  const bool fails = strikes("close", Kind::close, path_of(fd));
  if (fd >= 0 && fd < kMaxFiles) paths[fd][0] = '\0';
  const int result = real(fd);
  if (fails) errno = error_number;
  return fails ? -1 : result;
}

int rename(const char* from, const char* to) noexcept {
  static const auto real = next_of(&::rename, "rename");
  char whole_from[PATH_MAX], whole_to[PATH_MAX];
  const char* const where = watched(from, whole_from);
  if (strikes("rename", Kind::name, where)) return -1;
  const TraceGuard guard;
  const int result = real(from, to);
  if (result == 0) record("rename", where, watched(to, whole_to));
  return result;
}

int unlink(const char* path) noexcept {
  static const auto real = next_of(&::unlink, "unlink");
  char whole[PATH_MAX];
  const char* const where = watched(path, whole);
  if (strikes("unlink", Kind::other, where)) return -1;
  const TraceGuard guard;
  const int result = real(path);
  if (result == 0) record("unlink", where);
  return result;
}

int stat(const char* path, struct stat* out) noexcept {
  return look_watched("stat", path, out);
}

int lstat(const char* path, struct stat* out) noexcept {
  return look_watched("lstat", path, out);
}

int fstat(int fd, struct stat* out) noexcept {
  static const auto real = next_of(&::fstat, "fstat");
  return strikes("fstat", Kind::other, path_of(fd)) ? -1 : real(fd, out);
}

void* mmap(void* where, std::size_t bytes, int protection, int flags, int fd,
           off_t offset) noexcept {
  static const auto real = next_of(&::mmap, "mmap");
  const bool fails = fd < 0 ? allocation_fails() : strikes("mmap", Kind::other, path_of(fd));
  if (fails) return MAP_FAILED;
  return real(where, bytes, protection, flags, fd, offset);
}

int pthread_create(pthread_t* thread, const pthread_attr_t* attributes, void* (*run)(void*),
                   void* argument) noexcept {
  static const auto real = next_of(&::pthread_create, "pthread_create");
  if (thread_fails(__builtin_return_address(0))) return EAGAIN;
  return real(thread, attributes, run, argument);
}

void* malloc(std::size_t bytes) noexcept {
  return allocation_fails() ? nullptr : __libc_malloc(bytes);
}

void* calloc(std::size_t count, std::size_t bytes) noexcept {
  return allocation_fails() ? nullptr : __libc_calloc(count, bytes);
}

void* realloc(void* old, std::size_t bytes) noexcept {
  return bytes > 0 && allocation_fails() ? nullptr : __libc_realloc(old, bytes);
}

void* memalign(std::size_t alignment, std::size_t bytes) noexcept {
  return allocation_fails() ? nullptr : __libc_memalign(alignment, bytes);
}

void* aligned_alloc(std::size_t alignment, std::size_t bytes) noexcept
    __attribute__((alias("memalign")));

int posix_memalign(void** out, std::size_t alignment, std::size_t bytes) noexcept {
  void* const block = allocation_fails() ? nullptr : __libc_memalign(alignment, bytes);
  if (block == nullptr) return ENOMEM;
  *out = block;
  return 0;
}

}  // extern "C"
