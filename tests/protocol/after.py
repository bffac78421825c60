"""Shows the fault that AFTER names after the end of an action: of each, or with AFTER_SEED of those with an odd seed."""

import os
import sys
import time

import wire


def main():
    kind, seeds = os.environ["AFTER"], "AFTER_SEED" in os.environ
    end = {"type": "end", "succeeded": True, "message": "did nothing"}
    link = wire.Link()
    link.receive()
    link.send({"type": "hello", "protocol": 1, "name": "after", "actions": ["Pick"]})
    run, acted = {}, False
    while True:
        message = link.receive()
        if message["type"] == "bye":
            return
        if message["type"] == "reset":
            run = message
            link.send({"type": "ready"})
            if kind == "exit when ready" and acted:
                sys.exit(0)
            continue
        acted = True
        link.send(end)
        if seeds and run["seed"] % 2 == 0:
            continue
        if kind == "exit":
            sys.exit(0)
        if kind == "late exit":
            time.sleep(0.1)
            sys.exit(0)
        if kind == "late message":
            time.sleep(0.05)
        if kind in ("second end", "late message"):
            link.send(end)
        if kind == "command":
            link.send({"type": "command", "ticks": 1})


main()
