"""MJCF, as MuJoCo's own compiler understands it: defaults, frames, includes and attachments are its business.

What is read is the compiled model, so angles count from its ``qpos0``, where bodies stand as the file draws them.  MuJoCo closes loops by
springs; here they are rigid.
"""

from collections.abc import Callable
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np

from cutjoint.importing.closing import CLOSED
from cutjoint.importing.mjcf_files import compile_mjcf, elements
from cutjoint.importing.robot import Array, Coupling, Drive, Joint, Link, Loop, Pose, Robot, Spring, colour_of, of_quaternion, unique_name
from cutjoint.importing.xml import Node, read_xml

_FREE, _BALL, _SLIDE, _HINGE = range(4)
_CONNECT, _WELD, _JOINT, _TENDON = range(4)
#: Flags of <option> that switch parts of a model off, and the resistances of joints that they switch off.
_FLAGS = ("GRAVITY", "SPRING", "DAMPER", "FRICTIONLOSS", "CONSTRAINT", "EQUALITY", "ACTUATION", "CLAMPCTRL")
_SWITCHES = {"stiffness": {"SPRING"}, "damping": {"DAMPER"}, "friction": {"FRICTIONLOSS", "CONSTRAINT"}}


def read_mjcf(path: Path, folder: Path) -> tuple[Robot, Node]:
    """The robot of an MJCF file, which may name files in a folder. Raises ModelError: the file is wrong, names a file outside the folder,
    or says what a model file cannot; MissingPackageError: MuJoCo is not installed."""
    root = read_xml(path)
    if root.tag != "mujoco":
        root.refuse("is no MJCF", "name a file whose outermost element is <mujoco>; files of other formats end in .urdf or .sdf")
    model, absent = compile_mjcf(path, root, folder)
    import mujoco

    _mark_as_read(root)
    robot = _Reading(model, root, mujoco).robot
    if absent:
        names = ", ".join(absent)
        robot.notes.append(f"meshes and textures that are not there, or not below the folder of the file, are not drawn: {names}")
    return robot, root


def _mark_as_read(node: Node) -> None:
    """Count all below an element as read: MuJoCo has read it, and `_Reading` says what has no place in a model file."""
    for name in node.attributes:
        node.get(name)
    for child in node.children:
        node.all(child.tag)
        _mark_as_read(child)


