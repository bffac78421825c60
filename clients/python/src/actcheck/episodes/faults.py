"""Coded faults of a conversion."""

from __future__ import annotations

from typing import Literal

Code = Literal[
    "not-found",
    "unknown-format",
    "damaged",
    "missing-package",
    "too-large",
    "unsafe-link",
    "unsafe-model",
    "model-missing",
    "model-invalid",
    "asset-missing",
    "no-states",
    "state-length",
    "not-finite",
    "time-unknown",
    "quaternions-unknown",
    "field-missing",
    "exists",
    "unwritable",
    "failed",
]


class EpisodeFault(Exception):
    """An episode can't be converted. Nothing of it is kept.

    `code` is one word for programs, `reason` one sentence for people: the fault, its place, and the remedy.
    """

    def __init__(self, code: Code, reason: str) -> None:
        super().__init__(reason)
        self.code, self.reason = code, reason


def missing_package(name: str, needed_for: str) -> EpisodeFault:
    """The fault of a package that is not installed."""
    return EpisodeFault("missing-package", f"{needed_for} needs the package `{name}`: pip install {name}")
