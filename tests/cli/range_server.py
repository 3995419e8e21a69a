"""A web server that answers requests for ranges of bytes, and fails as it is told to.

    python3 range_server.py FOLDER [--port N] [--delay SECONDS] [--rate BYTES_PER_SECOND]

serves a folder on this machine, each answer after a delay and no faster than the rate, and prints how many requests
there were when it is stopped.
"""

import argparse
import hashlib
import hmac
import http.server
import re
import threading
import time
import urllib.parse
from pathlib import Path


class RangeServer:
    """Serves a folder. Each request is told to `fault`, if one is set, which may answer in place of the server."""

    def __init__(self, folder, port=0, delay=0.0, rate=0.0):
        self.folder, self.delay, self.rate = Path(folder), delay, rate
        self.requests = []  # path, first and last byte
        self.fault = None  # fault(handler, number of the request, path, first, last): returns whether it has answered
        self.version = None  # ETag in place of the file's
        self.keys = {}  # secrets of S3, by id: then each request has to be signed
        self.lock = threading.Lock()
        server = self

        class Handler(http.server.BaseHTTPRequestHandler):
            protocol_version = "HTTP/1.1"
            disable_nagle_algorithm = True

            def log_message(self, *arguments):
                pass

            def do_GET(self):
                server.answer(self)

        self.http = http.server.ThreadingHTTPServer(("127.0.0.1", port), Handler)
        self.http.daemon_threads = True
        self.http.handle_error = lambda *_: None  # clients go when they have what they need
        self.url = f"http://127.0.0.1:{self.http.server_port}"
        self.thread = threading.Thread(target=self.http.serve_forever, daemon=True)

    def __enter__(self):
        self.thread.start()
        return self

    def __exit__(self, *_):
        self.http.shutdown()
        self.http.server_close()

    def bytes(self):
        return sum(last - first + 1 for _, first, last in self.requests)

    @staticmethod
    def status(handler, code, **headers):
        """Answers with a status and no body."""
        handler.send_response(code)
        for name, value in headers.items():
            handler.send_header(name.replace("_", "-"), value)
        handler.send_header("Content-Length", "0")
        handler.end_headers()
        return True

    def answer(self, handler):
        path = urllib.parse.unquote(urllib.parse.urlsplit(handler.path).path).lstrip("/")  # a proxy gets whole URLs
        wanted = re.fullmatch(r"bytes=(\d+)-(\d+)", handler.headers.get("Range", ""))
        first, last = map(int, wanted.groups()) if wanted else (0, 0)
        with self.lock:
            self.requests.append((path, first, last))
            number = len(self.requests)
        time.sleep(self.delay)
        if self.fault and self.fault(handler, number, path, first, last):
            return
        if self.keys and not self.is_signed(handler):
            self.status(handler, 403)
            return
        file = self.folder / path
        if not file.is_file():
            self.status(handler, 404)
            return
        size = file.stat().st_size
        if not wanted:
            self.send(handler, file, 0, size - 1, 200)
            return
        if first >= size:
            self.status(handler, 416, Content_Range=f"bytes */{size}")
            return
        self.send(handler, file, first, min(last, size - 1))

    def send(self, handler, file, first, last, status=206, **changes):
        """Answers with a range of a file; `changes` are headers that differ from the right ones."""
        size = file.stat().st_size
        headers = {"Content-Range": f"bytes {first}-{last}/{size}", "Content-Length": str(last - first + 1),
                   "ETag": f'"{size}-{file.stat().st_mtime_ns}"' if self.version is None else self.version}
        headers.update({name.replace("_", "-"): value for name, value in changes.items()})
        handler.send_response(status)
        for name, value in headers.items():
            handler.send_header(name, value)
        handler.end_headers()
        with open(file, "rb") as source:
            source.seek(first)
            left = last - first + 1
            while left > 0:
                part = source.read(min(left, 65536))
                handler.wfile.write(part)
                left -= len(part)
                if self.rate:
                    time.sleep(len(part) / self.rate)
        return True

    def is_signed(self, handler):
        """Checks the signature of a request for S3 (AWS Signature Version 4), by its documentation."""
        form = (r"AWS4-HMAC-SHA256 Credential=([^/]+)/(\d{8})/([^/]+)/s3/aws4_request, ?SignedHeaders=([^,]+), ?"
                r"Signature=([0-9a-f]{64})")
        given = re.fullmatch(form, handler.headers.get("Authorization", ""))
        if not given or given[1] not in self.keys:
            return False
        key_id, day, region, names, signature = given.groups()
        payload = handler.headers.get("x-amz-content-sha256", hashlib.sha256(b"").hexdigest())
        lines = "".join(f"{name}:{' '.join(handler.headers[name].split())}\n" for name in names.split(";"))
        path, _, query = handler.path.partition("?")
        request = "\n".join(["GET", path, query, lines, names, payload])
        scope = f"{day}/{region}/s3/aws4_request"
        text = "\n".join(["AWS4-HMAC-SHA256", handler.headers["x-amz-date"], scope,
                          hashlib.sha256(request.encode()).hexdigest()])
        key = ("AWS4" + self.keys[key_id]).encode()
        for part in (day, region, "s3", "aws4_request"):
            key = hmac.new(key, part.encode(), hashlib.sha256).digest()
        signed = names.split(";")
        token = "x-amz-security-token" in signed or "x-amz-security-token" not in handler.headers
        return token and "host" in signed and "x-amz-date" in signed and hmac.compare_digest(
            signature, hmac.new(key, text.encode(), hashlib.sha256).hexdigest())


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("folder")
    parser.add_argument("--port", type=int, default=0)
    parser.add_argument("--delay", type=float, default=0)
    parser.add_argument("--rate", type=float, default=0)
    arguments = parser.parse_args()
    with RangeServer(arguments.folder, arguments.port, arguments.delay, arguments.rate) as server:
        print(server.url, flush=True)
        try:
            threading.Event().wait()
        except KeyboardInterrupt:
            print(f"{len(server.requests)} requests for {server.bytes()} bytes")


if __name__ == "__main__":
    main()
