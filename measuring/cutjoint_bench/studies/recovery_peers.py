"""Runs of the models of `recovery` by other simulators, from the true values of their ten parameters.

press, delta, corner: bodies by Pinocchio (mass matrix, bias forces, Jacobians, reactions), loops by Lagrange multipliers of a dense system,
laws of forces and of friction written here, integrated by SciPy's DOP853 from sample to sample.  leg: MuJoCo, by its own RK4 with equal
steps; motors and friction are callbacks, bristles are activations.  Nothing of cutjoint is used.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from importlib.metadata import version
from typing import Any

import numpy as np
import pinocchio as pin  # type: ignore[import-untyped]
from numpy.typing import NDArray
from scipy.integrate import DOP853
from scipy.optimize import root

Array = NDArray[np.float64]

_X, _Y, _Z = np.eye(3)
_G = 9.81

#: Friction: the speed at which the damping of sticking saturates (m/s), the time of settling (s), and as documented the squared share of
#: the limit at which the bristle begins to slide, the share of that speed within which it reverses, its rounding and its slow yielding.
_DAMPING_SPEED, _SETTLING, _BREAKAWAY, _REVERSAL, _ROUNDING, _SLOWER = 0.01, 1e-3, 0.5, 1e-3, 1e-9, 100


def bristle(u: float, v: float, presliding: float) -> tuple[float, float]:
    """Friction by mu*load against a speed of the surfaces (m/s), and the rate of the bristle's share (1/s)."""
    force = -(u + (1 - u * u) / 2 * np.tanh(v / _DAMPING_SPEED))
    w2 = max((u * u - _BREAKAWAY) / (1 - _BREAKAWAY), 0.0) ** 2
    a = w2 / (1 + w2) * (1 + np.tanh(u * v / (_REVERSAL * _DAMPING_SPEED)))
    beyond = (u * u - 1 + np.hypot(u * u - 1, _ROUNDING)) / 2
    free = v / presliding
    rate = free * (1 - a) / (1 + 2 / (1 - _BREAKAWAY) * a * u * free * _SETTLING)
    return float(force), float(rate - u * beyond / (1 + u * u * beyond) / (_SLOWER * _SETTLING))


@dataclass(frozen=True)
class Friction:
    """Friction by load in a joint of one coordinate; of a slide the radius is 1."""

    joint: int
    axis: Array
    coefficient: float
    preload: float
    presliding: float
    radius: float = 1.0


