"""Tracebacks without the frames of this package."""

from __future__ import annotations

import functools
import inspect
import linecache
import sys
import traceback
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

_PACKAGE = str(Path(__file__).parent)


def own_frames(frames: Iterable[traceback.FrameSummary]) -> list[traceback.FrameSummary]:
    """The frames of the user's own files: outside of this package and of installed packages, and not of generated code."""
    return [
        frame
        for frame in frames
        if frame.line and not frame.filename.startswith(_PACKAGE) and "/site-packages/" not in frame.filename
    ]


def place_of(frame: traceback.FrameSummary) -> str:
    """A frame's file and line number."""
    return f"{Path(frame.filename).name}, line {frame.lineno}"


def place_of_fault(fault: BaseException) -> str | None:
    """The innermost of the user's own lines in an exception's traceback; `None` if there are none."""
    frames = own_frames(traceback.extract_tb(fault.__traceback__))
    return place_of(frames[-1]) if frames else None


def place_of_definition(function: Callable[..., Any]) -> str | None:
    """The file and the line of a function's `def`; `None` if it has none."""
    function = inspect.unwrap(function)
    while isinstance(function, functools.partial):
        function = function.func
    code = getattr(function, "__code__", None) or getattr(type(function).__call__, "__code__", None)
    if code is None:
        return None
    # The first line of a decorated function is that of its decorator.
    number = code.co_firstlineno
    while linecache.getline(code.co_filename, number).lstrip().startswith("@"):
        number += 1
    return f"{Path(code.co_filename).name}, line {number}"


def print_traceback(fault: BaseException) -> None:
    """Prints a traceback that begins at the first of the user's own lines."""
    whole = traceback.TracebackException.from_exception(fault)
    own = own_frames(whole.stack)
    if own:
        del whole.stack[: whole.stack.index(own[0])]
    print("".join(whole.format()), end="", file=sys.stderr)
