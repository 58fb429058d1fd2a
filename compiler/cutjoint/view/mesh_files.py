"""Meshes of bodies from files beside the model.  A mesh is data: nothing that it names is read, and it has a bounded size."""

import io
import warnings
from pathlib import Path

import numpy as np

from cutjoint.model.errors import ModelError, Problem
from cutjoint.model.records import Body, Model, Visual
from cutjoint.model.text import printable
from cutjoint.package.locations import require_input
from cutjoint.run.run_file import Evaluator
from cutjoint.view.glb import GlbError, read_glb
from cutjoint.view.records import Array, Mesh
from cutjoint.view.sizes import point_of

#: Limits: bytes of a file, triangles of a mesh, and the largest coordinate, m.
_BYTES, _TRIANGLES, _FAR = 50_000_000, 200_000, 1e6


def require_meshes(model: Model, numbers: Evaluator) -> None:
    """Check that all meshes of a model can be drawn. Raises ModelError: files are not there or are no meshes; all of them."""
    problems: list[Problem] = []
    for body in model.bodies:
        try:
            load_meshes(body, numbers)
        except ModelError as error:
            problems += error.problems
    if problems:
        raise ModelError(problems)


def load_meshes(body: Body, numbers: Evaluator) -> list[Mesh]:
    """The meshes of a body in the design position, with an edge between all triangles.
    Raises ModelError: a file is not there, is not below the model file's folder, or is no mesh."""
    return [_placed(body, visual, numbers) for visual in body.visuals if visual.mesh]


def _placed(body: Body, visual: Visual, numbers: Evaluator) -> Mesh:
    """A mesh where it stands, without triangles that have no area; the image in a mirror is turned inside out first."""
    axes = visual.scale * np.array([point_of(numbers, axis) for axis in visual.axes])
    placed = _triangles(body, visual) @ axes + point_of(numbers, visual.at)
    if np.linalg.det(axes) < 0:
        placed = placed[:, ::-1]
    kept = np.linalg.norm(np.cross(placed[:, 1] - placed[:, 0], placed[:, 2] - placed[:, 0]), axis=1) > 0
    if not kept.any():
        raise _problem(body, visual, "has no triangle with an area", "write it in metres, or give a scale")
    points = placed[kept].reshape(-1, 3)
    return Mesh(points=points, faces=np.arange(len(points)).reshape(-1, 3))


def _triangles(body: Body, visual: Visual) -> Array:
    """The corners of the triangles of a file, (n, 3, 3), in its own frame."""
    content, kind = _content(body, visual), Path(visual.mesh).suffix[1:].lower()
    try:
        with np.errstate(all="ignore"):
            corners = _read_gltf(content) if kind == "glb" else _read_by_trimesh(content, kind)
            largest = float(np.abs(corners).max(initial=0.0)) * visual.scale
    except GlbError as error:
        raise _problem(body, visual, f"is no sound glTF: {printable(str(error))}", "write it anew, or as STL") from None
    except Exception:  # any exception of a library for a file that it cannot read
        raise _problem(body, visual, "is no mesh that can be read", "write it anew as STL") from None
    if not len(corners) or not largest < _FAR:
        raise _problem(body, visual, "has no triangles, or some that are not finite or far away", "write it in metres, or give a scale")
    if len(corners) > _TRIANGLES:
        raise _problem(body, visual, f"has more than {_TRIANGLES} triangles", "make it coarser")
    return corners


def _read_by_trimesh(content: bytes, kind: str) -> Array:
    import trimesh

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        loaded = trimesh.load_mesh(io.BytesIO(content), file_type=kind, process=False, resolver=None, skip_materials=True)
    triangles = np.asarray(loaded.triangles, dtype=np.float64)
    if triangles.shape[1:] != (3, 3):
        raise ValueError("its points have not three coordinates each")
    return triangles


def _read_gltf(content: bytes) -> Array:
    """The triangles of a scene; not all of them if there are more than can be drawn."""
    parts, count = [np.zeros((0, 3, 3))], 0
    for corners in read_glb(content).triangles():
        parts.append(corners)
        count += len(corners)
        if count > _TRIANGLES:
            break
    return np.concatenate(parts)


def _content(body: Body, visual: Visual) -> bytes:
    """The bytes of the file, which is below the model file's folder, links followed."""
    folder = Path(visual.span.file).parent.resolve()
    try:
        path = (folder / visual.mesh).resolve(strict=True)
    except (OSError, RuntimeError):
        raise _problem(body, visual, "is not there", f"put it into {folder.name or 'the folder'}, beside the model file") from None
    if not path.is_relative_to(folder):
        raise _problem(body, visual, "is a link that leaves the model file's folder", "put the file itself there")
    if not path.is_file() or path.stat().st_size > _BYTES:
        raise _problem(body, visual, f"is no file of {_BYTES // 1_000_000} MB at most", "name another")
    require_input(path)
    try:
        return path.read_bytes()
    except OSError:
        raise _problem(body, visual, "cannot be read", "change its permissions") from None


def _problem(body: Body, visual: Visual, message: str, hint: str) -> ModelError:
    return ModelError([Problem(span=visual.span, element=f"body '{body.name}'", message=f"mesh '{visual.mesh}' {message}", hint=hint)])