@dataclass
class Machine:
    """Bodies of Pinocchio, where ``loops`` are functions of the machine that return rows (phi, Jacobian, bias of its acceleration)."""

    model: Any = field(default_factory=pin.Model)
    loops: list[Callable[[Machine], list[tuple[float, Array, float]]]] = field(default_factory=list)
    frictions: list[Friction] = field(default_factory=list)
    forces: Callable[[Machine, float], None] = lambda machine, t: None
    outputs: Callable[[Machine, float], list[float]] = lambda machine, t: []
    armature: Mapping[int, float] = field(default_factory=dict)

    def body(self, parent: int, joint: Any, at: Array, mass: float, centre: Array, inertia: Array) -> int:
        """The number of a body on a joint, whose frame has global axes in the design position; places are global."""
        placed = pin.SE3(np.eye(3), at - self.at[parent])
        number = self.model.addJoint(parent, joint, placed, f"joint{self.model.njoints}")
        self.at.append(at)
        matrix = np.diag(inertia) if np.ndim(inertia) == 1 else inertia
        self.model.appendBodyToJoint(number, pin.Inertia(mass, centre - at, matrix), pin.SE3.Identity())
        return int(number)

    def __post_init__(self) -> None:
        self.at, self.multipliers = [np.zeros(3)], iter(())
        self.model.gravity.linear = np.array([0, 0, -_G])

    @cached_property
    def data(self) -> Any:
        """What Pinocchio computes; bodies come before."""
        return self.model.createData()

    def place(self, q: Array, v: Array) -> None:
        """Compute all that points, loops and forces need."""
        self.q, self.v, self.wrenches = q, v, [np.zeros(6) for _ in self.at]
        pin.computeJointJacobians(self.model, self.data, q)
        pin.forwardKinematics(self.model, self.data, q, v, np.zeros(self.model.nv))
        self.turning = [pin.getJointJacobian(self.model, self.data, i, pin.ReferenceFrame.LOCAL) for i in range(self.model.njoints)]

    def point(self, body: int, at: Array) -> tuple[Array, Array, Array, Array]:
        """Place, velocity, Jacobian, and acceleration without that of coordinates, of a body's point given in the design position."""
        if body == 0:
            return at, np.zeros(3), np.zeros((3, self.model.nv)), np.zeros(3)
        p, R, J = at - self.at[body], self.data.oMi[body].rotation, self.turning[body]
        w, u, a = self.data.v[body].angular, self.data.v[body].linear, self.data.a[body]
        jacobian = R @ (J[:3] - pin.skew(p) @ J[3:])
        bias = a.linear + np.cross(a.angular, p) + np.cross(w, u + np.cross(w, p))
        return self.data.oMi[body].act(p), jacobian @ self.v, jacobian, R @ bias

    def push(self, body: int, place: Array, force: Array) -> None:
        """A force at a global place."""
        if body:
            M = self.data.oMi[body]
            local = M.rotation.T @ force
            self.wrenches[body] += np.concatenate([local, np.cross(M.actInv(place), local)])

    def between(self, base: int, follower: int, place: Array, force: Array) -> None:
        """A force on the follower, and its opposite on the base, at a global place."""
        self.push(follower, place, force)
        self.push(base, place, -force)

    def balance(self, t: float) -> tuple[Array, Array, Array, Array, Array]:
        """Mass matrix, forces on coordinates, constraints, their Jacobian and bias."""
        self.wrenches, self.torques = [np.zeros(6) for _ in self.at], np.zeros(self.model.nv)
        self.forces(self, t)
        rows = [row for loop in self.loops for row in loop(self)]
        phi, J, bias = (np.array([row[i] for row in rows]) for i in range(3))
        applied = self.torques + sum(self.turning[i].T @ w for i, w in enumerate(self.wrenches) if i)
        applied = applied - pin.rnea(self.model, self.data, self.q, self.v, np.zeros(self.model.nv))
        M = pin.crba(self.model, self.data, self.q)
        M = np.triu(M) + np.triu(M, 1).T
        for i, inertia in self.armature.items():
            M[i, i] += inertia
        return M, applied, phi, J, bias

    def accelerations(self, t: float, shares: Array) -> tuple[Array, Array]:
        """Accelerations, and rates of the bristles."""
        n = self.model.nv
        M, applied, _, J, bias = self.balance(t)
        speeds = [f.radius * self.v[self.model.joints[f.joint].idx_v] for f in self.frictions]
        laws = [bristle(u, v, f.presliding) for u, v, f in zip(shares, speeds, self.frictions, strict=True)]
        right = np.zeros((n + len(J), 1 + len(laws)))
        right[:n, 0], right[n:, 0] = applied, -bias
        for k, (f, (share, _)) in enumerate(zip(self.frictions, laws, strict=True)):
            right[self.model.joints[f.joint].idx_v, 1 + k] = f.coefficient * f.radius * share
        found = np.linalg.solve(np.block([[M, J.T], [J, np.zeros((len(J), len(J)))]]), right)
        if not laws:
            return found[:n, 0], np.zeros(0)
        wrenches = self.wrenches

        def reactions(x: Array) -> list[Array]:
            """Forces across the joints with friction."""
            self.loop_wrenches(wrenches, -x[n:])
            pin.rnea(self.model, self.data, self.q, self.v, x[:n], [pin.Force(w) for w in self.wrenches])
            across = [self.data.f[f.joint].linear for f in self.frictions]
            return [r - f.axis * (f.axis @ r) for r, f in zip(across, self.frictions, strict=True)]

        first = reactions(found[:, 0])
        units = [[a - b for a, b in zip(reactions(found[:, 0] + found[:, 1 + k]), first, strict=True)] for k in range(len(laws))]
        loads = np.array([f.preload for f in self.frictions])
        for _ in range(200):
            new = np.array([f.preload + np.linalg.norm(r + sum(N * unit[j] for N, unit in zip(loads, units, strict=True)))
                            for j, (f, r) in enumerate(zip(self.frictions, first, strict=True))])  # fmt: skip
            done = np.abs(new - loads).max() <= 1e-15 * np.abs(new).max()
            loads = new
            if done:
                break
        return found[:n, 0] + found[:n, 1:] @ loads, np.array([rate for _, rate in laws])

    def loop_wrenches(self, wrenches: Sequence[Array], multipliers: Array) -> None:
        """External wrenches with those of the loops."""
        self.wrenches = [w.copy() for w in wrenches]
        self.multipliers = iter(multipliers)
        for loop in self.loops:
            loop(self)
        self.multipliers = iter(())

    def at_rest(self) -> Array:
        """Coordinates of static equilibrium near the design position."""
        q0, n = pin.neutral(self.model), self.model.nv

        def equations(x: Array) -> Array:
            self.place(pin.integrate(self.model, q0, x[:n]), np.zeros(n))
            _, applied, phi, J, _ = self.balance(0.0)
            return np.concatenate([applied - J.T @ (scale * x[n:]), phi])

        self.place(q0, np.zeros(n))
        _, applied, phi, J, _ = self.balance(0.0)
        m, scale = len(phi), max(float(np.abs(applied).max()), 1.0)
        x = np.concatenate([np.zeros(n), np.linalg.lstsq(J.T, applied, rcond=None)[0] / scale])
        for _ in range(3):
            x = root(equations, x, tol=1e-15, options={"xtol": 1e-15}).x
        for _ in range(4):  # by a Jacobian of central differences
            step = 1e-6
            slope = np.array([(equations(x + step * e) - equations(x - step * e)) / (2 * step) for e in np.eye(n + m)]).T
            x = x - np.linalg.solve(slope, equations(x))
        return np.asarray(pin.integrate(self.model, q0, x[:n]))

    def run(self, times: Array, q: Array, v: Array, tolerance: float) -> Array:
        """Outputs at times, by DOP853 that starts anew at each; ``gap`` is then the largest violation of a loop."""
        nq, n, self.gap, self.evaluations = self.model.nq, self.model.nv, 0.0, 0

        def rate(t: float, y: Array) -> Array:
            self.evaluations += 1
            q, v = pin.normalize(self.model, y[:nq]), y[nq:nq + n]
            self.place(q, v)
            vdot, sdot = self.accelerations(t, y[nq + n:])
            return np.concatenate([self.qdot(q, v), vdot, sdot])

        y, h, found = np.concatenate([q, v, np.zeros(len(self.frictions))]), None, []
        for i, t in enumerate(times):
            if i:
                first: Any = min(h, t - times[i - 1]) if h else None
                solver = DOP853(rate, times[i - 1], y, t, first_step=first, rtol=tolerance, atol=tolerance)
                while solver.status == "running":
                    before = solver.h_abs
                    solver.step()
                y, h = solver.y, max(before, solver.h_abs) if solver.h_abs else before
            self.place(pin.normalize(self.model, y[:nq]), y[nq:nq + n])
            self.gap = max([self.gap, *(abs(row[0]) for loop in self.loops for row in loop(self))])
            found.append(self.outputs(self, float(t)))
        return np.array(found).T

    def qdot(self, q: Array, v: Array) -> Array:
        """Rates of coordinates, quaternions among them."""
        found = []
        for joint in self.model.joints[1:]:
            a, b = q[joint.idx_q:joint.idx_q + joint.nq], v[joint.idx_v:joint.idx_v + joint.nv]
            if joint.nq == joint.nv:
                found.append(b)
                continue
            x, y, z, s = a[-4:]
            w = b[-3:]
            turn = pin.Quaternion(s, x, y, z).toRotationMatrix()
            found += [turn @ b[:3]] if joint.nv == 6 else []
            found.append(np.concatenate([s * w + np.cross(a[-4:-1], w), [-(a[-4:-1] @ w)]]) / 2)
        return np.concatenate(found)

    def same(self, rows: Array, first: tuple[int, Array], second: tuple[int, Array]) -> None:
        """A loop: two points agree along rows (n, 3) of global axes."""

        def loop(machine: Machine) -> list[tuple[float, Array, float]]:
            (p, _, J, a), (p2, _, J2, a2) = machine.point(*first), machine.point(*second)
            for row in rows:
                machine.between(first[0], second[0], p2, next(machine.multipliers, 0.0) * row)
            return [(float(row @ (p2 - p)), row @ (J2 - J), float(row @ (a2 - a))) for row in rows]

        self.loops.append(loop)

    def distance(self, first: tuple[int, Array], second: tuple[int, Array]) -> None:
        """A loop: the distance of two points is that of the design position."""
        length = float(np.linalg.norm(second[1] - first[1]))

        def loop(machine: Machine) -> list[tuple[float, Array, float]]:
            (p, u, J, a), (p2, u2, J2, a2) = machine.point(*first), machine.point(*second)
            d, r = (p2 - p) / length, (u2 - u)
            machine.between(first[0], second[0], p2, next(machine.multipliers, 0.0) * d)
            return [((length * float(d @ d) - length) / 2, d @ (J2 - J), float(d @ (a2 - a) + r @ r / length))]

        self.loops.append(loop)


