"""MuJoCo's compiler on files of strangers: names of files, sizes and numbers are checked, and pictures that are not there left out."""

import math
import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from cutjoint.importing.mjcf_process import compile_in_subprocess
from cutjoint.importing.xml import LARGEST, Node, read_xml
from cutjoint.model.errors import ModelError, Problem
from cutjoint.model.text import is_number

_INCLUDES = 50
_PICTURES = ("mesh", "texture")  #: elements whose files are not needed
_NUMBER = re.compile(r"[-+]?(nan|inf|[0-9.]+(e[-+]?[0-9]+)?)", re.IGNORECASE)  #: numbers as MuJoCo reads them
_LARGEST_FILE = 200_000_000
#: The most elements with those that are repeated; the largest number of pixels, heights, pairs of parts or entries, and the attributes that
#: say it.
_ELEMENTS, _LARGEST_SIZE, _FAR = 20_000, 4_000_000, 1e9
_SIZES = {"texture": (("width", "height"),), "hfield": (("nrow", "ncol"),), "composite": (("count",) * 2,), "flexcomp": (("count",) * 2,)}
#: Arrays of MuJoCo's model that are read.
_NUMBERS = ("body_mass", "body_inertia", "body_ipos", "body_iquat", "body_pos", "body_quat", "site_pos", "site_quat", "jnt_axis", "jnt_pos",
            "jnt_stiffness", "dof_damping", "dof_armature", "dof_frictionloss", "qpos0", "qpos_spring", "key_qpos", "actuator_gear",
            "actuator_gainprm", "actuator_biasprm", "actuator_armature", "actuator_damping", "geom_pos", "geom_quat",
            "wrap_prm")  # fmt: skip


def compile_mjcf(path: Path, root: Node, folder: Path) -> tuple[Any, list[str]]:
    """MuJoCo's model of a file, and its pictures that are not there or outside a folder. Raises ModelError: the file is wrong, names
    another file outside the folder, or is too large; MissingPackageError: MuJoCo is not installed."""
    outside: set[str] = set()
    roots = _require_inside(root, path, folder, outside)
    _require_small(roots)
    try:
        model, answer = compile_in_subprocess(path, folder, outside)
    except ValueError as error:
        message = f"is refused by MuJoCo: {' '.join(str(error).split())[:300]}"
        _at_line(roots, str(error)).refuse(message, "correct the file; MuJoCo has to read it")
    problems = list[Problem]()
    for body, file in answer["weightless"]:
        message = f"has the mass of '{file}', which is {'outside the folder of the file' if file in outside else 'not there'}"
        node = next((n for n in elements(root) if n.tag == "body" and n.attributes.get("name") == body), root)
        problems.append(node.problem(message, "add the file, or write an inertial"))
    if problems:
        raise ModelError(list(dict.fromkeys(problems)))
    if not all((np.abs(getattr(model, name)) <= LARGEST).all() for name in _NUMBERS):
        node = next((node for node in elements(root) if any(map(_is_large, node.attributes.values()))), root)
        node.refuse("has numbers that are not finite, or very large", "write plain decimal numbers")
    return model, answer["absent"]


def _at_line(roots: list[Node], message: str) -> Node:
    """The element of which MuJoCo speaks, by its line and tag; the outermost one where it has no line, or several files have some."""
    line, tag = re.search(r"\bline (\d+)", message), re.search(r"Element '(\w+)'", message)
    found = [node for node in elements(roots[0]) if line and len(roots) == 1 and node.span.line == int(line[1])]
    return next((node for node in found if tag and node.tag == tag[1]), found[-1] if found else roots[0])


def _is_large(text: str) -> bool:
    """Return whether an attribute has a number that is not finite or too large."""
    return any(not is_number(word) or abs(float(word)) > LARGEST for word in text.split() if _NUMBER.fullmatch(word))


