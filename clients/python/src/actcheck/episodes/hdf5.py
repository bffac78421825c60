"""Opens HDF5 files without following links out of them and without loading plugins."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from actcheck.episodes.faults import EpisodeFault, missing_package
from actcheck.recording.states import Array

#: Filters that are built into HDF5 and h5py: deflate, shuffle, checksum, szip, n-bit, scale-offset, LZF. Others are plugins.
_FILTERS = {1, 2, 3, 4, 5, 6, 32000}
#: Most states of an episode, most numbers in one, and largest part that HDF5 reads at once: a small file can say that it has billions.
_MOST_STATES, _MOST_NUMBERS, _LARGEST_CHUNK = 1_000_000, 10_000, 256 << 20
_MAGIC = b"\x89HDF\r\n\x1a\n"


def is_hdf5(path: Path) -> bool:
    """Whether a file begins as an HDF5 file."""
    with path.open("rb") as stream:
        return stream.read(len(_MAGIC)) == _MAGIC


@contextmanager
def opened(path: Path) -> Iterator[Any]:
    """Opens a file for reading."""
    try:
        import h5py
    except ImportError as fault:
        raise missing_package("h5py", "an HDF5 file") from fault
    try:
        file = h5py.File(path, "r", locking=False)
    except OSError as fault:
        raise EpisodeFault("damaged", f"{path} is not a whole HDF5 file: {fault}") from fault
    with file:
        yield file


def child(group: Any, name: str) -> Any:
    """A member of a group, by a path without links; `None` if it is absent.

    Raises `EpisodeFault` for an external or soft link, a dataset that is stored in other files, one that needs a plugin, or one that is too large.
    """
    import h5py

    for part in name.split("/"):
        if not isinstance(group, h5py.Group):
            return None
        try:
            link = group.get(part, getlink=True)
            if link is None or part not in group:
                if isinstance(link, (h5py.ExternalLink, h5py.SoftLink)):
                    raise _link(group, part, link)
                return None
            if not isinstance(link, h5py.HardLink):
                raise _link(group, part, link)
            group = group[part]
        except (KeyError, OSError, RuntimeError) as fault:
            raise EpisodeFault("damaged", f"{group.name}/{part} can't be read: {fault}") from fault
    if isinstance(group, h5py.Dataset):
        _self_contained(group)
        _small_enough(group)
    return group


def _link(group: Any, part: str, link: Any) -> EpisodeFault:
    target = f"{link.filename}:{link.path}" if hasattr(link, "filename") else link.path
    return EpisodeFault("unsafe-link", f"{group.name}/{part} is a link to {target}; store the data in the file itself")


def _self_contained(dataset: Any) -> None:
    if dataset.external or dataset.is_virtual:
        raise EpisodeFault("unsafe-link", f"{dataset.name} is stored in other files; store the data in the file itself")
    properties = dataset.id.get_create_plist()
    used = {properties.get_filter(at)[0] for at in range(properties.get_nfilters())}
    if not used <= _FILTERS:
        raise EpisodeFault("unsafe-link", f"{dataset.name} needs an HDF5 plugin; store it with gzip or uncompressed")


def _small_enough(dataset: Any) -> None:
    rows, *inner = dataset.shape or (1,)
    if rows > _MOST_STATES:
        raise EpisodeFault("too-large", f"{dataset.name} has {rows} rows; at most {_MOST_STATES} are read: divide the episode")
    row = math.prod(inner)
    if row > _MOST_NUMBERS:
        raise EpisodeFault("too-large", f"{dataset.name} has {row} numbers in a row; at most {_MOST_NUMBERS} are read")
    chunk = math.prod(dataset.chunks or (0,)) * dataset.dtype.itemsize
    if chunk > _LARGEST_CHUNK:
        raise EpisodeFault("too-large", f"{dataset.name} has chunks of {chunk} bytes; store it with chunks of at most {_LARGEST_CHUNK}")


def numbers(dataset: Any, begin: int, end: int) -> Array:
    """Rows of a dataset as doubles. Raises `EpisodeFault` if they can't be read or one is not finite."""
    try:
        rows = np.asarray(dataset[begin:end], np.float64)
    except (OSError, RuntimeError, TypeError, ValueError) as fault:
        raise EpisodeFault("damaged", f"{dataset.name} can't be read as numbers: {fault}") from fault
    finite = np.isfinite(rows).all(axis=tuple(range(1, rows.ndim)))
    if not finite.all():
        raise EpisodeFault("not-finite", f"{dataset.name} has a number that is not finite in row {begin + int(finite.argmin())}")
    return rows


def text(owner: Any, name: str) -> str:
    """A text attribute; empty if it is absent."""
    value = owner.attrs.get(name, "")
    if isinstance(value, bytes):
        return value.decode(errors="replace")
    return value if isinstance(value, str) else str(value)


def parsed(owner: Any, name: str) -> dict[str, Any]:
    """A JSON object in a text attribute; empty if it is absent or invalid."""
    try:
        value = json.loads(text(owner, name) or "{}")
    except ValueError:
        return {}
    return value if isinstance(value, dict) else {}


def demonstrations(file: Any) -> list[str]:
    """Names of the groups `data/demo_…`, in the order of their numbers."""
    data = child(file, "data")
    names = [name for name in data if name.startswith("demo")] if data is not None and hasattr(data, "keys") else []
    return sorted(names, key=lambda name: [int(part) if part.isdigit() else part for part in re.split(r"(\d+)", name)])