def press(x: Mapping[str, float]) -> Machine:
    """The press: crank and rod on one tree, the slider on another, the wrist as loop."""
    m, A, B, C = Machine(), np.array([0, 0, x["A.z"]]), np.array([x["B.x"], 0, 0]), np.array([0.8, 0, 0])
    crank = m.body(0, pin.JointModelRY(), np.zeros(3), 2.0, A / 2, np.array([0.002, x["crank.inertia.1"], 0.001]))
    rod = m.body(crank, pin.JointModelRY(), A, x["rod.mass"], (A + B) / 2, np.array([0.001, 0.008, 0.008]))
    slider = m.body(0, pin.JointModelPX(), B, x["slider.mass"], B, np.zeros(3))
    m.same(np.array([_X, _Z]), (rod, B), (slider, B))
    m.frictions = [
        Friction(slider, _X, x["rail_friction.coefficient"], 20.0, 1e-3),
        Friction(crank, _Y, x["bearing.coefficient"], 60.0, 1e-3, radius=0.05),
    ]

    def spring(m: Machine) -> float:
        p, v, *_ = m.point(slider, B)
        return float(x["stiffness"] * (C[0] - p[0] - x["spring.law.free_length"]) - x["spring.law.damping"] * v[0])

    m.forces = lambda m, t: m.push(slider, m.point(slider, B)[0], spring(m) * _X)
    m.outputs = lambda m, t: [float(m.point(slider, B)[0][0]), float(m.q[0]), spring(m)]
    return m


