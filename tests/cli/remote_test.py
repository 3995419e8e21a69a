"""Containers on a server, read by URL: the same results as from a file, and a clear error where the net fails."""

import base64
import json
import os
import resource
import shutil
import ssl
import struct
import subprocess
import time
import unittest

from programs import SMALL_PICTURE, ProgramTest, run
from range_server import RangeServer

BLOCK = 1 << 20
HERE = {name: value for name, value in os.environ.items() if not name.startswith(("AWS_", "CURL_", "SSL_"))}
HERE["no_proxy"] = "127.0.0.1"


class Remote(ProgramTest):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        folder = cls.served = os.path.join(cls.fixture.name, "served")
        os.mkdir(folder)
        made = run("ptcbuild", "--city", "1M", "-o", folder + "/city.ptcx")
        assert made.returncode == 0, made.stderr
        shutil.copy(os.path.join(cls.fixture.name, "ball.ptcx"), folder)

    def setUp(self):
        super().setUp()
        self.server = self.enterContext(RangeServer(self.served))
        self.city, self.url = os.path.join(self.served, "city.ptcx"), self.server.url + "/city.ptcx"

    def ask(self, program, *arguments, **environment):
        return self.succeed(program, *arguments, env={**HERE, **environment})

    def refused(self, code, program, *arguments, **environment):
        return self.fail_with(code, program, *arguments, env={**HERE, **environment})

    def facts(self, file, **environment):
        """What ptcinfo tells of a file, but for what the run took."""
        facts = json.loads(self.ask("ptcinfo", file, "--json", **environment).stdout)
        return {key: value for key, value in facts.items() if key not in ("file", "peak_resident_bytes", "cpu_seconds")}

    def test_programs_give_what_they_give_for_the_file(self):
        self.assertEqual(self.facts(self.url), self.facts(self.city))
        self.assertEqual(self.ask("ptcinfo", self.url, "--why").stdout,
                         self.succeed("ptcinfo", self.city, "--why").stdout.replace(self.city, self.url))
        for level in "123":
            found = json.loads(self.ask("ptcverify", self.url, "--level", level, "--json").stdout.splitlines()[-1])
            self.assertEqual(found["file"], self.url)
        for program, output, options in (("ptcshade", "lit.ply", ["--count", "500"]),
                                         ("ptcrender", "seen.exr", SMALL_PICTURE), ("ptcconvert", "copy.ply", [])):
            for scene, prefix in ((self.city, "file-"), (self.url, "url-")):
                self.ask(program, scene, *([self.here / (prefix + output)] if program == "ptcconvert" else
                                           ["-o", self.here / (prefix + output)]), *options)
            self.assertEqual((self.here / ("url-" + output)).read_bytes(), (self.here / ("file-" + output)).read_bytes())

    def test_little_is_read_to_tell_what_a_container_is(self):
        self.assertGreater(os.path.getsize(self.city), 8 * BLOCK)
        self.ask("ptcinfo", self.url)
        self.assertLessEqual(len(self.server.requests), 8)
        self.assertLess(self.server.bytes(), os.path.getsize(self.city) / 2)

    def test_a_whole_file_is_asked_for_once_in_growing_ranges(self):
        self.ask("ptcverify", self.url, "--level", "3", "--memory", "256M")
        size = os.path.getsize(self.city)
        self.assertLess(len(self.server.requests), 10 + size / BLOCK / 2)
        self.assertLess(self.server.bytes(), 2 * size)
        self.assertGreater(max(last - first + 1 for _, first, last in self.server.requests), 2 * BLOCK)

    def test_parts_lie_beside_their_scene(self):
        plan = os.path.join(self.served, "town.json")
        self.succeed("ptcfarm", "plan", "--city", "20k", "--parts", "3", "-o", plan)
        self.succeed("ptcfarm", "run", plan)
        scene = os.path.join(self.served, "town.ptcx")
        expected, found = self.facts(scene), self.facts(self.server.url + "/town.ptcx?key=a/b")
        for part in expected["parts"]:
            part["file"] = part["file"].replace(self.served, self.server.url) + "?key=a/b"
        self.assertEqual(found, expected)
        self.assertIn("valid at level 3", self.ask("ptcverify", self.server.url + "/town.ptcx").stdout)
        os.remove(os.path.join(self.served, "town.parts/1.ptcx"))
        message = self.refused(1, "ptcinfo", self.server.url + "/town.ptcx")
        self.assertIn("/town.parts/1.ptcx: offset 0: is not the part", message)
        self.assertIn("there is no such file", message)

    def test_all_threads_share_what_has_come(self):
        options = ["--count", "500", "--threads", "8", "-o"]
        self.ask("ptcshade", self.url, *options, self.here / "url.ply")
        self.assertEqual(len(self.server.requests), len(set(self.server.requests)) + 1)  # one sees that it is the same
        self.succeed("ptcshade", self.city, *options, self.here / "file.ply")
        self.assertEqual((self.here / "url.ply").read_bytes(), (self.here / "file.ply").read_bytes())

    def test_a_full_disk_makes_it_slower_and_no_different(self):
        expected = self.succeed("ptcverify", self.city).stdout.split(",")[:4]

        def limit():
            resource.setrlimit(resource.RLIMIT_FSIZE, (3 * BLOCK, 3 * BLOCK))

        for environment, options in (({"TMPDIR": "/nonexistent"}, {}), ({}, {"preexec_fn": limit})):
            self.server.requests.clear()
            found = self.succeed("ptcverify", self.url, env={**HERE, **environment}, **options)
            self.assertEqual(found.stdout.replace(self.url, self.city).split(",")[:4], expected)
            self.assertGreater(self.server.bytes(), os.path.getsize(self.city))

    def test_the_cap_counts_what_reading_takes(self):
        message = self.refused(5, "ptcshade", self.url, "-o", self.here / "o.ply", "--memory", "1M")
        self.assertIn("16M for what comes from servers", message)
        self.assertNotIn("servers", self.refused(5, "ptcshade", self.city, "-o", self.here / "o.ply", "--memory", "1M"))
        facts = json.loads(self.ask("ptcinfo", self.url, "--json").stdout)
        beside = json.loads(self.succeed("ptcinfo", self.city, "--json").stdout)
        self.assertLess(facts["peak_resident_bytes"] - beside["peak_resident_bytes"], 16 << 20)

    def test_clouds_and_meshes_come_with_the_files_that_they_name(self):
        shutil.copy(self.cloud, self.served)
        folder = os.path.join(self.served, "a mesh")
        os.makedirs(folder, exist_ok=True)
        corners = struct.pack("<9f3H", 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 1, 2)
        document = {"asset": {"version": "2.0"}, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
                    "buffers": [{"uri": "the%20corners.bin", "byteLength": len(corners)}],
                    "bufferViews": [{"buffer": 0, "byteLength": 36}, {"buffer": 0, "byteOffset": 36, "byteLength": 6}],
                    "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3",
                                   "min": [0, 0, 0], "max": [1, 1, 0]},
                                  {"bufferView": 1, "componentType": 5123, "count": 3, "type": "SCALAR"}],
                    "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}]}
        files = {"the corners.bin": corners, "triangle.gltf": json.dumps(document).encode(),
                 "room.obj": b"mtllib the colours.mtl\nusemtl red\n" + self.mesh.read_bytes(),
                 "the colours.mtl": b"newmtl red\nKd 0.8 0.1 0.1\n"}
        for name, content in files.items():
            with open(os.path.join(folder, name), "wb") as file:
                file.write(content)
        for name in ("ball.ply", "a mesh/triangle.gltf", "a mesh/room.obj"):
            for source, output in ((os.path.join(self.served, name), "file.ply"),
                                   (f"{self.server.url}/{name.replace(' ', '%20')}", "url.ply")):
                self.ask("ptcbuild", source, "--points", "2k", "-o", self.here / "o.ptcx")
                self.ask("ptcconvert", self.here / "o.ptcx", self.here / output)
            self.assertEqual((self.here / "url.ply").read_bytes(), (self.here / "file.ply").read_bytes(), name)
        self.ask("ptcbuild", self.server.url + "/ball.ply", "--resume", "-o", self.here / "o.ptcx")
        self.assertIn("a plan takes files that all machines see, and no URL",
                      self.refused(1, "ptcfarm", "plan", self.server.url + "/ball.ply", "-o", self.here / "p.json"))

    def test_proxies_and_passwords_are_those_of_the_user(self):
        os.makedirs(self.here / "home")
        (self.here / "home/.netrc").write_text("machine 127.0.0.1 login reader password secret\n")
        word = "Basic " + base64.b64encode(b"reader:secret").decode()
        self.server.fault = lambda handler, *_: handler.headers.get("Authorization") != word and RangeServer.status(
            handler, 401)
        self.ask("ptcinfo", self.url, HOME=str(self.here / "home"))
        self.assertIn("Permission denied", self.refused(1, "ptcinfo", self.url, HOME=str(self.here)))
        self.server.fault = None
        self.ask("ptcinfo", "http://nowhere.invalid/city.ptcx", http_proxy=self.server.url)

    def test_failures_that_pass_are_tried_again(self):
        expected = self.facts(self.city)

        def broken_off(handler, number, path, first, last):
            """Sends a fifth of each second answer."""
            if number % 2 == 0:
                return False
            handler.wfile.write(self.head(first, last) + self.city_bytes(first, last)[:(last - first) // 5])
            handler.close_connection = True
            return True

        def unavailable(handler, number, *_):
            return number % 3 != 0 and RangeServer.status(handler, 503 if number % 3 == 1 else 429)

        def hung_up(handler, number, *_):
            handler.close_connection = number % 2 == 1
            return handler.close_connection

        def half_a_head(handler, number, path, first, last):
            if number % 2 == 0:
                return False
            handler.wfile.write(self.head(first, last)[:60])
            handler.close_connection = True
            return True

        for fault in (broken_off, unavailable, hung_up, half_a_head):
            self.server.requests.clear()
            self.server.fault = fault
            self.assertEqual(self.facts(self.url), expected, fault)
        asked = [request for request in self.server.requests if request[1] > 0]
        self.assertGreater(len(asked), len(set(asked)))

    def test_what_came_before_an_answer_broke_off_is_kept(self):
        def broken_off(handler, number, path, first, last):
            handler.wfile.write(self.head(first, last) + self.city_bytes(first, last)[:100000])
            handler.close_connection = True
            return True

        self.server.fault = broken_off
        self.ask("ptcinfo", self.url)
        first, second = self.server.requests[:2]
        self.assertEqual((first[1:], second[1:]), ((0, BLOCK - 1), (100000, BLOCK - 1)))

    def city_bytes(self, first, last):
        with open(self.city, "rb") as file:
            file.seek(first)
            return file.read(last - first + 1)

    def head(self, first, last):
        """The head of the right answer."""
        status = os.stat(self.city)
        last = min(last, status.st_size - 1)
        return (f"HTTP/1.1 206 Partial Content\r\nContent-Range: bytes {first}-{last}/{status.st_size}\r\n"
                f"Content-Length: {last - first + 1}\r\nETag: \"{status.st_size}-{status.st_mtime_ns}\"\r\n\r\n").encode()

    def test_a_server_that_stays_away_is_given_up(self):
        self.server.fault = lambda handler, *_: RangeServer.status(handler, 503)
        began = time.monotonic()
        self.assertIn(f"get {self.url}: the server answers with status 503, 5 times",
                      self.refused(3, "ptcinfo", self.url))
        self.assertEqual(len(self.server.requests), 5)
        self.assertGreater(time.monotonic() - began, 2.9)
        self.server.http.shutdown()
        self.server.http.server_close()
        self.assertIn("Failed to connect", self.refused(3, "ptcinfo", self.url))
        self.server = self.enterContext(RangeServer(self.served))

    def test_a_server_says_how_long_to_wait(self):
        self.server.fault = lambda handler, number, *_: number == 1 and RangeServer.status(handler, 503, Retry_After="2")
        began = time.monotonic()
        self.ask("ptcinfo", self.url)
        self.assertGreater(time.monotonic() - began, 2)

    def test_errors_name_the_url_and_the_rule(self):
        for status, code, text in ((404, 1, "No such file or directory"), (403, 1, "Permission denied"),
                                   (410, 1, "No such file or directory"), (401, 1, "Permission denied"),
                                   (418, 3, "the server answers with status 418")):
            self.server.fault = lambda handler, *_: RangeServer.status(handler, status)
            message = self.refused(code, "ptcinfo", self.url)
            self.assertIn(self.url + ": ", message)
            self.assertIn(text, message)
        self.server.fault = lambda handler, number, path, *_: self.server.send(handler, self.server.folder / path, 0, 99, 200)
        self.assertIn("the server does not answer requests for ranges", self.refused(1, "ptcinfo", self.url))
        for changes, text in (({"Content-Range": "bytes 5-10/100"}, "another range"),
                              ({"Content-Range": "none"}, "does not tell the range"),
                              ({"Content-Encoding": "gzip"}, "sends the file encoded as gzip")):
            self.server.fault = lambda handler, number, path, first, last: self.server.send(
                handler, self.server.folder / path, first, min(last, os.path.getsize(self.city) - 1), **changes)
            self.assertIn(text, self.refused(1, "ptcinfo", self.url))
        self.server.fault = None
        for url in ("s3://127.0.0.1:1?/x", "s3://a#b/x", "s3://a@b/x", "s3://bucket/a/../b", "s3://bucket/./b"):
            self.assertIn("s3://", self.refused(1, "ptcinfo", url))
        self.assertIn("a URL of S3 has the form s3://BUCKET/KEY", self.refused(1, "ptcinfo", "s3://bucket"))
        self.assertIn("format", self.refused(1, "ptcinfo", "http://a b/c.ptcx"))
        self.assertIn("Operation not supported",
                      self.refused(3, "ptcshade", self.url, "-o", self.here / "out.ply", "--io", "mmap"))

    def test_a_file_that_changes_while_it_is_read_is_refused(self):
        def changed(handler, number, path, first, last):
            self.server.version = f'"{number > 3}"'
            return False

        self.server.fault = changed
        message = self.refused(1, "ptcverify", self.url)
        self.assertIn(f"{self.url}: the file has changed since it was opened", message)

    def test_damage_on_the_way_is_found(self):
        def flipped(handler, number, path, first, last):
            if first == 0:
                return False
            body = bytearray(self.city_bytes(first, last))
            for i in range(0, len(body), 997):
                body[i] ^= 16
            handler.wfile.write(self.head(first, last) + body)
            return True

        self.server.fault = flipped
        message = self.refused(1, "ptcshade", self.url, "-o", self.here / "out.ply")
        self.assertRegex(message, f"{self.url}: offset [0-9]+: .*spec/container.md#")

    def test_an_empty_file_and_one_that_is_no_container_are_told(self):
        for name, content, text in (("empty.ptcx", b"", "the file is empty"), ("empty.ply", b"", "the file is empty"), ("short.ptcx", self.city_bytes(0, 99), "header-length"),
                                    ("other.ptcx", b"x" * 9000, "header-magic")):
            with open(os.path.join(self.served, name), "wb") as file:
                file.write(content)
            self.assertIn(text, self.refused(1, "ptcinfo", f"{self.server.url}/{name}"))

    def test_nothing_is_written_to_a_url(self):
        self.assertIn("Read-only file system", self.refused(3, "ptcconvert", self.scene, self.server.url + "/new.ptcx"))
        self.assertIn("Read-only file system", self.refused(3, "ptcshade", self.scene, "-o", self.server.url + "/a.ply"))

    def test_what_a_server_says_is_not_believed(self):
        for total in (2 ** 64 - 1, 2 ** 63, 2 ** 55, 2 ** 42 + 1):
            self.server.fault = lambda handler, number, path, first, last: self.server.send(
                handler, self.server.folder / path, first, last, **{"Content-Range": f"bytes {first}-{last}/{total}"})
            self.assertIn(f"the server says that the file has {total} bytes; 4 TiB can be read",
                          self.refused(1, "ptcinfo", self.url))

    def test_one_thread_that_gives_up_is_enough(self):
        self.server.fault = lambda handler, number, *_: number > 4 and RangeServer.status(handler, 503)
        began = time.monotonic()
        self.assertIn("status 503, 5 times", self.refused(3, "ptcverify", self.url, "--threads", "8"))
        self.assertLess(time.monotonic() - began, 15)
        self.assertLess(len(self.server.requests), 4 + 8 * 5)

    def test_a_file_that_goes_or_is_closed_while_it_is_read_is_refused(self):
        for status, text in ((404, "has gone"), (403, "has been closed to you")):
            self.server.requests.clear()
            self.server.fault = lambda handler, number, *_: number > 4 and RangeServer.status(handler, status)
            self.assertIn(f"{self.url}: the server answers with status {status}: the file {text} since it was opened",
                          self.refused(1, "ptcverify", self.url))

    def test_servers_may_send_less_than_was_asked_for(self):
        expected = self.facts(self.city)
        self.server.fault = lambda handler, number, path, first, last: self.server.send(
            handler, self.server.folder / path, first, min(last, first + 99999, os.path.getsize(self.city) - 1))
        began = time.monotonic()
        self.assertEqual(self.facts(self.url), expected)
        self.assertLess(time.monotonic() - began, 5)

    def test_a_server_without_versions_is_read_anew(self):
        self.server.version = ""
        self.assertEqual(self.facts(self.url), self.facts(self.city))
        self.assertNotIn(0, [last for _, _, last in self.server.requests])

    def test_a_token_is_for_one_server(self):
        with RangeServer(self.served) as other:
            seen = []
            other.fault = lambda handler, *_: seen.append(handler.headers.get("x-amz-security-token"))
            self.server.fault = lambda handler, *_: RangeServer.status(handler, 307, Location=other.url + "/city.ptcx")
            keys = {"AWS_ENDPOINT_URL": self.server.url, "AWS_ACCESS_KEY_ID": "id", "AWS_SECRET_ACCESS_KEY": "secret",
                    "AWS_SESSION_TOKEN": "token"}
            self.assertIn("status 307", self.refused(3, "ptcinfo", "s3://bucket/city.ptcx", **keys))
            self.assertEqual(seen, [])
            self.ask("ptcinfo", self.url)  # without a signature it is followed
            self.assertGreater(len(seen), 0)

    def test_queries_do_not_get_into_files(self):
        shutil.copy(self.cloud, self.served)
        self.ask("ptcbuild", self.server.url + "/ball.ply?signature=se.cret", "-o", self.here / "o.ptcx")
        self.assertNotIn(b"cret", (self.here / "o.ptcx").read_bytes())
        self.assertEqual(json.loads(self.succeed("ptcinfo", self.here / "o.ptcx", "--json").stdout)["text"]["inputs"],
                         "ball.ply")

    def test_a_texture_that_the_net_keeps_back_is_not_left_out(self):
        with open(os.path.join(self.served, "tile.obj"), "w") as mesh:
            mesh.write("mtllib tile.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl a\nf 1/1 2/2 3/3\n")
        with open(os.path.join(self.served, "tile.mtl"), "w") as library:
            library.write("newmtl a\nmap_Kd tile.png\n")
        for status, code in ((503, 3), (404, 0)):
            self.server.fault = lambda handler, number, path, *_: path == "tile.png" and RangeServer.status(handler, status)
            done = run("ptcbuild", self.server.url + "/tile.obj", "--points", "1k", "-o", self.here / "o.ptcx", env=HERE)
            self.assertEqual(done.returncode, code, done.stderr)
            self.assertIn("tile.png", done.stderr)

    def test_redirections_are_followed(self):
        self.server.fault = lambda handler, number, path, *_: path.startswith("old") and RangeServer.status(
            handler, 302, Location=self.url)
        url = self.server.url + "/old.ptcx"
        self.assertEqual(self.facts(url), self.facts(self.city))
        self.server.fault = lambda handler, *_: RangeServer.status(handler, 302, Location="file:///etc/passwd")
        self.assertIn("Protocol", self.refused(1, "ptcinfo", url))

    def test_objects_of_s3_are_asked_for_with_a_signature(self):
        os.makedirs(os.path.join(self.served, "bucket/a folder"), exist_ok=True)
        shutil.copy(self.city, os.path.join(self.served, "bucket/a folder/city+1.ptcx"))
        url = "s3://bucket/a folder/city+1.ptcx"
        self.server.keys = {"AKIDEXAMPLE": "secret/of+the=user"}
        keys = {"AWS_ENDPOINT_URL": self.server.url + "/", "AWS_ACCESS_KEY_ID": "AKIDEXAMPLE",
                "AWS_SECRET_ACCESS_KEY": "secret/of+the=user", "AWS_REGION": "eu-central-1"}
        self.assertEqual(self.facts(url, **keys), self.facts(self.city))
        self.ask("ptcinfo", url, **keys, AWS_SESSION_TOKEN="token+of/a=session")
        self.assertIn("Permission denied", self.refused(1, "ptcinfo", url, **{**keys, "AWS_SECRET_ACCESS_KEY": "other"}))
        self.assertIn("Permission denied", self.refused(1, "ptcinfo", url, AWS_ENDPOINT_URL=self.server.url))
        self.server.keys = {}
        self.ask("ptcinfo", url, AWS_ENDPOINT_URL=self.server.url)  # a public object

    @unittest.skipUnless(shutil.which("openssl"), "needs openssl to make a certificate")
    def test_certificates_are_checked(self):
        key, certificate = self.here / "key.pem", self.here / "certificate.pem"
        subprocess.run(["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-keyout", key, "-out", certificate,
                        "-days", "2", "-subj", "/CN=127.0.0.1", "-addext", "subjectAltName=IP:127.0.0.1"],
                       check=True, capture_output=True)
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        context.load_cert_chain(certificate, key)
        server = RangeServer(self.served)
        server.http.socket = context.wrap_socket(server.http.socket, server_side=True)
        url = server.url.replace("http:", "https:") + "/city.ptcx"
        with server:
            self.assertIn("certificate", self.refused(3, "ptcinfo", url))
            self.ask("ptcinfo", url, SSL_CERT_FILE=str(certificate))

    def test_without_the_library_files_are_read_and_urls_refused(self):
        (self.here / "none").mkdir()
        (self.here / "none/libcurl.so.4").touch()
        without = {"LD_LIBRARY_PATH": str(self.here / "none")}
        self.ask("ptcinfo", self.city, **without)
        self.assertIn("to read URLs takes libcurl, Debian's package libcurl4",
                      self.refused(3, "ptcinfo", self.url, **without))


if __name__ == "__main__":
    unittest.main()
