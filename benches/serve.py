#!/usr/bin/env python3
"""How many requests per second does `actcheck serve` answer, compared with oxigraph's server on the same store?

    python3 benches/serve.py HISTORY --actcheck target/release/actcheck --oxigraph ~/.cargo/bin/oxigraph

Both servers run at the same time on copies of the history; the load generator `wrk` (Debian: `apt-get install wrk`) asks one
after the other, several times, on 127.0.0.1. Printed for 1, 16 and 64 connections: the median of the ratios of the rates (actcheck
over oxigraph), both median rates, the 99th percentiles, and the number of refused requests. The servers and `wrk` share the
processors, so only the ratios mean something. `cargo install oxigraph-cli --locked` installs the peer.
"""

import argparse
import re
import shutil
import statistics
import subprocess
import tempfile
import time
import urllib.parse
import urllib.request
from pathlib import Path

ACT = "http://actions#"
QUERIES = {
    "ASK": f"ASK {{ ?run a <{ACT}Run> }}",
    "SELECT": f"SELECT ?run ?index {{ ?run a <{ACT}Run> ; <{ACT}index> ?index }} LIMIT 10",
}
CONNECTIONS = (1, 16, 64)


def rate(url, connections, seconds):
    """Answered requests per second, 99th percentile in ms, and responses other than 2xx and 3xx."""
    command = ["wrk", "-t1", f"-c{connections}", f"-d{seconds}s", "--latency", url]
    text = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    value, unit = re.search(r"99%\s+([\d.]+)(us|ms|s)", text).groups()
    refused = re.search(r"Non-2xx or 3xx responses: (\d+)", text)
    refused = int(refused[1]) if refused else 0
    answered = int(re.search(r"(\d+) requests in", text)[1]) - refused
    return answered / seconds, float(value) * {"us": 1e-3, "ms": 1, "s": 1e3}[unit], refused


def wait_for(url):
    for _ in range(200):
        try:
            with urllib.request.urlopen(url, timeout=5) as answer:
                answer.read()
                return
        except OSError:
            time.sleep(0.05)
    raise SystemExit(f"{url} does not answer")


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("history", type=Path)
    arguments.add_argument("--actcheck", default="actcheck")
    arguments.add_argument("--oxigraph", default="oxigraph")
    arguments.add_argument("--rounds", type=int, default=3)
    arguments.add_argument("--seconds", type=int, default=3)
    given = arguments.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        ours, theirs = Path(folder, "ours"), Path(folder, "theirs")
        shutil.copytree(given.history, ours)
        shutil.copytree(given.history / "store", theirs)
        servers = {
            "actcheck": (7978, [given.actcheck, "serve", "--port", "7978", "--history", str(ours)], "sparql"),
            "oxigraph": (7979, [given.oxigraph, "serve-read-only", "--location", str(theirs), "--bind", "127.0.0.1:7979"], "query"),
        }
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        started = [subprocess.Popen(command, **quiet) for _, command, _ in servers.values()]
        try:
            compare(servers, given)
        finally:
            for process in started:
                process.terminate()
                process.wait()


def compare(servers, given):
    print("| query | connections | ratio | actcheck req/s | oxigraph req/s | p99 ms | its p99 ms | refused |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- |")
    for name, query in QUERIES.items():
        urls = {
            server: f"http://127.0.0.1:{port}/{path}?{urllib.parse.urlencode({'query': query})}"
            for server, (port, _, path) in servers.items()
        }
        for url in urls.values():
            wait_for(url)
        for connections in CONNECTIONS:
            pairs = [[rate(urls[server], connections, given.seconds) for server in servers] for _ in range(given.rounds)]
            ratio = statistics.median(ours[0] / theirs[0] for ours, theirs in pairs)
            middle = [[statistics.median(pair[side][figure] for pair in pairs) for figure in (0, 1)] for side in (0, 1)]
            refused = sum(ours[2] for ours, _ in pairs)
            (our_rate, our_p99), (their_rate, their_p99) = middle
            print(
                f"| {name} | {connections} | {ratio:.2f} | {our_rate:.0f} | {their_rate:.0f} "
                f"| {our_p99:.2f} | {their_p99:.2f} | {refused} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
