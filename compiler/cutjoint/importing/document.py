"""A file of another program as the text of a model file: a line an element, names kept, comments where something was decided."""

import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cutjoint.importing.closing import Closed, Relation, close, solve_couplings
from cutjoint.importing.formats import READERS
from cutjoint.importing.mjcf import read_mjcf
from cutjoint.importing.robot import POINT, Array, Drive, Joint, Link, Loop, Robot, Spring, excess, forward, lump, short
from cutjoint.importing.sdf import read_sdf
from cutjoint.importing.urdf import read_urdf
from cutjoint.model.names import MAX_NAME_LENGTH, RESERVED_EVERYWHERE, name_problem
from cutjoint.model.text import escaped

#: Parts of vectors and matrices that are smaller, as a share of the largest or in m, are rounding of the file's own frames.
_NOISE = 1e-12
_OUTPUTS = 12  #: the most outputs of a file without drives
_COORDINATE = {"revolute": "angle", "prismatic": "displacement"}
_MESHES = (".stl", ".obj", ".glb")
_LONGEST = 200  #: the longest part of a path that is looked up
_TRIALS = 5  #: so often is a direction rounded
_STRAIGHT = 1e-10  #: a direction that is off an axis by less is this axis, rad: files write the half of pi to ten digits and more
_SLIDING = 0.01  #: the speed, m/s and rad/s, below which dry friction of free joints and balls is smooth
_WORDS = ("true", "false", "null")  #: words that are no text in YAML


