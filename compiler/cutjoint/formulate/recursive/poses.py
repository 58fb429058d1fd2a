"""The poses of all bodies as blocks of the tree's coordinates: the kinematics of the recursion, and nothing of its dynamics."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import sympy

from cutjoint.formulate.inputs import make_charts, make_translator, open_parameters
from cutjoint.formulate.records import Chart
from cutjoint.formulate.recursive.kinematics import derive_kinematics
from cutjoint.formulate.scene_inputs import derive_scene_inputs
from cutjoint.model.records import Parameter, Scene
from cutjoint.program.blocks import Block, Builder
from cutjoint.topology.records import Topology


@dataclass(frozen=True, kw_only=True)
class PoseEquations:
    """A point p of a body in the design position is at ``rotations`` (3, 3) p + ``shifts`` (3, 1), from the world's origin.

    Symbols are ``q:joint`` by ``charts``, ``t``, ``parameters`` and ``inputs``, the scene's values by ``laws`` over LAW_TIME.
    """

    charts: tuple[Chart, ...]
    parameters: tuple[Parameter, ...]
    laws: tuple[Block, ...]
    rotations: Mapping[str, Block]
    shifts: Mapping[str, Block]


def derive_poses(topology: Topology, scene: Scene) -> PoseEquations:
    """The poses of the bodies of a model in a scene."""
    model, b = topology.model, Builder()
    charts = make_charts(topology)
    k = derive_kinematics(b, make_translator(b, model), topology, {c.joint: c for c in charts})
    origin = (sympy.Integer(0),) * 3
    laws = derive_scene_inputs(b, model, scene, (), events=False)
    return PoseEquations(
        charts=charts, parameters=open_parameters(model), laws=tuple(law for f in laws.functions for law in f.results.values()),
        rotations={name: k.frames[name].R for name in topology.order},
        shifts={name: k.absolute(name, k.point(name, origin)) for name in topology.order},
    )  # fmt: skip