def delta(x: Mapping[str, float]) -> Machine:
    """The delta robot: a free plate, three arms with armatures, six rods as distances."""
    m, out, drop, w, r, arm, R = Machine(), 0.14, 0.45, 0.04, 0.05, x["arm"], x["R"]
    centre = -drop * _Z
    plate = m.body(0, pin.JointModelFreeFlyer(), centre, x["plate.mass"], centre, np.array([1e-3, 1e-3, 2e-3]))
    arms, inputs = [], (0.0, -2 * np.pi / 3, 2 * np.pi / 3)
    for a in (0.0, np.deg2rad(120), np.deg2rad(240)):
        along, across = np.array([np.cos(a), np.sin(a), 0]), np.array([-np.sin(a), np.cos(a), 0])
        S, E = R * along, (R + out) * along - np.sqrt(arm**2 - out**2) * _Z
        e = (E - S) / np.linalg.norm(E - S)
        thin, thick = x["upper"] * 0.01**2 / 2, x["upper"] * (3 * 0.01**2 + arm**2) / 12
        inertia = thin * np.outer(e, e) + thick * (np.eye(3) - np.outer(e, e))
        arms.append(m.body(0, pin.JointModelRevoluteUnaligned(across), S, x["upper"], (S + E) / 2, inertia))
        for side in (1, -1):
            m.distance((arms[-1], E + side * w * across), (plate, r * along - drop * _Z + side * w * across))
    velocities = [m.model.joints[i].idx_v for i in arms]
    m.armature = dict.fromkeys(velocities, x["rotor"])

    def motor(m: Machine, t: float, k: int) -> float:
        q, rate = m.q[m.model.joints[arms[k]].idx_q], m.v[velocities[k]]
        return float(x["kp"] * (0.3 * np.sin(6 * t + inputs[k]) - q) - x["kd"] * rate - x["lift"])

    def forces(m: Machine, t: float) -> None:
        for k, i in enumerate(velocities):
            q, rate = m.q[m.model.joints[arms[k]].idx_q], m.v[i]
            if not np.deg2rad(-40) < q < np.deg2rad(60):
                raise ValueError("an arm meets its stop, which this model lacks")
            m.torques[i] += motor(m, t, k) - x["viscous"] * rate - x["dry"] * np.tanh(rate / 0.1)

    m.forces = forces
    m.outputs = lambda m, t: [*m.q[:3] - [0, 0, drop], float(m.q[m.model.joints[arms[0]].idx_q]), motor(m, t, 0)]
    return m


