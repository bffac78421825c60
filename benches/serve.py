#!/usr/bin/env python3
"""How many requests per second does `actcheck serve` answer, compared with oxigraph's server on the same statements?

    python3 benches/serve.py HISTORY --actcheck target/release/actcheck --oxigraph ~/.cargo/bin/oxigraph

Both servers run at the same time, on a copy of the history and on its export; the load generator `wrk` (Debian: `apt-get install wrk`) asks one
after the other, several times, on 127.0.0.1. Printed for 1, 16 and 64 connections: the median of the ratios of the rates (actcheck
over oxigraph), the median rates, 50th and 99th percentiles, the processor time for each request, and the number of refused
requests. Afterwards come the servers' memory before and after the load, and the times of queries that are not light, with and
without light ones beside them. The servers and `wrk` share the processors, so only the ratios mean something.
`cargo install oxigraph-cli --locked` installs the peer.
"""

import argparse
import os
import re
import shutil
import statistics
import subprocess
import tempfile
import threading
import time
import urllib.parse
import urllib.request
from pathlib import Path

ACT = "http://actions#"
QUERIES = {
    "ASK": f"ASK {{ ?run a <{ACT}Run> }}",
    "SELECT": f"SELECT ?run ?index {{ ?run a <{ACT}Run> ; <{ACT}index> ?index }} LIMIT 10",
}
HEAVY = f"SELECT (COUNT(DISTINCT CONCAT(STR(?run), STR(?p), STR(?o))) AS ?n) {{ ?run a <{ACT}Run> ; ?p ?o }}"
CONNECTIONS = (1, 16, 64)
UNITS = {"us": 1e-3, "ms": 1, "s": 1e3}


def rate(url, connections, seconds):
    """Answered requests per second, percentiles 50 and 99 in ms, and responses other than 2xx and 3xx."""
    command = ["wrk", "-t1", f"-c{connections}", f"-d{seconds}s", "--timeout", "60s", "--latency", url]
    text = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    times = [re.search(rf"{share}%\s+([\d.]+)(us|ms|s)", text).groups() for share in (50, 99)]
    p50, p99 = [float(value) * UNITS[unit] for value, unit in times]
    refused = re.search(r"Non-2xx or 3xx responses: (\d+)", text)
    refused = int(refused[1]) if refused else 0
    failed = re.search(r"Socket errors: connect (\d+), read (\d+), write (\d+), timeout (\d+)", text)
    refused += sum(map(int, failed.groups())) if failed else 0
    answered = int(re.search(r"(\d+) requests in", text)[1]) - refused
    return answered / seconds, p50, p99, refused


def processor_ms(process):
    fields = Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) * 1000 / os.sysconf("SC_CLK_TCK")


def memory_mb(process):
    return int(re.search(r"VmRSS:\s+(\d+)", Path(f"/proc/{process}/status").read_text())[1]) / 1024


def wait_for(url):
    for _ in range(200):
        try:
            with urllib.request.urlopen(url, timeout=60) as answer:
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
        exported = str(Path(folder, "all.nq"))
        subprocess.run([given.actcheck, "export", "rdf", exported, "--history", str(ours)], check=True)
        subprocess.run([given.oxigraph, "load", "--location", str(theirs), "--file", exported], check=True)
        servers = {
            "actcheck": (7978, [given.actcheck, "serve", "--port", "7978", "--history", str(ours)], "sparql"),
            "oxigraph": (7979, [given.oxigraph, "serve-read-only", "--location", str(theirs), "--bind", "127.0.0.1:7979"], "query"),
        }
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        started = [subprocess.Popen(command, **quiet) for _, command, _ in servers.values()]
        try:
            measure(servers, [process.pid for process in started], given)
        finally:
            for process in started:
                process.terminate()
                process.wait()


def measure(servers, processes, given):
    def address(server, query):
        port, _, path = servers[server]
        return f"http://127.0.0.1:{port}/{path}?{urllib.parse.urlencode({'query': query})}"

    for server in servers:
        for query in QUERIES.values():
            wait_for(address(server, query))
    before = [memory_mb(process) for process in processes]
    for name, query in QUERIES.items():
        compare(name, [address(server, query) for server in servers], processes, given)
    after = [memory_mb(process) for process in processes]
    for server, start, end in zip(servers, before, after):
        print(f"memory of {server}: {start:.0f} MB before, {end:.0f} MB after")
    heavy(address("actcheck", HEAVY), address("actcheck", QUERIES["ASK"]), given)


def compare(name, urls, processes, given):
    print(f"\n{name}: actcheck / oxigraph")
    print("| connections | ratio | req/s | p50 ms | p99 ms | CPU µs a request | refused |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    for connections in CONNECTIONS:
        rounds = []
        for _ in range(given.rounds):
            pair = []
            for url, process in zip(urls, processes):
                used = processor_ms(process)
                measured = rate(url, connections, given.seconds)
                used = processor_ms(process) - used
                pair.append((*measured, 1000 * used / max(1, measured[0] * given.seconds)))
            rounds.append(pair)
        ratio = statistics.median(ours[0] / theirs[0] for ours, theirs in rounds)
        middle = [[statistics.median(pair[side][figure] for pair in rounds) for side in (0, 1)] for figure in range(5)]
        shown = [f"{ours:.{digits}f} / {theirs:.{digits}f}" for (ours, theirs), digits in zip(middle, (0, 2, 2, 0, 0))]
        refused = " / ".join(str(sum(pair[side][3] for pair in rounds)) for side in (0, 1))
        print(f"| {connections} | {ratio:.2f} | {shown[0]} | {shown[1]} | {shown[2]} | {shown[4]} | {refused} |", flush=True)


def heavy(url, light, given):
    """64 clients ask a query that is not light; then they do so beside 16 that ask light ones."""
    wait_for(url)
    print("\nqueries that are not light, 64 connections")
    for beside in (False, True):
        lights = []
        thread = threading.Thread(target=lambda: lights.append(rate(light, 16, 4 * given.seconds)))
        if beside:
            thread.start()
        answered, p50, p99, refused = rate(url, 64, 4 * given.seconds)
        if beside:
            thread.join()
        print(f"{'beside light ones' if beside else 'alone'}: {answered:.0f} req/s, p50 {p50:.0f} ms, p99 {p99:.0f} ms, refused {refused}")
    answered, p50, p99, refused = lights[0]
    print(f"light ones beside them, 16 connections: {answered:.0f} req/s, p50 {p50:.1f} ms, p99 {p99:.1f} ms, refused {refused}")


if __name__ == "__main__":
    main()