class _Reading:
    """A compiled model of MuJoCo as a robot.  ``_of_joint`` has the names of joints by their number there."""

    def __init__(self, model: Any, root: Node, mujoco: Any) -> None:
        self.m, self._root, self._mujoco = model, root, mujoco
        self._nodes = {(node.tag, node.attributes.get("name", "")): node for node in elements(root)}
        self._equalities = [child for node in elements(root) if node.tag == "equality" for child in node.children]
        self._links = self._names("BODY", model.nbody, lambda i: f"body_{i}" if i else "world")
        self._joints = self._names("JOINT", model.njnt, lambda j: f"{self._links[model.jnt_bodyid[j]]}_joint")
        self._fresh = [*self._links, *self._joints]
        self._off = {flag for flag in _FLAGS if model.opt.disableflags & int(getattr(mujoco.mjtDisableBit, f"mjDSBL_{flag}"))}
        self._of_joint: dict[int, str] = {}
        self._start: dict[str, float] = {}
        self._pulled = set[int]()
        x, y, z = map(float, model.opt.gravity) if "GRAVITY" not in self._off else (0.0, 0.0, 0.0)
        self.robot = Robot(root.attributes.get("model") or "mujoco", gravity=(x, y, z))
        self.robot.links[self._links[0]] = Link(self._links[0], root)
        for body in range(1, model.nbody):
            self._add_body(body)
        for site in range(model.nsite):
            self._add_site(site)
        self._add_loops()
        for actuator in range(model.nactuator):
            self._add_actuator(actuator)
        self._add_resisting_tendons()
        self.robot.references = {name: start for name, start in self._start.items() if start}
        self._add_starts()
        self._add_notes()

    def _name(self, kind: str, index: int, default: str) -> str:
        found = self._mujoco.mj_id2name(self.m, getattr(self._mujoco.mjtObj, f"mjOBJ_{kind}"), index)
        return found or default

    def _names(self, kind: str, count: int, default: Callable[[int], str]) -> list[str]:
        """The names of all elements of a kind, with defaults that no other one has for those without a name."""
        found = [self._name(kind, i, "") for i in range(count)]
        taken = list(found)
        return [name or self._unique_name(default(i), taken) for i, name in enumerate(found)]

    def _unique_name(self, wanted: str, taken: list[str]) -> str:
        taken.append(unique_name(wanted, taken))
        return taken[-1]

    def _node(self, tag: str, name: str) -> Node:
        return self._nodes.get((tag, name), self._root)

    def _equality(self, i: int) -> Node:
        """The element of an equality, which need not have a name; other files may have some too."""
        return self._equalities[i] if len(self._equalities) == self.m.neq else self._root

    # bodies and joints

    def _add_body(self, body: int) -> None:
        m, name = self.m, self._links[body]
        link = Link(name, self._node("body", name), float(m.body_mass[body]), m.body_ipos[body].copy())
        turn = of_quaternion(*map(float, m.body_iquat[body]))
        link.inertia = turn @ np.diag(m.body_inertia[body]) @ turn.T
        self._draw(link, body)
        parent, at = self._links[m.body_parentid[body]], Pose(of_quaternion(*map(float, m.body_quat[body])), m.body_pos[body].copy())
        first, count = int(m.body_jntadr[body]), int(m.body_jntnum[body])
        if not count:
            weld = Joint(self._unique_name(f"{name}_weld", self._fresh), link.node, "fixed", parent, name, at)
            self.robot.joints[weld.name] = weld
        for joint in range(first, first + count):
            child = name if joint == first + count - 1 else self._unique_name(f"{name}_{joint - first + 1}", self._fresh)
            if child != name:
                self.robot.links[child] = Link(child, link.node)
            self._add_joint(joint, parent, child, at)
            parent, at = child, Pose()
        self.robot.links[name] = link

    def _add_joint(self, joint: int, parent: str, child: str, at: Pose) -> None:
        m, kind = self.m, int(self.m.jnt_type[joint])
        name = self._joints[joint]
        place = Pose(place=np.zeros(3) if kind == _FREE else m.jnt_pos[joint].copy())
        added = Joint(
            name, self._node("joint", name), {_FREE: "free", _BALL: "spherical", _SLIDE: "prismatic", _HINGE: "revolute"}[kind],
            parent, child, at @ place, m.jnt_axis[joint] / np.linalg.norm(m.jnt_axis[joint]), place.inverse(),
        )  # fmt: skip
        dof, address = int(m.jnt_dofadr[joint]), int(m.jnt_qposadr[joint])
        resisting = {"damping": m.dof_damping[dof], "friction": m.dof_frictionloss[dof], "stiffness": m.jnt_stiffness[joint]}
        for key, value in resisting.items():
            setattr(added, key, 0.0 if self._off & _SWITCHES[key] else float(value))
        added.armature = float(m.dof_armature[dof])
        higher = (m.jnt_stiffnesspoly[joint], "SPRING"), (m.dof_dampingpoly[dof], "DAMPER"), (m.jnt_springyield[joint], "SPRING")
        if any(np.any(value) and flag not in self._off for value, flag in higher):
            added.node.refuse("has a spring or a damper that is not linear", "leave out the higher coefficients")
        if kind in (_SLIDE, _HINGE):
            self._start[name] = float(m.qpos0[address])
            added.rest = float(m.qpos_spring[address]) - self._start[name]
        elif kind == _FREE and added.stiffness:
            added.node.refuse("has a spring on a free joint", "leave it out")
        self._of_joint[joint] = name
        self.robot.joints[name] = added

    def _add_site(self, site: int) -> None:
        m = self.m
        if name := self._name("SITE", site, ""):
            link = Link(self._unique_name(name, self._fresh), self._node("site", name))
            place = Pose(of_quaternion(*map(float, m.site_quat[site])), m.site_pos[site].copy())
            weld = self._unique_name(f"{link.name}_place", self._fresh)
            self.robot.links[link.name] = link
            self.robot.joints[weld] = Joint(weld, link.node, "fixed", self._links[int(m.site_bodyid[site])], link.name, place)

    def _draw(self, link: Link, body: int) -> None:
        m, first = self.m, int(self.m.body_geomadr[body])
        for geom in range(first, first + int(m.body_geomnum[body])):
            if int(m.geom_type[geom]) == int(self._mujoco.mjtGeom.mjGEOM_MESH) and not link.mesh:
                mesh = int(m.geom_dataid[geom])
                path = bytes(m.paths[m.mesh_pathadr[mesh] :]).split(b"\0")[0].decode(errors="replace") if m.mesh_pathadr[mesh] >= 0 else ""
                scale = m.mesh_scale[mesh]
                if not path or not scale[0] == scale[1] == scale[2] > 0:
                    continue
                centred = Pose(of_quaternion(*map(float, m.mesh_quat[mesh])), m.mesh_pos[mesh].copy())
                geometry = Pose(of_quaternion(*map(float, m.geom_quat[geom])), m.geom_pos[geom].copy())
                link.mesh, link.scale, link.mesh_pose = self._path(path), float(scale[0]), geometry @ centred.inverse()
                link.colour = colour_of([str(part) for part in m.geom_rgba[geom]])

    def _path(self, path: str) -> str:
        folders = {node.attributes.get(key, "") for node in elements(self._root) for key in ("meshdir", "assetdir")} - {""}
        return "/".join([*sorted(folders)[:1], path])

    # relations

    def _add_loops(self) -> None:
        points: dict[tuple[str, str], list[Loop]] = {}
        tendons: list[tuple[int, str]] = []
        for i in range(self.m.neq if not self._off & {"EQUALITY", "CONSTRAINT"} else 0):
            kind, name = int(self.m.eq_type[i]), self._name("EQUALITY", i, f"equality_{i + 1}")
            if not self.m.eq_active0[i]:
                self.robot.notes.append(f"the equality {name} is not active, and left out")
            elif kind in (_CONNECT, _WELD):
                loop = self._loop(i, kind, name)
                pair = loop.links if loop.links[0] < loop.links[1] else loop.links[::-1]
                if kind == _CONNECT:
                    points.setdefault((pair[0], pair[1]), []).append(loop)
                else:
                    self.robot.loops.append(loop)
            elif kind == _JOINT:
                self._add_coupling(i, name)
            elif kind == _TENDON:
                tendons.append((i, name))
            else:
                self._equality(i).refuse(f"is the equality '{name}' of a kind that a model file has not", "leave it out")
        for i, name in tendons:
            self._couple_tendons(i, name)
        for pairs in points.values():
            self.robot.loops.append(_merge_connects(pairs) if len(pairs) > 1 else pairs[0])

    def _loop(self, i: int, kind: int, name: str) -> Loop:
        m, data = self.m, self.m.eq_data[i]
        ids = int(m.eq_obj1id[i]), int(m.eq_obj2id[i])
        node = self._equality(i)
        if int(m.eq_objtype[i]) == int(self._mujoco.mjtObj.mjOBJ_SITE):
            frames = [Pose(of_quaternion(*map(float, m.site_quat[s])), m.site_pos[s].copy()) for s in ids]
            bodies = [int(m.site_bodyid[s]) for s in ids]
        else:
            bodies = list(ids)
            if kind == _CONNECT:
                frames = [Pose(place=data[:3].copy()), Pose(place=data[3:6].copy())]
            else:
                frames = [Pose(of_quaternion(*map(float, data[6:10])), data[3:6].copy()), Pose(place=data[:3].copy())]
        links = self._links[bodies[0]], self._links[bodies[1]]
        return Loop(name, node, "spherical" if kind == _CONNECT else "fixed", links, frames[0], frames[1])

    def _add_coupling(self, i: int, name: str) -> None:
        m, node = self.m, self._equality(i)
        first = self._of_joint[int(m.eq_obj1id[i])]
        second = "" if int(m.eq_obj2id[i]) < 0 else self._of_joint[int(m.eq_obj2id[i])]
        constant, slope, *higher_terms = map(float, m.eq_data[i][:5])
        if not second or (slope == 0 and not any(higher_terms)):
            joint = self.robot.joints[first]
            held = joint.moved(np.array([constant])) @ joint.inner.inverse()
            joint.origin, joint.kind = held, "fixed"
            joint.stiffness = joint.damping = joint.friction = joint.armature = 0.0
            self._start.pop(first)
            self.robot.notes.append(f"{first} is fixed, since the equality {name} holds it still")
            return
        coupling = Coupling(name, node, {first: 1.0, second: -slope}, constant)
        if any(higher_terms):
            coupling.independent, coupling.higher_terms = second, tuple(higher_terms)
        self.robot.couplings.append(coupling)

    def _couple_tendons(self, i: int, name: str) -> None:
        """Equalities of fixed tendons are linear relations of coordinates."""
        m, node, terms = self.m, self._equality(i), dict[str, float]()
        for sign, tendon in ((1.0, int(m.eq_obj1id[i])), (-float(m.eq_data[i][1]), int(m.eq_obj2id[i]))):
            if tendon < 0:
                continue
            if not (found := self._fixed_tendon(tendon)):
                node.refuse("couples a tendon that runs through space", "a model file has tendons of fixed length ratios only")
            for joint, factor in found.items():
                terms[joint] = terms.get(joint, 0.0) + sign * factor
        if any(m.eq_data[i][2:5]):
            node.refuse("is a tendon's equality with a polynomial", "write it for joints")
        self.robot.couplings.append(Coupling(name, node, terms, float(m.eq_data[i][0])))

    def _add_actuator(self, i: int) -> None:
        m, enums = self.m, self._mujoco
        name = self._name("ACTUATOR", i, f"motor_{i + 1}")
        kind, target = int(m.actuator_trntype[i]), int(m.actuator_trnid[i][0])
        of_joint = kind in (int(enums.mjtTrn.mjTRN_JOINT), int(enums.mjtTrn.mjTRN_JOINTINPARENT))
        tendon = self._fixed_tendon(target) if kind == int(enums.mjtTrn.mjTRN_TENDON) else {}
        kinds = int(m.actuator_dyntype[i]), int(m.actuator_gaintype[i])
        direct = kinds == (int(enums.mjtDyn.mjDYN_NONE), int(enums.mjtGain.mjGAIN_FIXED))
        bias = int(m.actuator_biastype[i])
        gear, control = float(m.actuator_gear[m.actuator_outadr[i]][0]), int(m.actuator_ctrladr[i])
        if of_joint:
            loaded = self.robot.joints[self._of_joint[target]]  # by the rotor and its damping, seen through the gear
            if np.any(m.actuator_dampingpoly[i]):
                loaded.node.refuse("has an actuator with a damper that is not linear", "leave out the higher coefficients")
            loaded.armature += gear**2 * float(m.actuator_armature[i])
            loaded.damping += gear**2 * float(m.actuator_damping[i]) if "DAMPER" not in self._off else 0.0
            if loaded.kind not in ("revolute", "prismatic") and (m.actuator_armature[i] or m.actuator_damping[i]):
                loaded.node.refuse(f"has an actuator with armature or damping on a joint of kind {loaded.kind}", "leave it out")
        elif tendon and (m.actuator_armature[i] or np.any(m.actuator_damping[i])):
            self._node("general", name).refuse("is an actuator with armature or damping on a tendon", "leave them out")
        off = "ACTUATION" in self._off or bool(m.opt.disableactuator >> int(m.actuator_group[i]) & 1)
        reason = (
            "it is switched off" if off else "it has a delay" if m.actuator_delay[i]
            else "it has several controls" if m.actuator_ctrlnum[i] != 1
            else "it has dynamics of its own, or acts on no joint or fixed tendon"
        )  # fmt: skip
        direct = direct and not m.actuator_delay[i] and not off and m.actuator_ctrlnum[i] == m.actuator_outnum[i] == 1
        if not ((of_joint or tendon) and direct and bias in (int(enums.mjtBias.mjBIAS_NONE), int(enums.mjtBias.mjBIAS_AFFINE))):
            self.robot.notes.append(f"the actuator {name} is left out: {reason}")
            return
        if tendon:
            self._pulled.add(target)
        joint = next(iter(tendon)) if tendon else self._of_joint[target]
        offset = sum(k * self._start[j] for j, k in tendon.items()) if tendon else self._start.get(joint, 0.0)
        drive = Drive(name, joint, gear, float(m.actuator_gainprm[i][0]), offset=offset, tendon=tendon)
        if bias:
            drive.bias, drive.stiffness, drive.damping = (float(x) * k for x, k in zip(m.actuator_biasprm[i][:3], (1, -1, -1), strict=True))
        if m.actuator_ctrllimited[control] and "CLAMPCTRL" not in self._off:
            drive.controls = float(m.actuator_ctrlrange[control][0]), float(m.actuator_ctrlrange[control][1])
        if m.actuator_forcelimited[i]:
            drive.forces = float(m.actuator_forcerange[i][0]), float(m.actuator_forcerange[i][1])
        self.robot.drives.append(drive)

    def _fixed_tendon(self, tendon: int) -> dict[str, float]:
        """The coefficients of a tendon by its joints, {} where it runs through space."""
        m, terms = self.m, dict[str, float]()
        for wrap in range(int(m.tendon_adr[tendon]), int(m.tendon_adr[tendon] + m.tendon_num[tendon])):
            if int(m.wrap_type[wrap]) != int(self._mujoco.mjtWrap.mjWRAP_JOINT):
                return {}
            joint = self._of_joint[int(m.wrap_objid[wrap])]
            terms[joint] = terms.get(joint, 0.0) + float(m.wrap_prm[wrap])
        return terms

    def _add_starts(self) -> None:
        m = self.m
        for key in range(m.nkey):
            start = {name: float(m.key_qpos[key][int(m.jnt_qposadr[j])]) - self._start[name]
                     for j, name in self._of_joint.items() if name in self._start}  # fmt: skip
            name = self._name("KEY", key, f"key_{key + 1}")
            self.robot.starts[name] = start
            others = [i for j in self._of_joint if m.jnt_type[j] in (_FREE, _BALL) for i in range(*self._places(j))]
            left = {"positions of free bodies and balls": np.any(m.key_qpos[key][others] != m.qpos0[others]),
                    "speeds": np.any(m.key_qvel[key]), "controls": np.any(m.key_ctrl[key])}  # fmt: skip
            if found := [word for word, is_there in left.items() if is_there]:
                self.robot.notes.append(f"of the key {name} are left out: {', '.join(found)}")

    def _places(self, joint: int) -> tuple[int, int]:
        first = int(self.m.jnt_qposadr[joint])
        return first, first + {_FREE: 7, _BALL: 4}[int(self.m.jnt_type[joint])]

    def _add_notes(self) -> None:
        m, notes = self.m, self.robot.notes
        if self.robot.loops:
            notes.append("loops, which MuJoCo closes by springs, are rigid")
        counts = {
            "limits of joints": int(np.sum(m.jnt_limited)), "limits of the forces of actuators on joints": int(np.sum(m.jnt_actfrclimited)),
            "geoms that collide": int(np.sum((m.geom_contype != 0) | (m.geom_conaffinity != 0))),
            "sites without names": sum(not self._name("SITE", i, "") for i in range(m.nsite)), "sensors": m.nsensor,
            "cameras": m.ncam, "lights": m.nlight, "contact pairs": m.npair, "flexible bodies": m.nflex,
            "skins": m.nskin, "mocap bodies, which are fixed here": m.nmocap,
        }  # fmt: skip
        if found := [f"{what} ({count})" for what, count in counts.items() if count]:
            notes.append(f"left out: {', '.join(found)}")
        held = {int(i) for of in (m.eq_obj1id, m.eq_obj2id) for i in of[m.eq_type == _TENDON]}
        idle = [self._name("TENDON", i, f"tendon_{i + 1}") for i in range(m.ntendon) if i not in held | self._pulled]
        if idle:
            notes.append(f"left out with their limits, since no equality and no imported actuator uses them: tendons {', '.join(idle)}")
        if m.opt.density or m.opt.viscosity:
            notes.append("left out: forces of the medium (density, viscosity)")
        for body in np.flatnonzero(m.body_gravcomp):
            self._node("body", self._links[body]).refuse("has gravcomp", "leave it out, or write it as loads")

    def _add_resisting_tendons(self) -> None:
        """Springs and dampers along fixed tendons, and along straight ones between two sites."""
        m = self.m
        for i in range(m.ntendon):
            stiffness, damping = (0.0 if flag in self._off else float(value) for value, flag in (
                (m.tendon_stiffness[i], "SPRING"), (m.tendon_damping[i], "DAMPER")))  # fmt: skip
            others = any(np.any(getattr(m, f"tendon_{name}")[i]) for name in ("stiffnesspoly", "dampingpoly", "armature", "frictionloss"))
            if not (stiffness or damping or others):
                continue
            name, (rest, most) = self._name("TENDON", i, f"tendon_{i + 1}"), map(float, m.tendon_lengthspring[i])
            wraps = slice(int(m.tendon_adr[i]), int(m.tendon_adr[i] + m.tendon_num[i]))
            sites = [int(site) for site in m.wrap_objid[wraps]]
            if others or (stiffness and rest != most):
                self._tendon(i).refuse("is a tendon with friction, armature, slack or a spring that is not linear", "leave it out")
            if tendon := self._fixed_tendon(i):
                offset = sum(k * self._start.get(j, 0.0) for j, k in tendon.items())
                drive = Drive(name, next(iter(tendon)), 1.0, 0.0, stiffness * rest, stiffness, damping, offset=offset, tendon=tendon)
                self.robot.drives.append(drive)
            elif len(sites) == 2 and all(m.wrap_type[wraps] == int(self._mujoco.mjtWrap.mjWRAP_SITE)):
                first, second = ((self._links[int(m.site_bodyid[site])], m.site_pos[site].copy()) for site in sites)
                self.robot.springs.append(Spring(name, first, second, stiffness, damping, rest))
            else:
                self._tendon(i).refuse("is a tendon with a spring or damper over more than two sites", "leave it out, or write springs")
            self._pulled.add(i)

    def _tendon(self, i: int) -> Node:
        name = self._name("TENDON", i, "")
        return self._nodes.get(("fixed", name)) or self._nodes.get(("spatial", name)) or self._root


