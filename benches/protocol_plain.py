"""The idle controller of `benches/protocol.rs` with only Python's standard library."""

import os
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests/protocol"))
from wire import serve


def perform(link, begin):
    ticks, total = int(os.environ["TICKS"]), int(os.environ["TOTAL"])
    began = time.process_time()
    for _ in range(total // ticks):
        link.ask({"type": "command", "ticks": ticks})
    return {"type": "end", "succeeded": True, "message": str(time.process_time() - began)}


serve(perform)
