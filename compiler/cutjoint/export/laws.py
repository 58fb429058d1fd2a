"""Numbers, laws and the start of a model with its parameters put in; laws as C++ by SymPy, with numbers that read back the same."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np
import sympy
from numpy.typing import NDArray
from sympy.printing.cxx import CXX17CodePrinter

from cutjoint.compile.interpreted import compile_interpreted
from cutjoint.formulate.inputs import input_functions, input_parameters
from cutjoint.methods import PLAIN_CLOSURE, Loops
from cutjoint.model.expressions.evaluate import evaluate
from cutjoint.model.records import COORDINATES, Binding, Marker, Model, Output, Scalar, Scene
from cutjoint.package.errors import RunError
from cutjoint.run.artifact import make_simulator_run
from cutjoint.run.failures import describe_failure
from cutjoint.run.run_file import constant_inputs, parameter_values
from cutjoint.run.scenes import with_closure, with_loops
from cutjoint.run.settings import PLAIN_STEPS
from cutjoint.run.simulator_run import start
from cutjoint.topology.records import Topology

#: Components in the global frame.
Triple: TypeAlias = tuple[float, float, float]
_LARGEST_POWER = 12
Array = NDArray[np.float64]
#: A rotation (rad) or a shift (m) below this is rounding of differences of coordinates, and counts as zero.
ROUNDING = 1e-14


@dataclass(frozen=True, kw_only=True)
class Numbers:
    """The values of parameters, and inputs as the scene's functions of time."""

    values: Mapping[Scalar, float]
    inputs: Mapping[Scalar, Scalar]

    @classmethod
    def of(cls, model: Model, scene: Scene, parameters: Mapping[str, float]) -> "Numbers":
        """The numbers of a scene after changes of parameters (SI units), and with inputs that these hold constant.
        Raises RunError: a change names neither a tunable parameter nor an input.
        """
        changed = parameter_values(model, parameters)
        values = {p.symbol: changed.get(p.name, p.value) for p in model.parameters if p.binding is not Binding.INPUT}
        held = constant_inputs(model, parameters)
        inputs = {p.symbol: sympy.Float(held[p.name]) for p in input_parameters(model) if p.name in held}
        return cls(values=values, inputs={**input_functions(model, scene), **inputs})

    def number(self, expression: Scalar) -> float:
        """The value of an expression over parameters."""
        return evaluate(sympy.sympify(expression), self.values)

    def triple(self, vector: Sequence[Scalar]) -> Triple:
        """The values of three expressions."""
        x, y, z = (self.number(e) for e in vector)
        return x, y, z

    def law(self, expression: Scalar) -> Scalar:
        """An expression over the variables of its law and ``t`` alone."""
        known = {symbol: sympy.Float(value) for symbol, value in self.values.items()}
        return sympy.sympify(expression).xreplace(dict(self.inputs)).xreplace(known)


class RealNumbers:
    """The common part of printers of laws: every number is a real one.  Methods are called by the names of SymPy's classes."""

    def _print_Float(self, number: Any) -> str:
        return real(float(number))

    _print_Integer = _print_NumberSymbol = _print_Pi = _print_Exp1 = _print_Float  # noqa: N815

    def _print_Rational(self, number: Any) -> str:
        return f"{real(float(number.p))}/{real(float(number.q))}"

    def _print_Exponential(self, exponential: Any) -> str:
        return str(self._print(sympy.exp(exponential.args[0], evaluate=False)))  # type: ignore[attr-defined]

    def _print_Choice(self, choice: Any) -> str:
        return str(self._print_Piecewise(choice))  # type: ignore[attr-defined]


class _Printer(RealNumbers, CXX17CodePrinter):  # type: ignore[misc]
    """Whole powers without std::pow."""

    def _print_Pow(self, expression: Any) -> str:
        base, exponent = expression.as_base_exp()
        if exponent.is_Integer and 2 <= exponent <= _LARGEST_POWER:
            return f"power<{int(exponent)}>({self._print(base)})"
        return str(super()._print_Pow(expression))


