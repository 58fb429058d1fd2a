"""Inverse dynamics: the forces of drives that a prescribed motion needs.

A kinematic scene moves its driven joints as it says.  The generalised forces F of its guides follow from that run.  Drives at other
coordinates q_a do the same if they have the same power in all motions, F = (dq_a/dq)^T tau: of several solutions tau is the one of least
norm.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import sympy

from cutjoint.analysis.closing import evaluate_closures
from cutjoint.compile.interpreted import compile_interpreted
from cutjoint.elements.forces.joint_force import JointForce
from cutjoint.elements.gear import FORCE_UNITS
from cutjoint.formulate.inputs import TIME, guide_rates, input_parameters
from cutjoint.formulate.layout import Chart
from cutjoint.formulate.records import RecursiveEquations
from cutjoint.formulate.recursive.equations import formulate_recursive
from cutjoint.methods import Loops
from cutjoint.model.expressions.evaluate import evaluate
from cutjoint.model.records import Joint, Model, Output, Reaction, Scalar, Scene
from cutjoint.package.errors import RunError, plural
from cutjoint.run.results import Array, Columns, Trajectory
from cutjoint.run.scenes import ModelLike, load_model, with_loops
from cutjoint.run.simulation import simulate
from cutjoint.topology.build import build_topology
from cutjoint.topology.geometry import balanced

#: Singular values below this share of the largest are zero.
_RANK = 1e-9
#: The largest share of the guides' force that drives may leave unbalanced.
_LEFT = 1e-8


@dataclass(frozen=True, kw_only=True, repr=False)
class Drives(Columns[Array]):
    """The forces of drives over the time, a mapping from "t" and the names of their joints to arrays (rows,), with ``units``.

    ``redundant`` says that other forces would do too, of larger norm.  ``run`` is the prescribed motion.
    """

    t: Array
    forces: Mapping[str, Array]
    units: Mapping[str, str]
    redundant: bool
    run: Trajectory

    def __post_init__(self) -> None:
        self.update({"t": self.t, **self.forces})


def inverse_dynamics(
    model: ModelLike, *, scene: str | None = None, drives: Sequence[str] = (), parameters: Mapping[str, float] | None = None,
    end: float | None = None,
) -> Drives:  # fmt: skip
    """Forces (N, N m) of ``drives`` that move a model as a kinematic scene prescribes.

    They act in addition to the friction, springs and loads of the model.

    Args:
        drives: joints with one coordinate; default: those that the scene moves, or if none moves those that are driven or locked.

    Raises:
        RunError: the scene leaves some motion free, the drives cannot bring it about, or a joint has not just one coordinate.
        ModelError, FailedRunError and others: as of `cutjoint.simulate`.
    """
    return InverseDynamics(*load_model(model, scene), dict(parameters or {}), tuple(drives)).find(end)


def with_guide_forces(model: Model, names: Sequence[str]) -> Model:
    """The model with what `guide_terms` reads of guided joints: sensors of their reactions, and forces of their armatures."""
    joints = {joint.name: joint for joint in model.joints}
    guided = [joints[name] for name in names]
    armatures = (JointForce(name=f"armature_of_{j.name.replace('.', '_')}", active=True, span=j.span, joint=j.name,
        coordinate=(c := j.element.coordinates[0]), unit=j.element.units[c], law=-j.armature * guide_rates(j.guide[0], model)[2])
        for j in guided if j.armature != 0 and j.guide)  # fmt: skip
    sensors = (Reaction(name=_sensor(j), joint=j.name, body=j.follower, direction=j.axes[0], span=j.span) for j in guided)
    return replace(model, forces=(*model.forces, *armatures), reactions=(*model.reactions, *sensors))


def _sensor(joint: Joint) -> str:
    return f"drive_of_{joint.name.replace('.', '_')}"


def guide_terms(model: Model, joint: Joint) -> list[tuple[Output, Scalar]]:
    """The force of a joint's guide as outputs and their factors: the reaction along the axis less other forces on the coordinate.
    Raises RunError: it has no such force."""
    if any(gear.law is not None and joint.name in gear.joints for gear in model.gears):
        raise RunError(f"joint '{joint.name}' has a gear with a law; prescribe the motion of another joint")
    span, turns = joint.span, joint.element.units[joint.element.coordinates[0]] == "rad"
    terms = [(Output(element=_sensor(joint), quantity="moment" if turns else "force", span=span), sympy.S.One)]
    terms += [(Output(element=f.name, quantity="force", span=span), -sympy.S.One) for f in model.force_elements if f.joint_of == joint.name]
    terms += [(Output(element=gear.name, quantity="force", span=span), -sympy.sympify(factor))
              for gear in model.gears for end, factor in gear.terms if end.joint == joint.name]  # fmt: skip
    return terms


class InverseDynamics:
    """One search for the forces of drives.

    ``moved`` are the joints whose guides follow the time or inputs, or are drives; if none moves, all that have one coordinate.
    Other guides that stand still are locks, and stay.
    """

    def __init__(self, model: Model, scene: Scene, parameters: Mapping[str, float], drives: tuple[str, ...]) -> None:
        self._scene, self._parameters = with_loops(scene, Loops.EXACT), parameters
        joints = {joint.name: joint for joint in model.joints}
        self._numbers = {p.symbol: self._parameters.get(p.name, p.value) for p in model.parameters}
        moving = {TIME, *(p.symbol for p in input_parameters(model))}
        guided = {j.name for j in model.joints if j.guide is not None and len(j.element.coordinates) == 1}
        moves = {j.name for j in model.joints if any(sympy.sympify(guide).free_symbols & moving for guide in j.guide or ())}
        moves = moves or (guided if set(drives) - guided else set(drives)) or guided
        self.moved = [j for j in model.joints if j.guide is not None and (j.name in moves or j.name in drives)]
        if not self.moved:
            raise RunError(f"scene '{scene.name}' prescribes no motion; give it drive: {{joint: law of t}}")
        if unknown := next((name for name in drives if name not in joints), ""):
            raise RunError(f"there is no joint '{unknown}'; drives are joints of the model")
        self.drives = [joints[name] for name in drives] or self.moved
        for joint in (*self.moved, *self.drives):
            if len(joint.element.coordinates) != 1:
                raise RunError(f"joint '{joint.name}' has {plural(len(joint.element.coordinates), 'coordinate')}, where a drive has one")
        in_tree = tuple(replace(j, cut=False) if j.name in drives and j.cut is None else j for j in model.joints)
        self._model = with_guide_forces(replace(model, joints=in_tree), [j.name for j in self.moved])

    def find(self, end: float | None) -> Drives:
        """The forces at the rows of the run."""
        artifact = compile_interpreted(self._model, self._scene, outputs=self._outputs())
        assert isinstance(artifact.equations, RecursiveEquations)
        run = simulate(artifact, parameters=self._parameters, end=end, coordinates=True, error=False)
        terms = ([evaluate(k, self._numbers) * run[o.column] for o, k in guide_terms(self._model, joint)] for joint in self.moved)
        guided = np.array([np.sum(of_joint, axis=0) for of_joint in terms]).T
        equations = self._released(artifact.equations)
        forces = np.empty((len(run.t), len(self.drives)))
        redundant = False
        for row in range(len(run.t)):
            derivatives = self._derivatives(equations, self._coordinates(equations, artifact.equations.charts, run, row), run.t[row])
            u, s, v = np.linalg.svd(derivatives.T, full_matrices=False)
            able = s > _RANK * s.max(initial=0.0)
            forces[row] = v[able].T @ ((u[:, able].T @ guided[row]) / s[able])
            left = np.abs(derivatives.T @ forces[row] - guided[row])
            if left.max() > _LEFT * np.abs(guided).max():
                joint = self.moved[int(left.argmax())].name
                drives = ", ".join(j.name for j in self.drives)
                said = f"the drives {drives} cannot move '{joint}' as scene '{self._scene.name}' does"
                raise RunError(f"{said}, at {run.t[row]:g} s; add one")
            redundant = redundant or int(able.sum()) < len(self.drives)
        names = [joint.name for joint in self.drives]
        units = {j.name: FORCE_UNITS[j.element.units[j.element.coordinates[0]]] for j in self.drives}
        return Drives(t=run.t, forces=dict(zip(names, forces.T, strict=True)), units=units, redundant=redundant, run=run)

    # the forces of the guides

    def _outputs(self) -> list[Output]:
        outputs = [o for joint in self.moved for o, _ in guide_terms(self._model, joint)]
        outputs += [Output(element=j.name, quantity=j.element.coordinates[0], span=self._model.span) for j in self.moved]
        return list({o.column: o for o in outputs}.values())

    # how drives follow the prescribed coordinates

    def _released(self, guided: RecursiveEquations) -> RecursiveEquations:
        """The equations of the same tree, in which the prescribed joints have unknowns."""
        cut = {joint.name for joint in guided.topology.cuts} - {joint.name for joint in self.drives}
        moved = {joint.name for joint in self.moved}
        joints = tuple(
            replace(j, cut=j.name in cut, guide=None if j.name in moved else j.guide) if j.element.closes else j for j in self._model.joints
        )
        return formulate_recursive(build_topology(replace(self._model, joints=joints)), self._scene, ())

    def _coordinates(self, equations: RecursiveEquations, charts: Sequence[Chart], run: Trajectory, row: int) -> Array:
        assert run.coordinates is not None
        q = np.zeros(equations.coordinates)
        known = {chart.joint: run.coordinates[row, chart.q : chart.q + len(chart.coordinate_names)] for chart in charts}
        known |= {j.name: run[f"{j.name}.{j.element.coordinates[0]}"][row : row + 1] for j in self.moved}
        for chart in equations.charts:
            q[chart.q : chart.q + len(chart.coordinate_names)] = known[chart.joint]
        return q

    def _derivatives(self, equations: RecursiveEquations, q: Array, t: float) -> Array:
        """dq_a/dq of the drives by the prescribed coordinates, (drives, moved)."""
        jacobian = balanced(evaluate_closures(equations, q, t)[1])
        place = {chart.joint: chart.v for chart in equations.charts}
        lead = [place[joint.name] for joint in self.moved]
        rest = [i for i in range(equations.speeds) if i not in lead]
        s = np.linalg.svd(jacobian[:, rest], compute_uv=False)
        left = len(rest) - int((s > _RANK * s.max(initial=0.0)).sum())
        if left:
            raise RunError(f"scene '{self._scene.name}' leaves {plural(left, 'degree')} of freedom open; drive more joints")
        derivatives = np.zeros((equations.speeds, len(lead)))
        derivatives[lead] = np.eye(len(lead))
        derivatives[rest] = -np.linalg.lstsq(jacobian[:, rest], jacobian[:, lead], rcond=_RANK)[0] if rest else 0
        return derivatives[[place[joint.name] for joint in self.drives]]
