"""Prints where a program is shortly before actcheck ends it because it has been silent for too long."""

from __future__ import annotations

import os
import sys
import threading
import time
import traceback
from collections.abc import Iterator
from contextlib import contextmanager

from actcheck.tracebacks import own_frames, place_of
from actcheck.wire import Wire

#: `[skill] timeout_s` of the campaign. Unit: seconds.
TIMEOUT = "ACTCHECK_TIMEOUT_S"
#: Share of the time limit after which a silent program is reported.
SHARE = 0.9


@contextmanager
def watched(wire: Wire) -> Iterator[None]:
    """While it is open, a thread prints the line of the caller's thread if this owes a message for nearly the time limit.

    The thread sleeps for the limit at a time, so that it costs a healthy program nothing.
    """
    if TIMEOUT not in os.environ:
        yield
        return
    limit_s = SHARE * float(os.environ[TIMEOUT])
    thread, ended = threading.get_ident(), threading.Event()

    def watch() -> None:
        reported, left_s = None, limit_s
        while not ended.wait(left_s):
            since = wire.answered_at
            if since is None or since == reported:
                left_s = limit_s
                continue
            left_s = since + limit_s - time.monotonic()
            if left_s <= 0.0:
                reported, left_s = since, limit_s
                _report(thread, limit_s)

    watcher = threading.Thread(target=watch, name="actcheck-silence", daemon=True)
    watcher.start()
    try:
        yield
    finally:
        ended.set()


def _report(thread: int, limit_s: float) -> None:
    frame = sys._current_frames().get(thread)
    if frame is None:
        return
    frames = own_frames(traceback.extract_stack(frame))
    place = f"; it is in {place_of(frames[-1])}: {frames[-1].line}" if frames else ""
    lines = ["Stack (most recent call last):\n", *traceback.format_list(frames)]
    print("".join(lines) + f"the program has sent no message for {limit_s:g} s{place}", file=sys.stderr, flush=True)
