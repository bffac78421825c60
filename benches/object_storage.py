"""Tables of a history in an object storage that fails: every tenth request is refused, cut off or broken, and the export is
killed at random moments. In the end the bucket must have exactly the files that an export to a folder has.

    pip install "moto[server]"
    cargo build --release --features object-storage
    python benches/object_storage.py ACTCHECK HISTORY [KILLS]

Prints the number of requests, failures and kills. Exits with 1 if a file is missing or differs.
"""

import http.client
import http.server
import os
import pathlib
import random
import socket
import subprocess
import sys
import tempfile
import threading
import time

import boto3
import botocore.exceptions

EVERY = 10
KILLS = 40
BUCKET = "actcheck"


def free_port():
    with socket.socket() as sock:
        sock.bind(("127.0.0.1", 0))
        return sock.getsockname()[1]


class Proxy(http.server.BaseHTTPRequestHandler):
    """Passes requests on, except every tenth."""

    protocol_version = "HTTP/1.1"
    storage = 0
    requests = 0
    failures = [0, 0, 0]
    lock = threading.Lock()

    def log_message(self, *_):
        pass

    def any(self):
        with Proxy.lock:
            Proxy.requests += 1
            number = Proxy.requests
        body = self.rfile.read(int(self.headers.get("Content-Length", 0)))
        kind = None if number % EVERY else number // EVERY % 3
        if kind is not None:
            Proxy.failures[kind] += 1
        if kind == 0:
            self.send_response(503)
            self.send_header("Content-Length", "0")
            self.end_headers()
            return
        if kind == 1:
            self.close_connection = True
            self.connection.shutdown(socket.SHUT_RDWR)
            return
        upstream = http.client.HTTPConnection("127.0.0.1", Proxy.storage)
        # The signature covers the name of the host: it is passed on as it was.
        upstream.request(self.command, self.path, body, dict(self.headers))
        answer = upstream.getresponse()
        content = answer.read()
        self.send_response(answer.status)
        for name, value in answer.getheaders():
            if name.lower() not in ("content-length", "transfer-encoding", "connection"):
                self.send_header(name, value)
        self.send_header("Content-Length", str(len(content)))
        self.end_headers()
        if kind == 2:
            # The storage has done it, but the client does not hear so.
            self.wfile.write(content[: len(content) // 2])
            self.wfile.flush()
            self.close_connection = True
            self.connection.shutdown(socket.SHUT_RDWR)
            return
        if self.command != "HEAD":
            self.wfile.write(content)

    do_GET = do_PUT = do_POST = do_DELETE = do_HEAD = any


class Quiet(http.server.ThreadingHTTPServer):
    """Prints nothing if a client was killed in the middle of a request."""

    def handle_error(self, request, client_address):
        if not isinstance(sys.exc_info()[1], OSError):
            super().handle_error(request, client_address)


def client(port):
    """A client that asks the storage itself, without the proxy."""
    return boto3.client(
        "s3", endpoint_url=f"http://127.0.0.1:{port}", aws_access_key_id="key", aws_secret_access_key="secret",
        region_name="eu-central-1",
    )


def files_in_bucket(storage):
    """Name and content of each file."""
    found = {}
    for page in storage.get_paginator("list_objects_v2").paginate(Bucket=BUCKET):
        for entry in page.get("Contents", []):
            content = storage.get_object(Bucket=BUCKET, Key=entry["Key"])["Body"].read()
            found[entry["Key"].removeprefix("tables/")] = content
    return found


def main():
    actcheck, history = sys.argv[1:3]
    kills = int(sys.argv[3]) if len(sys.argv) > 3 else KILLS
    Proxy.storage = free_port()
    storage = subprocess.Popen(
        [str(pathlib.Path(sys.executable).with_name("moto_server")), "-p", str(Proxy.storage)],
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )
    try:
        direct = client(Proxy.storage)
        for _ in range(100):
            try:
                direct.create_bucket(Bucket=BUCKET, CreateBucketConfiguration={"LocationConstraint": "eu-central-1"})
                break
            except botocore.exceptions.EndpointConnectionError:
                time.sleep(0.2)
        proxy = Quiet(("127.0.0.1", 0), Proxy)
        threading.Thread(target=proxy.serve_forever, daemon=True).start()
        env = os.environ | {
            "AWS_ENDPOINT_URL": f"http://127.0.0.1:{proxy.server_port}",
            "AWS_ACCESS_KEY_ID": "key", "AWS_SECRET_ACCESS_KEY": "secret", "AWS_REGION": "eu-central-1",
        }
        command = [actcheck, "export", "--tables", f"s3://{BUCKET}/tables", "--history", history]
        with tempfile.TemporaryDirectory() as folder:
            subprocess.run([actcheck, "export", "--tables", folder, "--history", history], check=True)
            wanted = {
                str(path.relative_to(folder)): path.read_bytes()
                for path in pathlib.Path(folder).rglob("*") if path.is_file()
            }
        generator, killed, codes = random.Random(1), 0, []
        start = time.monotonic()
        longest = 0.5
        while killed < kills:
            process = subprocess.Popen(command, env=env, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
            started = time.monotonic()
            try:
                process.wait(generator.uniform(0, longest))
                codes.append(process.returncode)
                if process.returncode:
                    print(process.stderr.read().decode(), end="")
                # It was done before the kill: begin again with an empty bucket, and kill earlier.
                longest = max(0.05, 0.8 * (time.monotonic() - started))
                for name in files_in_bucket(direct):
                    direct.delete_object(Bucket=BUCKET, Key=f"tables/{name}")
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
                killed += 1
                longest *= 1.1
        last = subprocess.run(command, env=env, capture_output=True, text=True)
        codes.append(last.returncode)
        found = files_in_bucket(direct)
        print(last.stdout + last.stderr, end="")
        failed = ", ".join(f"{count} {kind}" for count, kind in zip(Proxy.failures, ["refused", "cut off", "cut off in the answer"]))
        print(f"{killed} kills, {len(codes)} exports ended (codes {sorted(set(codes))}) in {time.monotonic() - start:.0f} s")
        print(f"{Proxy.requests} requests, {failed}")
        missing = sorted(wanted.keys() - found.keys())
        more = sorted(found.keys() - wanted.keys())
        different = sorted(name for name in wanted.keys() & found.keys() if wanted[name] != found[name])
        print(f"{len(wanted)} files wanted, {len(found)} found: {len(missing)} missing, {len(more)} more, {len(different)} different")
        sys.exit(bool(missing or more or different or set(codes) != {0}))
    finally:
        storage.kill()


if __name__ == "__main__":
    main()
