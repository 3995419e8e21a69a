// Paths that are URLs, and the requests that they stand for.
#include "engine/io/file/url.h"

#include <array>
#include <cstdlib>
#include <initializer_list>
#include <string>
#include <utility>
#include <vector>

#include <catch2/catch.hpp>

#include "engine/base/error.h"

namespace {

/// Sets the variables of the environment that count, and puts them back at the end.
class Environment {
 public:
  Environment(std::initializer_list<std::pair<const char*, const char*>> variables) {
    for (const char* name : kNames) {
      const char* const value = std::getenv(name);
      if (value != nullptr) before_.emplace_back(name, value);
      ::unsetenv(name);
    }
    for (const auto& [name, value] : variables) ::setenv(name, value, 1);
  }
  ~Environment() {
    for (const char* name : kNames) ::unsetenv(name);
    for (const auto& [name, value] : before_) ::setenv(name, value.c_str(), 1);
  }
  Environment(const Environment&) = delete;
  Environment& operator=(const Environment&) = delete;

 private:
  static constexpr std::array kNames = {
      "AWS_ACCESS_KEY_ID",   "AWS_SECRET_ACCESS_KEY", "AWS_SESSION_TOKEN",
      "AWS_REGION",          "AWS_DEFAULT_REGION",    "AWS_ENDPOINT_URL",
      "AWS_ENDPOINT_URL_S3", "CURL_CA_BUNDLE",        "SSL_CERT_FILE"};
  std::vector<std::pair<const char*, std::string>> before_;
};

}  // namespace

TEST_CASE("url: a path is a URL by its scheme") {
  for (const char* url : {"http://a/b", "https://a/b.ptcx?c", "s3://bucket/key"})
    CHECK(ptc::is_url(url));
  for (const char* path : {"a.ptcx", "/http://a/b", "http:/a/b", "HTTP", "ftp://a/b", "s3:/a", ""})
    CHECK_FALSE(ptc::is_url(path));
}

TEST_CASE("url: a file beside another one has its folder and its query") {
  CHECK(ptc::file_beside("https://host/a/city.ptcx", "city.parts/0.ptcx") ==
        "https://host/a/city.parts/0.ptcx");
  CHECK(ptc::file_beside("https://host/city.ptcx?key=a/b#c", "x y+%.bin") ==
        "https://host/x%20y%2B%25.bin?key=a/b#c");
  CHECK(ptc::file_beside("https://host/a/b.obj", "./../t/x.png") == "https://host/t/x.png");
  CHECK(ptc::file_beside("https://host/a/b.obj", "../../../x.png") == "https://host/x.png");
  CHECK(ptc::file_beside("https://host/a/b.obj", "/x.png") == "https://host/a/x.png");
  CHECK(ptc::file_beside("https://host?key", "x.png") == "https://host/x.png?key");
  CHECK(ptc::file_beside("s3://bucket/a b/city.ptcx", "c d.ptcx") == "s3://bucket/a b/c d.ptcx");
  CHECK(ptc::file_beside("/a/city.ptcx", "b?c.ptcx") == "/a/b?c.ptcx");
  CHECK(ptc::file_beside("city.ptcx", "./parts/../0.ptcx") == "0.ptcx");
}

TEST_CASE("url: the name of a file is without folder and query") {
  CHECK(ptc::file_name("https://host/a/city.ptcx?key=a/b.ply") == "city.ptcx");
  CHECK(ptc::file_name("https://host/a%20b.ply#c") == "a%20b.ply");
  CHECK(ptc::file_name("https://host?a/b") == "");
  CHECK(ptc::file_name("s3://bucket/a/b?c.ply") == "b?c.ply");
  CHECK(ptc::file_name("/a/b?c.ply") == "b?c.ply");
}

TEST_CASE("url: an object of S3 is asked for where the environment says") {
  {
    const Environment none({});
    const ptc::WebRequest request = ptc::web_request("s3://bucket/a b/c+d.ptcx");
    CHECK(request.url == "https://bucket.s3.us-east-1.amazonaws.com/a%20b/c%2Bd.ptcx");
    CHECK(request.signature.empty());
    CHECK(request.key.empty());
  }
  {
    const Environment user({{"AWS_ACCESS_KEY_ID", "id"},
                            {"AWS_SECRET_ACCESS_KEY", "secret"},
                            {"AWS_SESSION_TOKEN", "token"},
                            {"AWS_DEFAULT_REGION", "eu-west-1"},
                            {"AWS_ENDPOINT_URL", "https://other/"},
                            {"AWS_ENDPOINT_URL_S3", "https://store:9000/"}});
    const ptc::WebRequest request = ptc::web_request("s3://bucket/key");
    CHECK(request.url == "https://store:9000/bucket/key");
    CHECK(request.signature == "aws:amz:eu-west-1:s3");
    CHECK(request.key == "id:secret");
    CHECK(request.token == "token");
  }
  {  // a secret without its id signs nothing, and a region of its own goes first
    const Environment half({{"AWS_SECRET_ACCESS_KEY", "secret"},
                            {"AWS_REGION", "eu-north-1"},
                            {"AWS_DEFAULT_REGION", "eu-west-1"}});
    const ptc::WebRequest request = ptc::web_request("s3://bucket/key");
    CHECK(request.url == "https://bucket.s3.eu-north-1.amazonaws.com/key");
    CHECK(request.signature.empty());
  }
  for (const char* url : {"s3://", "s3://bucket", "s3://bucket/", "s3:///key", "s3://a?/key",
                          "s3://a@b/key", "s3://bucket/a/../key", "s3://bucket/./key"})
    CHECK_THROWS_AS(ptc::web_request(url), ptc::DataError);
}

TEST_CASE("url: other URLs are asked for as they are, with the user's authorities") {
  const Environment authorities({{"SSL_CERT_FILE", "mine.pem"}});
  const ptc::WebRequest request = ptc::web_request("https://host/a%20b?c=d");
  CHECK(request.url == "https://host/a%20b?c=d");
  CHECK(request.authorities == "mine.pem");
}
