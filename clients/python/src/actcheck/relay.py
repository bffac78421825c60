"""The program that actcheck starts in place of a notebook: passes the simulation's address on and waits until the run ends."""

from __future__ import annotations

import os
import socket
import sys


def main(path: str) -> None:
    """Sends the simulation's address to the socket at `path`; returns when the other side closes the connection."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as notebook:
        notebook.connect(path)
        notebook.sendall((os.environ.get("ACTCHECK_ADDRESS", "") + "\n").encode())
        while notebook.recv(64):
            pass


if __name__ == "__main__":
    main(sys.argv[1])
