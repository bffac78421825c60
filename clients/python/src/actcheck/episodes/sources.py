"""Source files: their kind, their digest, and the metadata that every converted episode has."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Literal

_BLOCK = 1 << 20


@dataclass(frozen=True)
class Options:
    """Values that a file does not state itself."""

    #: Order of Isaac Lab's quaternions; `None` if the file or its states decide.
    quaternions: Literal["wxyz", "xyzw"] | None = None
    #: Time between the states of a file that does not say. Unit: seconds.
    timestep: float | None = None


@dataclass(frozen=True)
class Source:
    """A file or folder to convert."""

    path: Path
    options: Options

    @cached_property
    def digest(self) -> str:
        """SHA-256 of the file, in hexadecimal; of a folder, of its files but videos in the order of their names."""
        digest = hashlib.sha256()
        files = [self.path] if self.path.is_file() else sorted(path for path in self.path.rglob("*") if path.is_file() and path.suffix != ".mp4")
        for path in files:
            if path is not self.path:
                digest.update(path.relative_to(self.path).as_posix().encode() + b"\0")
            with path.open("rb") as stream:
                while block := stream.read(_BLOCK):
                    digest.update(block)
        return digest.hexdigest()

    def metadata(self, kind: str, episode: str) -> dict[str, str]:
        """The metadata of an episode that is converted from this source."""
        from actcheck import __version__

        return {
            "recorder": f"actcheck {__version__} from {kind}",
            "source": self.path.name,
            "source_episode": episode,
            "source_digest": self.digest,
        }


@dataclass(frozen=True)
class Episode:
    """An episode in a source. `write` creates the episode file at a path, or raises `EpisodeFault` and leaves no file."""

    key: str
    write: Callable[[Path], None]


#: Yields the episodes of a source. Raises `EpisodeFault` for a fault of the whole source.
Reader = Callable[[Source], Iterator[Episode]]