def _merge_connects(loops: list[Loop]) -> Loop:
    """Several points in which two bodies are connected: a hinge through those of a line, else the bodies are one."""
    one = loops[0]
    mine = [loop.first.place if loop.links == one.links else loop.second.place for loop in loops]
    theirs = [loop.second.place if loop.links == one.links else loop.first.place for loop in loops]
    a, b = max(combinations(range(len(loops)), 2), key=lambda ij: float(np.linalg.norm(mine[ij[0]] - mine[ij[1]])))
    axis, other = (_unit(places[b] - places[a]) for places in (mine, theirs))
    if not axis.any():
        return one
    if not all(np.linalg.norm(np.cross(axis, place - mine[a])) < 1e-6 for place in mine):
        return _rigid(one, np.array(mine), np.array(theirs))
    along = [[float(way @ (place - places[a])) for place in places] for way, places in ((axis, mine), (other, theirs))]
    if np.abs(np.subtract(along[0], along[1])).max() > CLOSED:
        one.node.refuse("connects two bodies in points that are not as far apart on both", "correct the anchors")
    first, second = _frame_along(axis, mine[a]), _frame_along(other, theirs[a])
    return Loop(one.name, one.node, "revolute", one.links, first, second, np.array([0.0, 0.0, 1.0]))


def _rigid(loop: Loop, mine: Array, theirs: Array) -> Loop:
    """Three points or more of two bodies, (n, 3) each, that are on no line, hold them together wholly."""
    centres = mine.mean(axis=0), theirs.mean(axis=0)
    u, _, v = np.linalg.svd((theirs - centres[1]).T @ (mine - centres[0]))
    turn = u @ np.diag([1, 1, np.sign(np.linalg.det(u @ v))]) @ v
    if np.abs((theirs - centres[1]) @ turn - mine + centres[0]).max() > CLOSED:
        loop.node.refuse("connects two bodies in points that are not as far apart on both", "correct the anchors")
    return Loop(loop.name, loop.node, "fixed", loop.links, Pose(place=centres[0]), Pose(turn, centres[1]))


def _unit(vector: Array) -> Array:
    length = float(np.linalg.norm(vector))
    return vector / length if length > 1e-9 else np.zeros(3)


def _frame_along(axis: Array, place: Array) -> Pose:
    across = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    x = across / np.linalg.norm(across)
    return Pose(np.array([x, np.cross(axis, x), axis]).T, place)