def _require_small(roots: list[Node]) -> None:
    """Refuse files of a few lines that MuJoCo's compiler makes very large models of."""
    copies, nodes = math.prod(map(_copies, roots)), [node for root in roots for node in elements(root)]
    if copies * len(nodes) > _ELEMENTS:
        roots[0].refuse(f"repeats its {len(nodes)} elements up to {copies} times", "make it smaller")
    for node in nodes:
        sizes = [math.prod(_whole(node.attributes.get(name, "")) for name in names) for names in _SIZES.get(node.tag, ())]
        if node.tag == "size":
            sizes = [_whole(value) for name, value in node.attributes.items() if name != "memory"]
        if max(sizes, default=0) > _LARGEST_SIZE:
            node.refuse(f"is {max(sizes)} large", f"make it {_LARGEST_SIZE} at most")


def _copies(node: Node) -> int:
    """The largest product of counts of ``<replicate>`` within each other."""
    own = _whole(node.attributes.get("count", "")) if node.tag == "replicate" else 1
    return own * max(map(_copies, node.children), default=1)


def _whole(text: str) -> int:
    """The product of the numbers in an attribute without their fractions; what is none counts as one."""
    return math.prod(max(1, int(min(float(word), _FAR))) for word in text.split() if is_number(word))


def _require_inside(root: Node, path: Path, folder: Path, outside: set[str]) -> list[Node]:
    """The outermost elements of a file and of all that it takes in.  Files outside a folder, what is none, very large ones and code are
    refused; names of pictures that are so are added to ``outside``."""
    roots, seen = [root], {path.resolve(): path.parent}
    for one in roots:
        for node in elements(one):
            if node.tag == "plugin":
                node.refuse("is a plugin, whose code is not run", "leave it out")
            if node.tag not in ("include", "model") or not (file := node.attributes.get("file")):
                continue
            for target in _look_up(node, file, folder, list(seen.values())):
                if target in seen or len(seen) > _INCLUDES:
                    node.refuse(f"includes '{file[:60]}' again, or more than {_INCLUDES} files", "include each file once")
                seen[target] = target.parent
                roots.append(read_xml(target))
    nodes = [node for one in roots for node in elements(one) if node.tag not in ("include", "model")]
    parts = {node.attributes.get(key, ""): None for node in nodes for key in ("meshdir", "texturedir", "assetdir")} | {"": None}
    folders = [at / part for at in seen.values() for part in parts]
    is_stripped = any("strippath" in node.attributes for node in nodes)
    for node, file in ((each, value) for each in nodes for name, value in each.attributes.items() if name.startswith("file") and value):
        names = {file, Path(file).name if is_stripped else file}
        try:
            found = [target for name in names for target in _look_up(node, name, folder, folders)]
        except ModelError:
            if node.tag not in _PICTURES:
                raise
            outside.add(file)
            continue
        if any(target.stat().st_size > _LARGEST_FILE for target in found):
            node.refuse(f"names a file of more than {_LARGEST_FILE // 1_000_000} MB", "make it smaller")
    return roots


def _look_up(node: Node, name: str, folder: Path, at: Iterable[Path]) -> list[Path]:
    """The files that a name may mean, seen from folders; ModelError where one is outside the ``folder``, or is none."""
    found, leaves, hint = list[Path](), False, "move its files into that folder"
    for start in at:
        try:
            target = (start / name).resolve()
            exists, is_file, is_inside = target.exists(), target.is_file(), target.is_relative_to(folder.resolve())
        except (OSError, RuntimeError, ValueError):  # a link to itself, a name too long
            node.refuse(f"names '{name[:60]}', which no file can be", hint)
        if exists and is_inside and not is_file and not target.is_dir():
            node.refuse(f"names '{name[:60]}', which is no file", hint)
        if exists and not is_inside:
            node.refuse(f"names '{name[:60]}', outside the folder of the file", hint)
        leaves |= not is_inside
        found += [target] if is_file else []
    if leaves and not found:
        node.refuse(f"names '{name[:60]}', outside the folder of the file", hint)
    return found


def elements(node: Node) -> Iterator[Node]:
    """An element and all within it."""
    yield node
    for child in node.children:
        yield from elements(child)
