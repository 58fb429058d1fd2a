"""MuJoCo's compiler in a process of its own: compiling an option may take without end, and a damaged mesh may end the process."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from cutjoint.package.extensions import MissingPackageError

LIMIT = 60.0  #: seconds that MuJoCo may take
_START = "from cutjoint.importing.mjcf_process import main; main()"
_MODEL = "model.mjb"
_BROKEN = "the package mujoco is installed but cannot be imported: {}"


def compile_in_subprocess(path: Path, folder: Path, outside: set[str]) -> tuple[Any, dict[str, list[Any]]]:
    """MuJoCo's model of a file, its files that are "absent", and bodies that move and have the mass of one, "weightless", with its name.
    Raises ValueError: MuJoCo refuses the file, takes longer than LIMIT, or crashes; MissingPackageError: MuJoCo is not installed, or
    cannot be imported."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(str(Path(p).absolute()) for p in sys.path if p)}
    asked = json.dumps([str(path.absolute()), str(folder.resolve()), sorted(outside)])
    with TemporaryDirectory() as work:
        process = subprocess.Popen(
            [sys.executable, "-P", "-c", _START], cwd=work, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL, encoding="utf-8",
        )  # fmt: skip
        try:
            import mujoco  # while the process begins

            said, _ = process.communicate(asked, LIMIT)
        except ModuleNotFoundError as error:
            if error.name != "mujoco":
                raise MissingPackageError(_BROKEN.format(error)) from None
            raise MissingPackageError("reading MJCF needs the package mujoco: pip install 'cutjoint[mjcf]'") from None
        except (ImportError, OSError) as error:
            raise MissingPackageError(_BROKEN.format(error)) from None
        except subprocess.TimeoutExpired:
            raise ValueError(f"it took longer than {LIMIT:g} s") from None
        finally:
            process.kill()
            process.communicate()
        if process.returncode or not said:
            code = process.returncode
            raise ValueError(f"it ends with {signal.Signals(-code).name if code < 0 else f'status {code}'}")
        answer: dict[str, list[Any]] = json.loads(said)
        if "error" in answer:
            raise ValueError(*answer["error"])
        return (None if answer["weightless"] else mujoco.MjModel.from_binary_path(str(Path(work, _MODEL)))), answer


def main() -> None:
    """Compile the file that the standard input names; the model is written into the present folder."""
    import mujoco

    path, folder, outside = json.loads(sys.stdin.read())
    mujoco.set_mju_user_warning(lambda _: None)  # else they go to a file
    try:
        model, answer = _compile(path, Path(folder), set(outside), mujoco)
        if model is not None:
            mujoco.mj_saveModel(model, _MODEL, None)
    except ValueError as error:
        answer = {"error": [str(error)]}
    sys.stdout.write(json.dumps(answer))


def _compile(path: str, folder: Path, outside: set[str], mujoco: Any) -> tuple[Any, dict[str, list[Any]]]:
    """The model and the answer of `compile_in_subprocess`; files that are not there or ``outside`` the folder are points without mass."""
    try:
        if not outside:
            return mujoco.MjModel.from_xml_path(path), {"absent": [], "weightless": []}
    except ValueError:
        pass

    def is_absent(part: str, file: str) -> bool:
        target = Path(path).parent / part / file
        return bool(file) and (file in outside or not os.path.isfile(target) or not target.resolve().is_relative_to(folder))

    spec = mujoco.MjSpec.from_file(path)
    meshes = {mesh.name or Path(mesh.file).stem: mesh for mesh in spec.meshes if is_absent(spec.meshdir, mesh.file)}
    textures = [texture for texture in spec.textures if any(is_absent(spec.texturedir, file) for file in _files(texture))]
    weightless = []
    for geom in spec.geoms:
        if geom.meshname in meshes:
            body, file = geom.parent, meshes[geom.meshname].file
            weighs = geom.mass != 0 and geom.density != 0
            explicit = body.explicitinertial and spec.compiler.inertiafromgeom != int(mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE)
            if weighs and not explicit and _moves(spec, body):
                weightless.append((body.name, file))
            geom.type, geom.size, geom.meshname, geom.mass = mujoco.mjtGeom.mjGEOM_SPHERE, [1e-3, 0, 0], "", 0
    if weightless:
        return None, {"absent": [], "weightless": weightless}
    files = [*(mesh.file for mesh in meshes.values()), *(file for texture in textures for file in _files(texture))]
    for mesh in meshes.values():
        spec.delete(mesh)
    for texture in textures:
        texture.file, texture.cubefiles, texture.type = "", [""] * len(texture.cubefiles), mujoco.mjtTexture.mjTEXTURE_2D
        texture.builtin, texture.width, texture.height = mujoco.mjtBuiltin.mjBUILTIN_FLAT, 1, 1
    return spec.compile(), {"absent": list(dict.fromkeys(files)), "weightless": []}


def _moves(spec: Any, body: Any) -> bool:
    """Return whether a body, or one that carries it, has a joint."""
    return bool(body != spec.worldbody and (body.joints or _moves(spec, body.parent)))


def _files(texture: Any) -> list[str]:
    return [file for file in (texture.file, *texture.cubefiles) if file]
