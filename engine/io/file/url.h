// URLs of files on servers, which stand where the path of a file may stand:
//
//   https://host/folder/city.ptcx      http:// as well
//   s3://bucket/folder/city.ptcx       an object of S3, or of a service with its interface
#pragma once

#include <filesystem>
#include <string>

namespace ptc {

/// Says whether a path is a URL that InputFile reads: http://, https:// or s3://.
[[nodiscard]] bool is_url(const std::filesystem::path& path);

/// Returns the name of a file without its folder. That of a URL is without its query, which may
/// hold a password, and still encoded.
[[nodiscard]] std::string file_name(const std::filesystem::path& path);

/// Returns the path of a file in the folder of another one, without "." and "..". For URLs the name
/// is encoded as a part of a URL, and a query of the other URL is kept.
[[nodiscard]] std::filesystem::path file_beside(const std::filesystem::path& file,
                                                const std::string& name);

/// What to ask of a server, and how to sign it.
struct WebRequest {
  std::string url;
  std::string signature;    ///< of CURLOPT_AWS_SIGV4; empty for requests that are not signed
  std::string key;          ///< "ID:SECRET" of the signature
  std::string token;        ///< of a session, which is sent along; may be empty
  std::string authorities;  ///< file of the certificates that are trusted; empty for the system's
};

/// Returns the request for a URL. CURL_CA_BUNDLE or SSL_CERT_FILE of the environment names a file
/// of certificates that are trusted in place of the system's. A request for s3:// goes by what the
/// environment says, with the names of other programs for S3: AWS_ACCESS_KEY_ID,
/// AWS_SECRET_ACCESS_KEY and AWS_SESSION_TOKEN (without them the request is not signed, as for
/// public objects), AWS_REGION or AWS_DEFAULT_REGION ("us-east-1" without them), and
/// AWS_ENDPOINT_URL_S3 or AWS_ENDPOINT_URL for other services than Amazon's.
/// @throws DataError for an s3:// URL without a bucket or a key, for a bucket of other letters than
///         buckets have, and for a key with the parts "." or "..", which servers resolve
[[nodiscard]] WebRequest web_request(const std::string& url);

}  // namespace ptc