class Document:
    """Sections of a model file, filled element by element; ``folder`` is that of the file read, ``free`` says that its base moves.
    ``bodies`` and ``joints`` have the model's names by those of links and joints, ``carriers`` also by links that are parts of bodies."""

    def __init__(self, robot: Robot, closed: Closed, folder: Path, *, free: bool) -> None:
        self._notes: dict[str, list[str]] = {note: [] for note in robot.notes}
        self._robot, self._closed, self._folder = robot, closed, folder
        self._sections: dict[str, dict[str, Any]] = {
            key: {} for key in ("parameters", "bodies", "joints", "gears", "signals", "forces", "markers", "outputs")
        }
        self.bodies: dict[str, str] = {}
        self.joints: dict[str, str] = {}
        self._taken: set[str] = {"ground"}
        self._welds: dict[str, dict[str, Any]] = {}
        self.carriers = {link.name: "ground" for link in robot.root()}
        if free:
            self._float()
        for link, carrier in lump(robot):
            self._note("links merged into their carriers, since no body has their moments of inertia", f"{link} of {carrier}")
        for joint in robot.outwards():
            self._add_joint(joint)
        for name, hinges in robot.balls.items():
            self._note("three hinges that meet in a point of a loop are a ball, whose angles have no names", f"{name} of {hinges[0].name}")
        for loop in robot.loops:
            self._add_loop(loop)
        for relation in solve_couplings(robot):
            joints = [self.joints[joint] for joint in (relation.dependent, *relation.ratios)]
            self._sections["gears"][self._name(relation.name, "gear")] = {"joints": joints, **self._law(relation)}
        for drive in robot.drives:
            self._add_drive(drive)
        for spring in robot.springs:
            self._add_spring(spring)
        if not self._sections["outputs"]:
            able = [name for name in self.joints if robot.joints[name].kind in _COORDINATE]
            self._sections["outputs"] = {self._coordinate(name): True for name in able[:_OUTPUTS]}

    def text(self, source: str, left_out: Mapping[str, int]) -> str:
        """The whole file; ``source`` is the name of the file read, ``left_out`` counts its tags and attributes that were not taken."""
        head = [f"# From {escaped(source)}."]
        if left_out:
            head.append("# Left out: " + ", ".join(f"{escaped(tag)} ({count})" for tag, count in sorted(left_out.items())) + ".")
        head += [f"# {note[0].upper()}{note[1:]}." for note in self.notes]
        head += ["cutjoint: 1", f"name: {_legal(self._robot.name) or 'robot'}", f"gravity: {_flow(list(self._robot.gravity))}"]
        for title, elements in self._sections.items():
            if elements:
                head += [f"{title}:", *(f"  {name}: {_flow(element)}" for name, element in elements.items() if title != "outputs")]
        if outputs := self._sections["outputs"]:
            head[-1] = f"outputs: {_flow(list(outputs))}"
        return "\n".join([*head, "scenes:", "  motion: {end: 1}", *self._scenes()]) + "\n"

    def _scenes(self) -> Iterator[str]:
        """The file's starts, by the coordinates that loops leave free or that motors drive."""
        in_loops, driven = self._robot.in_loops(), {joint for drive in self._robot.drives for joint in drive.joints}
        self._taken = {"motion"}
        for name, start in self._robot.starts.items():
            able = {j: x for j, x in start.items() if j in self.joints and (j not in in_loops or j in driven)}
            moved = {self._coordinate(j): short(x - float(self._closed.q[j][0])) for j, x in able.items()}
            positions = {key: value for key, value in moved.items() if value}
            yield f"  {self._name(name, 'scene')}: {_flow({'end': 1, **({'positions': positions} if positions else {})})}"

    @property
    def notes(self) -> list[str]:
        """Sentences of what was decided."""
        counted = ((note, ", ".join(dict.fromkeys(names))) for note, names in self._notes.items())
        return [escaped(note) for note in (*self._position(), *(f"{note}: {names}" if names else note for note, names in counted))]

    def _note(self, sentence: str, *names: str) -> None:
        self._notes.setdefault(sentence, []).extend(names)

    def _position(self) -> Iterator[str]:
        robot, zero = self._robot, self._closed.own(self._robot.references)
        values = ", ".join(f"{j} {' '.join(f'{x:.9g}' for x in q)}" for j, q in zero.items() if j in self.joints and q.any())
        start = "in the file's own position (qpos0)" if robot.references else "where all coordinates of the file are zero"
        if not robot.loops and not robot.couplings:
            if values:
                yield f"coordinates are zero where those of the file are: {values}"
            return
        if self._closed.violation > 1e-9:
            yield f"loops close within {self._closed.violation:.1g} m or rad by the file's numbers; here they close wholly"
        if any(q.any() for q in self._closed.q.values()):
            yield f"loops do not close {start}; they count from where they do: {values}"
        else:
            yield f"loops close {start}; the design position is that{f', with {values}' if values else ''}"

    # names

    def _name(self, wanted: str, suffix: str = "") -> str:
        """A legal name that nothing has yet, near the wanted one."""
        base = _legal(wanted) or "part"
        tries = (base, f"{base}_{suffix}" if suffix else "", *(f"{base}_{i}" for i in range(2, 10_000)))
        name = next(t for t in (t[:MAX_NAME_LENGTH].rstrip("_") for t in tries if t) if t.lower() not in self._taken)
        self._taken.add(name.lower())
        return name

    def _own_name(self, wanted: str, suffix: str) -> str:
        """The name of an element of the file; another one than the file's is noted."""
        name = self._name(wanted, suffix)
        if name != wanted:
            self._note("names that are shared or not legal have been changed", f"{suffix} {wanted} is {name}")
        return name

    def _coordinate(self, joint: str) -> str:
        return f"{self.joints[joint]}.{_COORDINATE[self._robot.joints[joint].kind]}"

    # bodies

    def _float(self) -> None:
        (root,) = self._robot.root()
        if root.name == "world":
            root.node.refuse("is fixed to the ground, since its first link is the world", "leave out --base free")
        name = self._add_body(root)
        joint = self._name(f"{name}_free")
        self._sections["joints"][joint] = {"kind": "free", "bodies": ["ground", name], "at": [0, 0, 0]}
        self._weld_shaft(name)

    def _add_body(self, link: Link) -> str:
        name = self.bodies[link.name] = self.carriers[link.name] = self._own_name(link.name, "body")
        pose = self._closed.poses[link.name]
        body: dict[str, Any] = {"massless": True} if link.mass == 0 else {"mass": link.mass}
        if link.mass:
            body["centre_of_mass"] = _vector(pose.rotation @ link.centre + pose.place)
        inertia = pose.rotation @ link.inertia @ pose.rotation.T
        too_much, about = excess(link)
        noise = _NOISE * np.abs(inertia).max()
        if too_much:
            axis = forward(pose.rotation @ about)
            inertia, noise = inertia - too_much * np.outer(axis, axis), 4 * noise
        if np.abs(inertia).max() > max(noise, POINT * link.mass):
            body["inertia"] = _inertia(inertia, noise) if link.mass else _shaft(inertia, noise)
        if picture := self._picture(link):
            body["visual"] = picture
        self._sections["bodies"][name] = body
        if too_much:
            shaft = self._name(f"{name}_excess")
            self._sections["bodies"][shaft] = {"massless": True, "inertia": {"axial": short(too_much), "axis": _direction(axis)}}
            self._welds[name] = {"kind": "fixed", "bodies": [name, shaft], "at": _vector(pose.place)}
            self._note("moments of inertia larger than the sum of the two others, as no body has; a shaft has what is too much", link.name)
        return name

    def _weld_shaft(self, body: str) -> None:
        if body in self._welds:
            weld = self._welds[body]
            self._sections["joints"][self._name(f"{weld['bodies'][1]}_weld")] = weld

    def _picture(self, link: Link) -> dict[str, Any]:
        picture: dict[str, Any] = {}
        if link.mesh and (file := self._mesh(link)):
            pose = self._closed.poses[link.name] @ link.mesh_pose
            picture = {"mesh": file, "at": _vector(pose.place)}
            if link.scale != 1:
                picture["scale"] = link.scale
            if np.abs(pose.rotation - np.eye(3)).max() > _NOISE:
                picture["x"], picture["y"] = _frame(pose.rotation)
        if link.colour:
            picture["colour"] = link.colour
        return picture

    def _mesh(self, link: Link) -> str:
        """The mesh's path below the folder, "" with a note if it is not there or in no format that is drawn."""
        path = re.sub(r"^(package|model|file)://", "", link.mesh).lstrip("/").replace("\\", "/")
        parts = [part for part in path.split("/") if part]
        for tail in (parts[i:] for i in range(len(parts))):
            sound = ".." not in tail and max(map(len, tail)) < _LONGEST and Path(tail[-1]).suffix.lower() in _MESHES
            file = self._folder.joinpath(*tail)
            if sound and file.is_file() and file.resolve().is_relative_to(self._folder.resolve()):
                return "/".join(tail)
        self._note("meshes that are not drawn, being no .stl, .obj or .glb below the file's folder", parts[-1] if parts else link.name)
        return ""

    # joints

    def _add_joint(self, joint: Joint) -> None:
        link, parent = self._robot.links[joint.child], self.carriers[joint.parent]
        pose = self._closed.poses[joint.parent] @ joint.origin
        if joint.kind == "free":  # it may have been moved to where loops close
            pose = self._closed.poses[joint.child] @ joint.inner.inverse()
        if joint.kind == "fixed" and link.massless:
            self.carriers[link.name] = parent
            used = {name for loop in self._robot.loops for name in loop.links} | {j.parent for j in self._robot.joints.values()}
            if link.name not in used:
                marker = self._name(link.name, "point")
                self._sections["markers"][marker] = {"body": parent, "at": _vector(self._closed.poses[link.name].place)}
            return
        child = self._add_body(link)
        name = self.joints[joint.name] = self._own_name(joint.name, "joint")
        element: dict[str, Any] = {"kind": joint.kind, "bodies": [parent, child], "at": _vector(pose.place)}
        if joint.kind in _COORDINATE:
            element["axis"] = _direction(pose.rotation @ joint.axis)
        if joint.armature and joint.kind in _COORDINATE:
            element["armature"] = joint.armature
        self._sections["joints"][name] = element
        if joint.armature and joint.kind not in _COORDINATE:
            self._add_armature(joint, parent, child, element["at"])
        self._weld_shaft(child)
        q = self._closed.q.get(joint.name, np.zeros(1))
        self._resist(name, element, joint, pose.rotation @ q if joint.kind == "spherical" else q)

    def _add_armature(self, joint: Joint, parent: str, child: str, at: list[float | int]) -> None:
        """That of a free joint or a ball on what stands still is a body without weight, with the same inertia about all axes."""
        if parent != "ground":
            joint.node.refuse(f"has an armature on a joint of kind {joint.kind} whose carrier moves", "leave it out")
        body, inertia = self._name(f"{child}_armature"), [joint.armature] * 3
        self._sections["bodies"][body] = {"massless": True, "inertia": inertia}
        if joint.kind == "free":
            self._sections["bodies"][body] = {"mass": joint.armature, "centre_of_mass": at, "inertia": inertia}
            lift = {"kind": "load", "body": body, "at": at, "force": [short(-joint.armature * g) for g in self._robot.gravity]}
            self._sections["forces"][self._name(f"{body}_lift")] = lift
        self._sections["joints"][self._name(f"{body}_weld")] = {"kind": "fixed", "bodies": [child, body], "at": at}
        self._note("armatures of free joints and balls are bodies, without weight", body)

    def _resist(self, name: str, element: dict[str, Any], joint: Joint | Loop, here: Array) -> None:
        """The spring, damper and friction of a joint; ``here`` are its coordinates in the file at the design position.
        Those of a ball rotate it there from where its spring is at rest, rad in global axes."""
        if joint.kind == "free" and not joint.stiffness:
            self._add_resisting_force(name, element, joint.damping, joint.friction)
            return
        if joint.kind not in (*_COORDINATE, "spherical") and (joint.stiffness or joint.damping or joint.friction):
            joint.node.refuse(f"has a spring or friction on a joint of kind {joint.kind}", "set both to zero, or write three hinges")
        if joint.kind == "spherical" and joint.friction:
            self._add_resisting_force(name, element, 0.0, joint.friction)
        if joint.stiffness or joint.damping:
            spring: dict[str, Any] = {"stiffness": joint.stiffness, "damping": joint.damping}
            if joint.stiffness and joint.kind == "spherical":
                spring["free_rotation"] = _vector(-here) if here.any() else ()
            elif joint.stiffness:
                spring["free_position"] = short(joint.rest - float(here[0]))
            element["spring"] = {key: value for key, value in spring.items() if value}
        if joint.friction and joint.kind != "spherical":
            force = self._name(f"{name}_friction")
            radius = {"radius": 1} if joint.kind == "revolute" else {}
            friction = {"kind": "joint_friction", "joint": name, "coefficient": 1, **radius, "preload": joint.friction, "carried": False}
            self._sections["forces"][force] = friction

    def _add_resisting_force(self, name: str, element: dict[str, Any], damping: float, friction: float) -> None:
        """The damper and the dry friction of a free joint or a ball, on places and turns."""
        if not damping and not friction:
            return

        def against(words: list[str]) -> list[str]:
            size = f"/sqrt({' + '.join(f'{word}**2' for word in words)} + {_SLIDING}**2)"
            parts = [*([repr(damping)] if damping else []), *([f"{friction!r}{size}"] if friction else [])]
            return [f"-{parts[0] if len(parts) == 1 else f'({parts[0]} + {parts[1]})'}*{word}" for word in words]

        if friction:
            self._note("dry friction of free joints and balls acts against their velocity, smoothly below 0.01 m/s or rad/s", name)
        base, follower = element["bodies"]
        if element["kind"] == "free":
            drag = {"kind": "load", "body": follower, "at": element["at"], "force": against([f"v{i}" for i in "xyz"])}
            self._sections["forces"][self._name(f"{name}_drag")] = drag
        for body, other in ((follower, base), (base, follower)):
            if body != "ground":
                torque = against([f"(w{i}{'' if other == 'ground' else f' - {other}.w{i}'})" for i in "xyz"])
                damper = self._name(f"{name}_damping", "reaction")
                self._sections["forces"][damper] = {"kind": "load", "body": body, "torque": torque}

    def _add_loop(self, loop: Loop) -> None:
        first, second = (self.carriers[link] for link in loop.links)
        if first == second:
            loop.node.refuse(f"connects {loop.links[0]} and {loop.links[1]}, which are one body", "leave it out")
        here = self._closed.poses[loop.links[0]] @ loop.first
        element: dict[str, Any] = {"kind": loop.kind, "bodies": [first, second], "at": _vector(here.place)}
        if loop.kind in _COORDINATE:
            element["axis"] = _direction(here.rotation @ loop.axis)
        name = self._own_name(loop.name, "loop")
        self._sections["joints"][name] = element
        if loop.stiffness and any(q.any() for q in self._closed.q.values()):
            loop.node.refuse("has a spring where a loop closes, whose zero position is unknown", "put it on another joint of the loop")
        self._resist(name, element, loop, np.zeros(1))

    def _law(self, relation: Relation) -> dict[str, Any]:
        """The ratio of a gear, or the law by which it bends, over coordinates that count from the design position."""
        ratios = [short(ratio, 15) for ratio in relation.ratios.values()]
        if not relation.higher_terms:
            return {"ratio": ratios[0] if len(ratios) == 1 else ratios}
        whole = np.polynomial.Polynomial([0.0, *ratios, *relation.higher_terms])
        (independent,) = relation.ratios
        here = whole(np.polynomial.Polynomial([float(self._closed.q[independent][0]), 1.0]))
        coefficients = [0.0, *here.coef[1:]]
        return {"law": {"polynomial": [short(c, 15) for c in coefficients], "of": "position"}}

    def _add_drive(self, drive: Drive) -> None:
        joints = [self._robot.joints[joint] for joint in drive.joints]
        if any(joint.kind not in _COORDINATE or joint.name not in self.joints for joint in joints):
            self._note("drives left out, since their joint has no coordinate of its own", drive.name)
            return
        name = self._own_name(drive.name, "input") if drive.gain else drive.name
        unit = {"unit": "N*m" if joints[0].kind == "revolute" else "N"} if drive.is_plain and not drive.tendon else {}
        if drive.gain:
            self._sections["parameters"][name] = {"value": 0, **unit, "binding": "input"}
        laws = self._tendon_laws(drive, name) if drive.tendon else {drive.joint: drive.law(name, float(self._closed.q[drive.joint][0]))}
        for joint, law in laws.items():
            force = self._name(f"{self.joints[joint]}_motor")
            self._sections["forces"][force] = {"kind": "joint_force", "joint": self.joints[joint], "law": law}
            self._sections["outputs"][self._coordinate(joint)] = True

    def _add_spring(self, spring: Spring) -> None:
        ends = (spring.first, spring.second)
        first, second = (_vector(self._closed.poses[link].rotation @ place + self._closed.poses[link].place) for link, place in ends)
        parts = [*([f"{spring.stiffness!r}*(length - {short(spring.rest)!r})"] if spring.stiffness else []),
                 *([f"{spring.damping!r}*rate"] if spring.damping else [])]  # fmt: skip
        bodies = [self.carriers[link] for link, _ in ends]
        if bodies[0] != bodies[1]:
            force = {"kind": "point_spring", "bodies": bodies, "from": first, "to": second, "law": " + ".join(parts)}
            self._sections["forces"][self._name(spring.name, "spring")] = force

    def _tendon_laws(self, drive: Drive, name: str) -> dict[str, str]:
        """The laws by joints of a drive on a tendon, whose force is a signal."""
        ways = [" + ".join(f"{short(k)!r}*{self._coordinate(j)}{end}" for j, k in drive.tendon.items()) for end in ("", "_rate")]
        here = sum(k * float(self._closed.q[j][0]) for j, k in drive.tendon.items())
        signal = self._name(f"{name}_pull")
        self._sections["signals"][signal] = drive.law(name, here, *(f"({way})" for way in ways)).replace("+ -", "- ")
        return {joint: f"{short(k)!r}*{signal}" for joint, k in drive.tendon.items()}


