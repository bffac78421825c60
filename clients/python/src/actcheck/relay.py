"""Stands in for a notebook as the program that actcheck starts: hands the simulation's address on, and waits until it is done."""

from __future__ import annotations

import os
import socket
import sys


def main(path: str) -> None:
    """Tells whoever listens at a path where the simulation is to be found; ends when they hang up."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as notebook:
        notebook.connect(path)
        notebook.sendall((os.environ.get("ACTCHECK_ADDRESS", "") + "\n").encode())
        while notebook.recv(64):
            pass


if __name__ == "__main__":
    main(sys.argv[1])
