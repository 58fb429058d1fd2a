"""A pose with sliders in a page: the tree's kinematics and the loops' equations as a program of the page.

The program is functions in JavaScript: numbers and operations, and no text of a model.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import pi
from typing import Any

import numpy as np

from cutjoint.analysis.closing import make_inputs
from cutjoint.elements.interaction import Coil, Point, Ring, Wheel
from cutjoint.formulate.forces import is_active
from cutjoint.formulate.records import RecursiveEquations
from cutjoint.formulate.recursive.kinematics import derive_poses
from cutjoint.model.expressions.quantities import JOINT_QUANTITIES
from cutjoint.model.records import GROUND, Force, Model, Scene, Vector
from cutjoint.ops import OPERATIONS, fact
from cutjoint.program.blocks import Block
from cutjoint.program.lower import Lowering
from cutjoint.program.scalars import Graph, Scalar
from cutjoint.run.run_file import Evaluator, parameter_values
from cutjoint.view.motions import Mover
from cutjoint.view.records import Array
from cutjoint.view.sizes import find_sizes, named_visuals, point_of

#: The range of an angle (rad) in both directions, and of a displacement as a share of the mechanism's extent.
_TURN, _SLIDE = pi, 0.5


@dataclass(frozen=True, kw_only=True)
class Sliders:
    """The data with which a page moves a mechanism: its ``script``, and ``facts`` for it.

    Of these "q" are the coordinates of the pose, "charts" say which of them are quaternions, "sliders" have their ends.  "bodies" have
    their centres of mass, "others" are drawn between bodies or on one.
    """

    script: str
    facts: Mapping[str, Any]


def make_sliders(mover: Mover, q: Array) -> Sliders | None:
    """The sliders of a pose with coordinates ``q``; None where no coordinate has one."""
    model, scene, equations = mover.model, mover.scene, mover.equations
    numbers = Evaluator(model, parameter_values(model, mover.parameters))
    sliders = list(_sliders(model, equations, q, find_sizes(model, scene, numbers).extent))
    if not sliders:
        return None
    return Sliders(script=_script(mover, q), facts={
        "q": q.tolist(), "sliders": sliders, "others": list(_others(model, scene, numbers)),
        "charts": [{"q": c.q, "v": c.v, "scalars": c.scalars, "ball": c.ball} for c in equations.charts],
        "bodies": [{"name": body.name, "centre": point_of(numbers, body.centre_of_mass).tolist()} for body in model.bodies],
    })  # fmt: skip


def _script(mover: Mover, q: Array) -> str:
    """Functions ``poses``, of each body the rotation by rows and the shift, and ``residual`` of the loops."""
    equations, scene = mover.equations, mover.with_constants[0]
    poses = derive_poses(equations.topology, scene)
    values, places = make_inputs(equations, q, np.zeros(equations.speeds)), {f"q:{c.joint}": c.q for c in equations.charts}
    blocks = [block for body in mover.model.bodies for block in (poses.rotations[body.name], poses.shifts[body.name])]
    close = equations.function("constraint_residual").results
    residuals = [close[f"residual:{c.joint}"] for c in equations.closures]
    functions = [print_function("poses", blocks, values, places), print_function("residual", residuals, values, places)]
    return "\n".join(["'use strict';", "const Mechanism = (() => {", *functions, "return { poses, residual };", "})();", ""])


def _sliders(model: Model, equations: RecursiveEquations, q: Array, extent: float) -> Iterator[dict[str, Any]]:
    """One for each coordinate of the tree's joints; a quaternion has none."""
    kinds = {joint.name: joint.kind for joint in model.joints}
    for chart in equations.charts:
        for i, name in enumerate(chart.coordinate_names[: chart.scalars]):
            unit, value = JOINT_QUANTITIES[kinds[chart.joint]][name], float(q[chart.q + i])
            reach = _TURN if unit == "rad" else _SLIDE * extent
            place = {"q": chart.q + i, "v": chart.v + i}
            yield {"name": f"{chart.joint}.{name}", "unit": unit, **place, "low": value - reach, "high": value + reach}


def _others(model: Model, scene: Scene, numbers: Evaluator) -> Iterator[dict[str, Any]]:
    """Springs and rods between two points, springs along an axis, and what stands on a body."""

    def at(body: str, point: Vector) -> dict[str, Any]:
        return {"body": "" if body == GROUND else body, "point": point_of(numbers, point).tolist()}

    def on(force: Force, point: Point) -> dict[str, Any]:
        return at(point.body(force), point.of(force))

    for force in model.forces:
        if not is_active(force, scene):
            continue
        for name, visual in named_visuals(force):
            match visual:
                case Coil(start, end, axis):
                    line = {} if axis is None else {"axis": point_of(numbers, axis.of(force)).tolist()}
                    yield {"name": name, "from": on(force, start), "to": on(force, end), **line}
                case Ring(at=point) | Wheel(at=point):
                    yield {"name": name, "on": on(force, point)}
    for joint in model.joints:
        if joint.to is not None:
            yield {"name": joint.name, "from": at(joint.base, joint.at), "to": at(joint.follower, joint.to)}


def print_function(name: str, blocks: Sequence[Block], values: Mapping[str, Array], places: Mapping[str, int]) -> str:
    """A function of an array q that returns the elements of blocks, row by row.

    Symbols are places in q, those of ``places`` from there on, or have ``values``.
    """
    lowering = Lowering()
    lowering.lower(blocks)
    graph = lowering.graph
    results = [scalar for block in blocks for row in lowering.elements[block] for scalar in row]
    lines = [f"  const x{n} = {_expression(graph, graph.nodes[n], values, places)};" for n in graph.reachable(results)]
    return "\n".join([f"function {name}(q) {{", *lines, f"  return [{', '.join(f'x{n}' for n in results)}];", "}", ""])


def _expression(graph: Graph, node: Scalar, values: Mapping[str, Array], places: Mapping[str, int]) -> str:
    arguments = [f"x{a}" for a in node.args]
    if node.op == "const":
        return repr(node.data)
    if node.op == "symbol":
        assert isinstance(node.data, tuple)
        symbol, index = node.data
        return f"q[{places[symbol] + index}]" if symbol in places else repr(float(values[symbol][index]))
    if node.op == "neg":
        return f"-{arguments[0]}"
    if node.op == "not":
        return f"!{arguments[0]}"
    if node.op == "where":
        return f"{arguments[0]} ? {arguments[1]} : {arguments[2]}"
    if infix := OPERATIONS[node.op].infix:
        return f" {infix} ".join(arguments)
    assert fact(node.op, "standard")
    return f"Math.{node.op}({', '.join(arguments)})"