def _legal(name: str) -> str:
    """A name of the model file, "" if no letter is left."""
    plain = re.sub(r"_+", "_", re.sub(r"[^A-Za-z0-9]", "_", name)).strip("_")
    plain = plain if plain[:1].isalpha() or not plain else f"n{plain}"
    plain = plain[:MAX_NAME_LENGTH].rstrip("_")
    return "" if not plain or name_problem(plain) else f"{plain}_0" if plain in RESERVED_EVERYWHERE or plain.lower() in _WORDS else plain


def _vector(place: Array) -> list[float | int]:
    return [short(x) if abs(x) > _NOISE else 0 for x in place]


def _direction(axis: Array) -> str | list[float | int]:
    """A direction by an axis' name where it is one, else by its components."""
    for i, name in enumerate("xyz"):
        if np.abs(np.delete(axis, i)).max() < _STRAIGHT:
            return name if axis[i] > 0 else f"-{name}"
    for _ in range(_TRIALS):  # of length one, it shall be written the same again
        kept = _vector(axis)
        axis = np.array(kept) / np.linalg.norm(kept)
        if _vector(axis) == kept:
            break
    return kept


def _frame(rotation: Array) -> tuple[str | list[float | int], str | list[float | int]]:
    """The first two axes of a rotation (3 by 3). Orthogonalising the second one against the first leaves its written numbers unchanged."""
    first, y = _direction(rotation[:, 0]), rotation[:, 1]
    x = rotation[:, 0] if isinstance(first, str) else np.array(first) / np.linalg.norm(first)
    second = _direction(y)
    for _ in range(_TRIALS):
        y = y - (x @ y) * x
        again = _direction(y / np.linalg.norm(y))
        if again == second or isinstance(again, str):
            break
        second, y = again, np.array(again)
    return first, second