def real(value: float) -> str:
    """A number of a law; a negative one in brackets."""
    if not math.isfinite(value):
        raise ValueError(f"{value} has no place in a law")
    return f"({value!r})" if value < 0 else repr(value)


def expression(law: Scalar) -> str:
    """A law as an expression over its variables' names."""
    return " ".join(_Printer({"math_macros": {}}).doprint(sympy.sympify(law)).split())


@dataclass(frozen=True, kw_only=True)
class Start:
    """A body at the start: rotation (3, 3), shift (3,) m of its points, velocity (3,) m/s, spin (3,) rad/s.
    The velocity is that of the centre of mass."""

    rotation: Array
    shift: Array
    velocity: Array
    spin: Array


def find_start(
    topology: Topology, scene: Scene, parameters: Mapping[str, float]
) -> tuple[Mapping[str, Start], Mapping[str, tuple[float, ...]]]:
    """Every body at the start of a scene, and the coordinates of every tree joint.

    Raises:
        RunError: the scene has no start.
        NoInertiaError, GuideError: the model is wrong.
        SimulatorError, ToolchainError: as for a run.
    """
    model = topology.model
    markers = tuple(m for body in model.bodies for m in markers_of(model, body.name))
    marked = replace(model, markers=(*model.markers, *markers))
    still = with_loops(with_closure(replace(scene, end=0.0), PLAIN_CLOSURE), Loops.EXACT)  # functions know not all coordinates
    artifact = compile_interpreted(marked, still, outputs=tuple(_outputs(topology, markers)))
    run = start(make_simulator_run(artifact, PLAIN_STEPS, parameters))
    if run.failure is not None:
        raise RunError(describe_failure(run.failure, scene.name, artifact.places, artifact, parameters))
    values = {name: float(rows[0]) for name, rows in run.columns.items()}
    designs = {body.name: markers_of(model, body.name) for body in model.bodies}
    starts = {name: _start(name, values, len(markers)) for name, markers in designs.items()}
    coordinates = {t.joint.name: tuple(values[f"{t.joint.name}.{c}"] for c in COORDINATES[t.joint.kind]) for t in topology.tree}
    return starts, coordinates


def markers_of(model: Model, body: str) -> tuple[Marker, ...]:
    """Four points of a body: the global origin and those a metre from it along x, y and z; their names have an "@"."""
    span = next(b.span for b in model.bodies if b.name == body)
    points = ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1))
    return tuple(Marker(name=f"{body}@{i}", body=body, point=point, span=span) for i, point in enumerate(points))


def _outputs(topology: Topology, markers: tuple[Marker, ...]) -> Iterator[Output]:
    for marker in markers:
        yield from (Output(element=marker.name, quantity=q, span=marker.span) for q in "xyz")
    for body in topology.model.bodies:
        yield from (Output(element=body.name, quantity=q, span=body.span) for q in ("vx", "vy", "vz", "wx", "wy", "wz"))
    for joint in (t.joint for t in topology.tree):
        yield from (Output(element=joint.name, quantity=q, span=joint.span) for q in COORDINATES[joint.kind])


def _start(body: str, values: Mapping[str, float], points: int) -> Start:
    def column(element: str, names: str) -> Array:
        return np.array([values[f"{element}.{name}"] for name in names.split()])

    origin, *tips = (column(f"{body}@{i}", "x y z") for i in range(points))
    left, _, right = np.linalg.svd(np.column_stack([tip - origin for tip in tips]))
    rotation = left @ right
    return Start(
        rotation=np.eye(3) if np.abs(rotation - np.eye(3)).max() < ROUNDING else rotation,
        shift=np.zeros(3) if np.abs(origin).max() < ROUNDING else origin, velocity=column(body, "vx vy vz"), spin=column(body, "wx wy wz"),
    )  # fmt: skip