def corner(x: Mapping[str, float]) -> Machine:
    """A quarter of the Iltis: leaf link and tie rod, without mass, as conditions of the carrier's points."""
    m, hinge, tie, shock = Machine(), 0.97, 0.83, 1.045
    B, D1, S = np.array([hinge, 0.259, 0.302]), np.array([hinge, 0.572, 0.229]), np.array([hinge, 0.1585, 0.600])
    D2, T1, T2 = np.array([hinge, 0.488, x["left.D2.z"]]), np.array([tie, 0.070, 0.600]), np.array([tie, 0.448, 0.531])
    hub, K1, K2 = np.array([hinge, 0.615, 0.356]), np.array([shock, 0.297, 0.632]), np.array([shock, x["left.K2.y"], 0.241])
    chassis = m.body(0, pin.JointModelPZ(), np.array([0, 0, 0.57]), x["chassis_mass"], np.array([0, 0, 0.57]), np.zeros(3))
    e = (D1 - B) / np.linalg.norm(D1 - B)
    axes = np.array([_X, e, np.cross(_X, e)]).T
    inertia = axes @ np.diag([0.052099, 0.023235, 0.068864]) @ axes.T
    arm = m.body(chassis, pin.JointModelRX(), B, x["left.arm.mass"], (B + D1) / 2, inertia)
    carrier = m.body(arm, pin.JointModelSpherical(), D1, x["left.carrier.mass"], hub, np.array([1.2402, 1.908, 1.2402]))
    m.same(np.array([_X]), (chassis, D2), (carrier, D2))
    m.distance((chassis, S), (carrier, D2))
    m.distance((chassis, T1), (carrier, T2))
    m.frictions = [Friction(arm, _X, x["hinge.coefficient"], 3000.0, 2e-3, radius=0.02)]

    def damper(m: Machine) -> tuple[Array, Array, float, float]:
        (p, u, *_), (p2, u2, *_) = m.point(chassis, K1), m.point(arm, K2)
        length = float(np.linalg.norm(p2 - p))
        n = (p2 - p) / length
        return p2, n, length, float(20000.0 * (length - 0.43) + x["shock_damping"] * (n @ (u2 - u)))

    def tyre(m: Machine, t: float) -> float:
        c, u, *_ = m.point(carrier, hub)
        phase, speed = 2 * np.pi * (1 + 2 * t) * t, 2 * np.pi * (1 + 4 * t)
        road, rise = 0.02 * np.sin(phase) ** 3, 0.06 * np.sin(phase) ** 2 * np.cos(phase) * speed
        return float(x["tyre_rate"] * (0.364325 - (c[2] - road)) - 100 * (u[2] - rise))

    def forces(m: Machine, t: float) -> None:
        place, n, _, tension = damper(m)
        m.between(chassis, arm, place, -tension * n)
        place, (base, *_) = m.point(carrier, D2)[0], m.point(chassis, S)
        m.between(chassis, carrier, place, -x["leaf_rate"] * (0.145 - (base[2] - place[2])) * _Z)
        m.push(carrier, m.point(carrier, hub)[0], tyre(m, t) * _Z)
        m.torques[0] += -x["dry"] * np.tanh(m.v[0] / 0.05)

    def outputs(m: Machine, t: float) -> list[float]:
        _, _, length, tension = damper(m)
        return [0.57 + float(m.q[0]), float(m.point(carrier, hub)[0][2]), length, tension, tyre(m, t)]

    m.forces, m.outputs = forces, outputs
    return m


