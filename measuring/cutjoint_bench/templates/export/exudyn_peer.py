"""A mechanism in Exudyn, and the program around it: command line, table of results, summary as one line of JSON.

Bodies are rigid with redundant coordinates (Euler parameters), joints are algebraic equations.  SI units, global axes; all places and
directions are those of the start, arms lead from a body's centre of mass or, on the ground, from the origin.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from time import perf_counter

import exudyn
import numpy as np
from exudyn import itemInterface
from exudyn_elements import STILL, Element, Frame, Law, Motion, Vector, Wrench

GROUND = "ground"
INTEGRATORS = ("generalized_alpha", "trapezoidal_index2")
Variable = exudyn.OutputVariableType

#: The variable and the component of a point for each quantity.
QUANTITIES = {
    **{name: (Variable.Position, i) for i, name in enumerate(("x", "y", "z"))},
    **{name: (Variable.Velocity, i) for i, name in enumerate(("vx", "vy", "vz"))},
    **{name: (Variable.AngularVelocity, i) for i, name in enumerate(("wx", "wy", "wz"))},
}


@dataclass(frozen=True)
class Body:
    """Numbers of object and node in Exudyn, and the centre of mass at the start; the ground has no node."""

    object: int
    node: int | None
    centre: Vector

    def motion(self, q: Sequence[float], q_t: Sequence[float]) -> Motion:
        """From displacements and changes of Euler parameters since the start, and their rates."""
        a, b, c, d = 1.0 + q[3], q[4], q[5], q[6]
        a_t, b_t, c_t, d_t = q_t[3], q_t[4], q_t[5], q_t[6]
        R = (
            (1 - 2 * (c * c + d * d), 2 * (b * c + a * d), 2 * (b * d - a * c)),
            (2 * (b * c - a * d), 1 - 2 * (b * b + d * d), 2 * (c * d + a * b)),
            (2 * (b * d + a * c), 2 * (c * d - a * b), 1 - 2 * (b * b + c * c)),
        )
        w = (
            2 * (-b * a_t + a * b_t - d * c_t + c * d_t),
            2 * (-c * a_t + d * b_t + a * c_t - b * d_t),
            2 * (-d * a_t - c * b_t + b * c_t + a * d_t),
        )
        x, y, z = self.centre
        return Motion(R, (x + q[0], y + q[1], z + q[2]), (q_t[0], q_t[1], q_t[2]), w)


def generalised(wrench: Wrench, q: Sequence[float]) -> list[float]:
    """The force on each coordinate of a body: with w = G e' for Euler parameters e, that on e is G^T times the torque."""
    a, b, c, d = 1.0 + q[3], q[4], q[5], q[6]
    x, y, z = wrench.torque
    return [
        *wrench.force, 2 * (-b * x - c * y - d * z), 2 * (a * x + d * y - c * z), 2 * (-d * x + a * y + b * z), 2 * (c * x - b * y + a * z)
    ]  # fmt: skip


