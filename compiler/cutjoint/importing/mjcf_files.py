"""MuJoCo's compiler on files of strangers: names of files, sizes and numbers are checked, and pictures that are not there left out."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from cutjoint.importing.xml import LARGEST, Node, read_xml
from cutjoint.model.errors import ModelError, Problem
from cutjoint.model.text import is_number
from cutjoint.package.extensions import MissingPackageError

_INCLUDES = 50
#: Elements whose files are not needed.
_PICTURES = ("mesh", "texture")
#: Numbers as MuJoCo reads them.
_NUMBER = re.compile(r"[-+]?(nan|inf|[0-9.]+(e[-+]?[0-9]+)?)", re.IGNORECASE)
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


def compile_mjcf(path: Path, root: Node) -> tuple[Any, list[str]]:
    """MuJoCo's model of a file, and its pictures that are not there or outside its folder.

    Raises:
        ModelError: the file is wrong, names another file outside its folder, or is too large.
        MissingPackageError: MuJoCo is not installed.
    """
    outside: set[str] = set()
    roots = _require_inside(root, path.parent, path.parent, [path.resolve()], outside)
    _require_small(roots)
    try:
        import mujoco
    except ImportError:
        raise MissingPackageError("reading MJCF needs the package mujoco: pip install 'cutjoint[mjcf]'") from None
    warnings: list[str] = []
    mujoco.set_mju_user_warning(warnings.append)  # else they go to a file in the present folder
    try:
        model, absent = _compile(path, root, outside, mujoco)
    except ValueError as error:
        message = f"is refused by MuJoCo: {' '.join(str(error).split())[:300]}"
        _at_line(roots, str(error)).refuse(message, "correct the file; MuJoCo has to read it")
    finally:
        mujoco.set_mju_user_warning(None)
    if not all((np.abs(getattr(model, name)) <= LARGEST).all() for name in _NUMBERS):
        node = next((node for node in elements(root) if any(map(_is_large, node.attributes.values()))), root)
        node.refuse("has numbers that are not finite, or very large", "write plain decimal numbers")
    return model, list(dict.fromkeys(absent))


def _at_line(roots: list[Node], message: str) -> Node:
    """The element of which MuJoCo speaks, by its line and tag; the outermost one where it has no line, or several files have some."""
    line, tag = re.search(r"\bline (\d+)", message), re.search(r"Element '(\w+)'", message)
    found = [node for node in elements(roots[0]) if line and len(roots) == 1 and node.span.line == int(line[1])]
    return next((node for node in found if tag and node.tag == tag[1]), found[-1] if found else roots[0])


def _compile(path: Path, root: Node, outside: set[str], mujoco: Any) -> tuple[Any, list[str]]:
    """MuJoCo's model, and the files of pictures that are not there or ``outside`` the folder: it has points for them, without mass.

    Raises:
        ModelError: masses of bodies that move follow from them.
        ValueError: MuJoCo refuses the file.
    """
    try:
        if not outside:
            return mujoco.MjModel.from_xml_path(str(path)), []
    except ValueError:
        pass

    def is_absent(folder: str, file: str) -> bool:
        target = (path.parent / folder / file).resolve()
        return bool(file) and (file in outside or not target.is_file() or not target.is_relative_to(path.parent.resolve()))

    spec = mujoco.MjSpec.from_file(str(path))
    meshes = {mesh.name or Path(mesh.file).stem: mesh for mesh in spec.meshes if is_absent(spec.meshdir, mesh.file)}
    textures = [texture for texture in spec.textures if any(is_absent(spec.texturedir, file) for file in _files(texture))]
    problems = list[Problem]()
    for geom in spec.geoms:
        if geom.meshname in meshes:
            body, file = geom.parent, meshes[geom.meshname].file
            weighs = geom.mass != 0 and geom.density != 0
            explicit = body.explicitinertial and spec.compiler.inertiafromgeom != int(mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE)
            if weighs and not explicit and _moves(spec, body):
                message = f"has the mass of '{file}', which is {'outside the folder of the file' if file in outside else 'not there'}"
                node = next((n for n in elements(root) if n.tag == "body" and n.attributes.get("name") == body.name), root)
                problems.append(node.problem(message, "add the file, or write an inertial"))
            geom.type, geom.size, geom.meshname, geom.mass = mujoco.mjtGeom.mjGEOM_SPHERE, [1e-3, 0, 0], "", 0
    if problems:
        raise ModelError(list(dict.fromkeys(problems)))
    files = [*(mesh.file for mesh in meshes.values()), *(file for texture in textures for file in _files(texture))]
    for mesh in meshes.values():
        spec.delete(mesh)
    for texture in textures:
        texture.file, texture.cubefiles, texture.type = "", [""] * len(texture.cubefiles), mujoco.mjtTexture.mjTEXTURE_2D
        texture.builtin, texture.width, texture.height = mujoco.mjtBuiltin.mjBUILTIN_FLAT, 1, 1
    return spec.compile(), files


def _moves(spec: Any, body: Any) -> bool:
    """Return whether a body, or one that carries it, has a joint."""
    return bool(body != spec.worldbody and (body.joints or _moves(spec, body.parent)))


def _is_large(text: str) -> bool:
    """Return whether an attribute has a number that is not finite or too large."""
    return any(not is_number(word) or abs(float(word)) > LARGEST for word in text.split() if _NUMBER.fullmatch(word))


def _files(texture: Any) -> list[str]:
    return [file for file in (texture.file, *texture.cubefiles) if file]


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


def _require_inside(root: Node, folder: Path, at: Path, seen: list[Path], outside: set[str]) -> list[Node]:
    """The outermost elements of a file and of all that it takes in.  Files outside the folder of the model, very large ones and code are
    refused; names of pictures outside it are added to ``outside``."""
    roots = [root]
    for node in elements(root):
        if node.tag == "plugin":
            node.refuse("is a plugin, whose code is not run", "leave it out")
    folders = {node.attributes.get(key, "") for node in elements(root) for key in ("meshdir", "texturedir", "assetdir")} | {""}
    named = [(node, value) for node in elements(root) for name, value in node.attributes.items() if name.startswith("file")]
    for node, file in named:
        for part in folders:
            target = (at / part / file).resolve()
            if not target.is_relative_to(folder.resolve()) and node.tag in _PICTURES:
                outside.add(file)
                continue
            target = _inside(node, f"{part}/{file}" if part else file, folder, at)
            if target.is_file() and target.stat().st_size > _LARGEST_FILE:
                node.refuse(f"names a file of more than {_LARGEST_FILE // 1_000_000} MB", "make it smaller")
        if node.tag in ("include", "model"):
            target = _inside(node, file, folder, at)
            if target in seen or len(seen) > _INCLUDES:
                node.refuse(f"includes '{file[:60]}' again, or more than {_INCLUDES} files", "include each file once")
            seen.append(target)
            if target.is_file():
                roots += _require_inside(read_xml(target), folder, at, seen, outside)
    return roots


def _inside(node: Node, name: str, folder: Path, at: Path) -> Path:
    target = (at / name).resolve()
    if not target.is_relative_to(folder.resolve()):
        node.refuse(f"names '{name[:60]}', outside the folder of the file", "put what it needs into that folder")
    return target


def elements(node: Node) -> Iterator[Node]:
    """An element and all within it."""
    yield node
    for child in node.children:
        yield from elements(child)