def _inertia(matrix: Array, noise: float) -> list[float | int]:
    """The six entries of a matrix of inertia, or three; small ones have fewer digits, since axes turned to and fro leave no more."""
    decimals = 13 - int(np.floor(np.log10(np.abs(matrix).max())))
    entries = [round(matrix[i, j], decimals) for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
    kept = [short(x) if abs(x) > noise else 0 for x in entries]
    return kept if any(kept[3:]) else kept[:3]


def _shaft(matrix: Array, noise: float) -> list[float | int] | dict[str, Any]:
    """The inertia of a body without mass, by its axis where it has one."""
    moments, axes = np.linalg.eigh(matrix)
    if np.abs(moments[:2]).max() > _NOISE * moments[2]:
        return _inertia(matrix, noise)
    axis = forward(axes[:, 2])
    return {"axial": short(moments[2]), "axis": _direction(axis)}


def _flow(value: Any) -> str:
    """A value as YAML in one line."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key}: {_flow(part)}" for key, part in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(_flow, value)) + "]"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return value if re.fullmatch(r"-?[A-Za-z][A-Za-z0-9_./]*", value) else json.dumps(value)
    return repr(int(value)) if float(value).is_integer() and abs(value) < 1e15 else repr(float(value))


@dataclass(frozen=True)
class Imported:
    """The ``text`` of a model file; ``notes`` are sentences of decisions, ``left_out`` counts tags and attributes that were not taken.
    ``bodies`` and ``joints`` have the model's names by those of the file; ``zero`` has the file's coordinates of joints, rad and m,
    without their references, where the model's are zero."""

    text: str
    notes: tuple[str, ...]
    left_out: dict[str, int]
    bodies: Mapping[str, str]
    joints: Mapping[str, str]
    zero: Mapping[str, Array]


def import_file(path: Path, *, free: bool = False, folder: Path | None = None, model: str = "") -> Imported:
    """A file of another program as a model file; with ``free`` its base moves freely, else as the file says, by default on the ground.
    Files that it names are below a ``folder``, that of the file otherwise, and so are paths of its pictures. ``model`` is one of an SDF.
    Raises ModelError, with places in the file, for what is wrong in it or cannot be said in a model file."""
    folder = folder or path.parent
    match READERS.get(path.suffix.lower()):
        case "URDF":
            robot, root = read_urdf(path)
        case "SDF":
            robot, root = read_sdf(path, model)
        case _:
            robot, root = read_mjcf(path, folder)
    robot.leave_out_idle()
    robot.join_balls()
    closed = close(robot)
    document = Document(robot, closed, folder, free=free)
    left_out = dict(root.left_out())
    text = document.text(path.name, left_out)
    return Imported(text, tuple(document.notes), left_out, document.bodies, document.joints, closed.q)
