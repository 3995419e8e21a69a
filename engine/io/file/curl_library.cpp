#include "engine/io/file/curl_library.h"

#include <dlfcn.h>

#include <cerrno>
#include <string>
#include <system_error>
#include <type_traits>

namespace ptc {
namespace {

[[noreturn]] void fail_to_load() {
  const char* const why = ::dlerror();
  throw std::system_error(
      ELIBACC, std::generic_category(),
      std::string("to read URLs takes libcurl, Debian's package libcurl4: ") + (why ? why : ""));
}

CurlLibrary load() {
  // Never closed: connections that are still open may use it until the process ends
  void* const library = ::dlopen("libcurl.so.4", RTLD_NOW | RTLD_LOCAL);
  if (library == nullptr) fail_to_load();
  const auto take = [&](auto& function, const char* name) {
    function =
        reinterpret_cast<std::remove_reference_t<decltype(function)>>(::dlsym(library, name));
    if (function == nullptr) fail_to_load();
  };
  CurlLibrary curl;
  take(curl.easy_init, "curl_easy_init");
  take(curl.easy_setopt, "curl_easy_setopt");
  take(curl.easy_perform, "curl_easy_perform");
  take(curl.easy_getinfo, "curl_easy_getinfo");
  take(curl.easy_strerror, "curl_easy_strerror");
  take(curl.slist_append, "curl_slist_append");
  take(curl.slist_free_all, "curl_slist_free_all");
  decltype(&::curl_global_init) global_init = nullptr;
  take(global_init, "curl_global_init");
  if (const CURLcode code = global_init(CURL_GLOBAL_DEFAULT); code != CURLE_OK)
    throw std::system_error(EIO, std::generic_category(), "curl_global_init");
  return curl;
}

}  // namespace

const CurlLibrary& curl_library() {
  static const CurlLibrary library = load();
  return library;
}

}  // namespace ptc
