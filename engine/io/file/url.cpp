#include "engine/io/file/url.h"

#include <algorithm>
#include <cstdlib>
#include <initializer_list>
#include <string_view>

#include <fmt/format.h>

#include "engine/base/error.h"

namespace ptc {
namespace {

constexpr std::string_view kS3 = "s3://";

/// Encodes what is not letter, digit or "-._~" nor one of `kept` (RFC 3986, section 2.1).
std::string percent_encoded(std::string_view text, std::string_view kept) {
  std::string encoded;
  for (const char letter : text) {
    const bool plain = (letter >= 'a' && letter <= 'z') || (letter >= 'A' && letter <= 'Z') ||
                       (letter >= '0' && letter <= '9') ||
                       std::string_view("-._~").find(letter) != std::string_view::npos ||
                       kept.find(letter) != std::string_view::npos;
    encoded +=
        plain ? std::string(1, letter) : fmt::format("%{:02X}", static_cast<unsigned char>(letter));
  }
  return encoded;
}

/// Returns the first of these variables of the environment that is set and not empty.
std::string from_environment(std::initializer_list<const char*> names, const char* otherwise = "") {
  for (const char* name : names) {
    const char* const value = std::getenv(name);
    if (value != nullptr && *value != '\0') return value;
  }
  return otherwise;
}

/// "https://host", "/folder/city.ptcx" and "?key=value"; keys of S3 have no query.
struct UrlParts {
  std::string server, path, query;
};

UrlParts url_parts(const std::filesystem::path& path) {
  const std::string& url = path.native();
  const std::size_t host = url.find("://") + 3;
  const std::size_t query =
      url.starts_with(kS3) ? url.size() : std::min(url.find_first_of("?#", host), url.size());
  const std::size_t slash = std::min(url.find('/', host), query);
  return {.server = url.substr(0, slash),
          .path = slash < query ? url.substr(slash, query - slash) : "/",
          .query = url.substr(query)};
}

WebRequest s3_request(std::string_view url) {
  const std::string_view rest = url.substr(kS3.size());
  const std::size_t slash = rest.find('/');
  if (slash == 0 || slash == std::string_view::npos || slash + 1 == rest.size())
    throw DataError(fmt::format("{}: a URL of S3 has the form s3://BUCKET/KEY", url));
  const std::string bucket(rest.substr(0, slash));
  if (percent_encoded(bucket, "") != bucket || bucket.find('~') != std::string::npos)
    throw DataError(fmt::format("{}: no bucket of S3 has such a name", url));
  const std::string key = percent_encoded(rest.substr(slash + 1), "/");
  for (const std::filesystem::path& part : std::filesystem::path(key)) {
    if (part == "." || part == "..")
      throw DataError(
          fmt::format("{}: a key of S3 with a part \"{}\" cannot be read", url, part.string()));
  }
  const std::string region = from_environment({"AWS_REGION", "AWS_DEFAULT_REGION"}, "us-east-1");
  std::string endpoint = from_environment({"AWS_ENDPOINT_URL_S3", "AWS_ENDPOINT_URL"});
  while (endpoint.ends_with('/')) endpoint.pop_back();
  WebRequest request{.url = endpoint.empty() ? fmt::format("https://{}.s3.{}.amazonaws.com/{}",
                                                           bucket, region, key)
                                             : fmt::format("{}/{}/{}", endpoint, bucket, key)};
  const std::string id = from_environment({"AWS_ACCESS_KEY_ID"});
  const std::string secret = from_environment({"AWS_SECRET_ACCESS_KEY"});
  if (!id.empty() && !secret.empty()) {
    request.signature = fmt::format("aws:amz:{}:s3", region);
    request.key = fmt::format("{}:{}", id, secret);
    request.token = from_environment({"AWS_SESSION_TOKEN"});
  }
  return request;
}

}  // namespace

bool is_url(const std::filesystem::path& path) {
  const std::string& text = path.native();
  return text.starts_with("http://") || text.starts_with("https://") || text.starts_with(kS3);
}

std::string file_name(const std::filesystem::path& path) {
  if (!is_url(path)) return path.filename().string();
  return std::filesystem::path(url_parts(path).path).filename().string();
}

std::filesystem::path file_beside(const std::filesystem::path& file, const std::string& name) {
  if (!is_url(file)) return (file.parent_path() / name).lexically_normal();
  const UrlParts parts = url_parts(file);
  std::string relative = file.native().starts_with(kS3) ? name : percent_encoded(name, "/");
  relative.erase(0, std::min(relative.find_first_not_of('/'), relative.size()));
  const std::filesystem::path folder = std::filesystem::path(parts.path).parent_path();
  return parts.server + (folder / relative).lexically_normal().string() + parts.query;
}

WebRequest web_request(const std::string& url) {
  WebRequest request = url.starts_with(kS3) ? s3_request(url) : WebRequest{.url = url};
  request.authorities = from_environment({"CURL_CA_BUNDLE", "SSL_CERT_FILE"});
  return request;
}

}  // namespace ptc
