"""Finds packages in the folders of ACTCHECK_PACKAGE_DIRS, in place of the module of the same name of ROS 2."""

import importlib.util
import os
import sys


class PackageNotFoundError(KeyError):
    """The package is in none of the folders."""


def _name_in(manifest):
    import xml.etree.ElementTree as tree

    try:
        return (tree.parse(manifest).getroot().findtext("name") or "").strip()
    except (OSError, tree.ParseError):
        return None


def _folders():
    return [folder for folder in os.environ.get("ACTCHECK_PACKAGE_DIRS", "").split("\n") if folder]


def _find(name):
    for folder in _folders():
        inside = os.path.join(folder, name)
        if os.path.isdir(inside):
            return inside
        if os.path.basename(folder) == name or _name_in(os.path.join(folder, "package.xml")) == name:
            return folder
    return None


def _of_ros():
    """The module of ROS that this one hides, or None."""
    own = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
    for place in sys.path:
        file = os.path.join(place or ".", "ament_index_python", "packages.py")
        if os.path.abspath(place or ".") != own and os.path.isfile(file):
            spec = importlib.util.spec_from_file_location("ament_index_python_of_ros", file)
            module = importlib.util.module_from_spec(spec)
            try:
                spec.loader.exec_module(module)
            except ImportError:
                continue
            return module
    return None


def get_package_share_directory(name, print_warning=True):
    found = _find(name)
    if found is not None:
        return found
    other = _of_ros()
    if other is not None:
        return other.get_package_share_directory(name)
    raise PackageNotFoundError("the package %s is in none of these folders: %s" % (name, ", ".join(_folders())))