def leg(x: Mapping[str, float], times: Array, steps: int) -> Array:
    """The leg by MuJoCo, so many steps of its RK4 from one time to the next."""
    import mujoco

    knee = x["knee.at.z"]
    xml = f"""<mujoco><compiler autolimits="false" inertiafromgeom="false"/>
  <option integrator="RK4" timestep="{float(times[1] - times[0]) / steps!r}" gravity="0 0 {-_G}"><flag contact="disable"/></option>
  <worldbody>
  <body name="hip"><joint name="abduction" axis="1 0 0"/><inertial pos="0 0.03 -0.02" mass="0.7" diaginertia="0.001 0.001 0.001"/>
    <body name="thigh" pos="0 0.08 {x['flexion.at.z']!r}"><joint name="flexion" axis="0 1 0"/>
      <inertial pos="0 0 {-0.18 - x['flexion.at.z']!r}" mass="{x['thigh.mass']!r}" diaginertia="0.008 {x['thigh.inertia.1']!r} 0.001"/>
      <body name="shank" pos="0 0 {knee - x['flexion.at.z']!r}"><joint name="knee" axis="0 1 0"/>
        <inertial pos="0 0 {-0.42 - knee!r}" mass="{x['shank.mass']!r}" diaginertia="0.003 0.003 0.0003"/></body></body></body></worldbody>
  <actuator><general name="a1" joint="flexion" dyntype="user" gainprm="0" actdim="1"/>
    <general name="a2" joint="knee" dyntype="user" gainprm="0" actdim="1"/></actuator></mujoco>"""
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    preloads = (x["flexion_friction.preload"], x["knee_friction.preload"])
    damping = np.array([x[f"{joint}.spring.damping"] for joint in ("abduction", "flexion", "knee")])

    def passive(model: Any, data: Any) -> None:
        t, v = data.time, data.qvel
        data.qfrc_passive[:] = np.array([2 * np.sin(9 * t), 4 * np.sin(6 * t), 1.5 * np.sin(14 * t)]) - damping * v
        for k, preload in enumerate(preloads):
            data.qfrc_passive[1 + k] += preload * bristle(data.act[k], v[1 + k], 5e-3)[0]

    mujoco.set_mjcb_passive(passive)
    mujoco.set_mjcb_act_dyn(lambda model, data, k: bristle(data.act[k], data.qvel[1 + k], 5e-3)[1])
    try:
        found = [data.qpos.copy()]
        for _ in times[1:]:
            mujoco.mj_step(model, data, steps)
            found.append(data.qpos.copy())
    finally:
        mujoco.set_mjcb_passive(None)
        mujoco.set_mjcb_act_dyn(None)
    return np.array(found).T


def other_run(name: str, true: Mapping[str, float], times: Array) -> tuple[str, Array, Array, float]:
    """The simulator, its signals, their change by its own refinement relative to standard deviations, and the largest gap of loops (m)."""
    if name == "leg":
        fine, coarse = (leg(true, times, steps) for steps in (800, 400))
        return f"MuJoCo {version('mujoco')}, RK4, steps of {(times[1] - times[0]) / 800:.0e} s", fine, _apart(fine, coarse), 0.0
    machine = {"press": press, "delta": delta, "corner": corner}[name](true)
    v = np.zeros(machine.model.nv)
    if name == "press":
        q = pin.neutral(machine.model)
        machine.place(q, v)
        J = np.array([row[1] for loop in machine.loops for row in loop(machine)])
        v = 10 * np.concatenate([[1.0], np.linalg.solve(J[:, 1:], -J[:, 0])])
    else:
        q = machine.at_rest()
    coarse, fine = (machine.run(times, q, v, tolerance) for tolerance in (1e-11, 1e-12))
    return f"Pinocchio {version('pin')} with DOP853, tolerance 1e-12", fine, _apart(fine, coarse), machine.gap


def _apart(fine: Array, coarse: Array) -> Array:
    return np.asarray(np.abs(fine - coarse).max(axis=1) / fine.std(axis=1))