class Mechanism:
    """Parts of a model; ``mbs`` is the system in Exudyn."""

    def __init__(self, gravity: Vector) -> None:
        self.mbs = exudyn.SystemContainer().AddSystem()
        self._gravity = gravity
        self._bodies = {GROUND: Body(self.mbs.AddObject(itemInterface.ObjectGround()), None, (0.0, 0.0, 0.0))}
        self._columns: dict[str, tuple[int | None, float]] = {}
        self._sensors: dict[object, int] = {}
        self._parts: dict[str, int] = {}
        self._has_elements = False

    def body(self, name: str, mass: float, centre: Vector, inertia: Sequence[float], velocity: Vector, spin: Vector) -> None:
        """A rigid body; ``inertia`` is (Jxx, Jyy, Jzz, Jyz, Jxz, Jxy) about its centre of mass."""
        rates = [*velocity, 0.0, *(0.5 * w for w in spin)]
        node = self.mbs.AddNode(itemInterface.NodeRigidBodyEP(referenceCoordinates=[*centre, 1.0, 0.0, 0.0, 0.0], initialVelocities=rates))
        number = self.mbs.AddObject(itemInterface.ObjectRigidBody(nodeNumber=node, mass=mass, inertia=list(inertia)))
        marker = self.mbs.AddMarker(itemInterface.MarkerBodyMass(bodyNumber=number))
        self.mbs.AddLoad(itemInterface.LoadMassProportional(markerNumber=marker, loadVector=list(self._gravity)))
        self._bodies[name] = Body(number, node, centre)

    def part(self, name: str, body: str, arm: Vector) -> None:
        """A body of the model, whose centre of mass is a point of a rigid one."""
        self._parts[name] = self._sensor(body, arm, Variable.Acceleration)

    def column(self, name: str, body: str, arm: Vector, quantity: str) -> None:
        """A column of the table: x y z vx vy vz of a point or wx wy wz of its body."""
        variable, index = QUANTITIES[quantity]
        on_ground = arm[index] if variable == Variable.Position else 0.0
        self._columns[name] = (None, on_ground) if body == GROUND else (self._sensor(body, arm, variable), index)

    def _sensor(self, body: str, arm: Vector, variable: object) -> int:
        key = (body, arm, variable)
        if key not in self._sensors:
            sensor = itemInterface.SensorBody(
                bodyNumber=self._bodies[body].object, localPosition=list(arm), outputVariableType=variable, storeInternal=True,
                writeToFile=False,
            )  # fmt: skip
            self._sensors[key] = self.mbs.AddSensor(sensor)
        return self._sensors[key]

    def _markers(self, base: tuple[str, Vector], follower: tuple[str, Vector]) -> list[int]:
        ends = ((self._bodies[name].object, arm) for name, arm in (base, follower))
        return [self.mbs.AddMarker(itemInterface.MarkerBodyRigid(bodyNumber=number, localPosition=list(arm))) for number, arm in ends]

    # Joints

    def revolute(self, base: tuple[str, Vector], follower: tuple[str, Vector], axes: Frame) -> None:
        """A hinge about the third of the axes."""
        turn = np.transpose(axes)
        joint = itemInterface.ObjectJointRevoluteZ(markerNumbers=self._markers(base, follower), rotationMarker0=turn, rotationMarker1=turn)
        self.mbs.AddObject(joint)

    def spherical(self, base: tuple[str, Vector], follower: tuple[str, Vector]) -> None:
        """A ball."""
        self.mbs.AddObject(itemInterface.ObjectJointSpherical(markerNumbers=self._markers(base, follower)))

    def distance(self, base: tuple[str, Vector], follower: tuple[str, Vector]) -> None:
        """A rod without mass."""
        ends = (np.array(self._bodies[name].centre) + arm for name, arm in (base, follower))
        length = float(np.linalg.norm(np.subtract(*ends)))
        self.mbs.AddObject(itemInterface.ObjectConnectorDistance(markerNumbers=self._markers(base, follower), distance=length))

    def joint(
        self, base: tuple[str, Vector], follower: tuple[str, Vector], axes: Frame, locked: Sequence[int],
        slide: Callable[[float], tuple[float, float]] | None = None,
    ) -> None:  # fmt: skip
        """Some of the three slides along and three turns about axes are locked, which the base carries.

        With one turn locked, the first one, the base's second axis and the follower's third stay across each other.  With ``slide`` the
        way from the base's to the follower's point along the third axis is as it says: the way and its rate, as functions of time.
        """
        turn = np.transpose(axes)
        moves = {}
        if slide is not None:
            moves["offsetUserFunction"] = lambda mbs, t, item, parameters: [0.0, 0.0, slide(t)[0], 0.0, 0.0, 0.0]
            moves["offsetUserFunction_t"] = lambda mbs, t, item, parameters: [0.0, 0.0, slide(t)[1], 0.0, 0.0, 0.0]
        joint = itemInterface.ObjectJointGeneric(
            markerNumbers=self._markers(base, follower), constrainedAxes=list(locked), rotationMarker0=turn,
            rotationMarker1=turn, **moves,
        )  # fmt: skip
        self.mbs.AddObject(joint)

    # Forces

    def spring(self, base: tuple[str, Vector], follower: tuple[str, Vector], stiffness: float, damping: float, force: float) -> None:
        """A tension ``stiffness`` length + ``damping`` rate + ``force`` between two points."""
        self._spring(base, follower, stiffness=stiffness, damping=damping, force=force)

    def spring_law(self, base: tuple[str, Vector], follower: tuple[str, Vector], stiffness: float, damping: float, law: Law) -> None:
        """A tension law(length, rate, t) between two points; ``stiffness`` and ``damping`` are its derivatives at the start."""

        def tension(mbs: object, t: float, item: int, length: float, rate: float, *parameters: float) -> float:
            return law(length, rate, t)

        self._spring(base, follower, stiffness=stiffness, damping=damping, springForceUserFunction=tension)

    def _spring(self, base: tuple[str, Vector], follower: tuple[str, Vector], **figures: object) -> None:
        self.mbs.AddObject(itemInterface.ObjectConnectorSpringDamper(markerNumbers=self._markers(base, follower), **figures))

    def element(self, names: Sequence[str], element: Element) -> None:
        """A force element between bodies, in their order."""
        bodies = [self._bodies[name] for name in names]
        moving = [body for body in bodies if body.node is not None]

        def forces(mbs: object, t: float, item: int, q: list[float], q_t: list[float]) -> list[float]:
            shares = iter([(q[i : i + 7], q_t[i : i + 7]) for i in range(0, len(q), 7)])
            motions = [STILL if body.node is None else body.motion(*next(shares)) for body in bodies]
            wrenches = [w for w, body in zip(element(*motions, t), bodies, strict=True) if body.node is not None]
            return [x for i, wrench in enumerate(wrenches) for x in generalised(wrench, q[7 * i : 7 * i + 7])]

        self._has_elements = True
        self.mbs.AddObject(itemInterface.ObjectGenericODE2(nodeNumbers=[body.node for body in moving], forceUserFunction=forces))

    # Runs

    def settings(self, dt: float, end: float, output_step: float, integrator: str) -> exudyn.SimulationSettings:
        """Settings of a run: fixed steps, sparse matrices, no files."""
        settings = exudyn.SimulationSettings()
        settings.solution.file.write = False
        settings.solution.sensors.writePeriod = max(output_step, dt)
        settings.linearSolver.solverType = exudyn.LinearSolverType.EigenSparse
        run = settings.timeIntegration
        if not (dt > 0 and (end == 0 or dt <= end * (1 + 1e-9)) and end / dt <= 2**53):
            raise ValueError("--dt is longer than --end, or a run of more than 9e15 steps")
        run.numberOfSteps, run.endTime = max(1, int(np.ceil(end / dt - 1e-9))), end
        run.adaptiveStep = False
        run.verboseMode = 0
        # a Jacobian at every step saves iterations, unless elements in Python are differentiated for it numerically
        run.newton.modifiedNewtonJacUpdatePerStep = not self._has_elements
        run.generalizedAlpha.useNewmark = run.generalizedAlpha.useIndex2Constraints = integrator == "trapezoidal_index2"
        return settings

    def run(self, settings: exudyn.SimulationSettings) -> tuple[float, int, str]:
        """Seconds of the steps alone, steps, and what went wrong."""
        self.mbs.Assemble()
        solver = exudyn.MainSolverImplicitSecondOrder()
        seconds, problem = 0.0, ""
        try:
            solver.InitializeSolver(self.mbs, settings)
            begin = perf_counter()
            try:
                done = solver.SolveSteps(self.mbs, settings)
            finally:
                seconds = perf_counter() - begin
            problem = "" if done else f"a step did not converge at t = {solver.it.currentTime:.6g} s"
        except Exception as error:
            problem = str(error)
        run = settings.timeIntegration
        reached = solver.it.currentTime / run.endTime * run.numberOfSteps - 1 if problem else run.numberOfSteps
        return seconds, max(round(reached), 0), problem

    def table(self) -> tuple[np.ndarray, list[str]]:
        """Time and columns of the last run, and their names."""
        data = {sensor: self.mbs.GetSensorStoredData(sensor) for sensor in self._sensors.values()}
        t = next(iter(data.values()))[:, 0]
        values = [np.full(t.size, x) if sensor is None else data[sensor][:, 1 + int(x)] for sensor, x in self._columns.values()]
        return np.column_stack([t, *values]), ["t", *self._columns]

    def accelerations(self) -> dict[str, list[float]]:
        """Of the centre of mass of every body at the start."""
        problem = self.run(self.settings(1e-9, 1e-9, 1e-9, INTEGRATORS[0]))[2]
        if problem:
            raise RuntimeError(problem)
        return {name: self.mbs.GetSensorStoredData(sensor)[0, 1:].tolist() for name, sensor in self._parts.items()}


def main(mechanism: Mechanism) -> int:
    """Run what the command line says."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--dt", type=float, default=1e-3)
    parser.add_argument("--end", type=float, default=1.0)
    parser.add_argument("--integrator", choices=INTEGRATORS, default=INTEGRATORS[0])
    parser.add_argument("--output-step", type=float, default=0.0)
    parser.add_argument("--out", default="table.csv")
    parser.add_argument("--task", choices=("simulate", "accelerations"), default="simulate")
    options = parser.parse_args()
    if not (options.dt > 0 and options.end > 0):
        parser.error("--dt and --end need positive numbers")
    exudyn.config.printToConsole = False
    if options.task == "accelerations":
        print(json.dumps(mechanism.accelerations()))
        return 0
    settings = mechanism.settings(options.dt, options.end, options.output_step, options.integrator)
    seconds, steps, problem = mechanism.run(settings)
    rows, names = mechanism.table()
    np.savetxt(options.out, rows, fmt="%.17g", delimiter=",", header=",".join(names), comments="")
    print(json.dumps({"seconds": seconds, "steps": steps, "status": "failed" if problem else "done", "message": problem}))
    return 1 if problem else 0
