// libcurl, loaded when the first URL is opened. Linked, it and its 25 libraries would be loaded by
// each start of a program that reads files alone: 16 ms and 8 MiB for an empty one.
#pragma once

#include <curl/curl.h>

namespace ptc {

/// The functions of libcurl that are called here, by their names there.
struct CurlLibrary {
  decltype(&::curl_easy_init) easy_init = nullptr;
  decltype(&::curl_easy_setopt) easy_setopt = nullptr;
  decltype(&::curl_easy_perform) easy_perform = nullptr;
  decltype(&::curl_easy_getinfo) easy_getinfo = nullptr;
  decltype(&::curl_easy_strerror) easy_strerror = nullptr;
  decltype(&::curl_slist_append) slist_append = nullptr;
  decltype(&::curl_slist_free_all) slist_free_all = nullptr;
};

/// Returns the library, which the first call loads.
/// @throws std::system_error (ELIBACC) where it is not installed
/// Threads: may be called concurrently.
[[nodiscard]] const CurlLibrary& curl_library();

}  // namespace ptc
