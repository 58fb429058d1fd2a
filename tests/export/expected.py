"""The agreement of each peer with cutjoint's recursive method, and the reasons for its limits."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from math import inf

from cutjoint.model.records import JointKind
from tests.export.cases import geared, rotor
from tests.export.own import Case, case_of, vehicle

MODELS = ("pendulum", "four_bar", "andrews", "slider_crank", "flyball")

#: A random loop closed by each kind of cut joint: by what, and its seed.
LOOPS: Mapping[str, tuple[str, int]] = {
    JointKind.FIXED: ("branch", 0), JointKind.REVOLUTE: ("branch", 3), JointKind.PRISMATIC: ("ground", 0),
    JointKind.CYLINDRICAL: ("branch", 0), JointKind.SCREW: ("ground", 4), JointKind.UNIVERSAL: ("ground", 3),
    JointKind.PLANAR: ("branch", 4), JointKind.SPHERICAL: ("ground", 0), JointKind.POINT_ON_LINE: ("ground", 1),
    JointKind.DISTANCE: ("branch", 2), "point_on_plane": ("ground", 1), "parallel_axes": ("branch", 0),
}  # fmt: skip


def everywhere(largest: float) -> Mapping[str, float]:
    """One limit for places and velocities."""
    return {"place": largest, "velocity": largest}


@dataclass(frozen=True, kw_only=True)
class Trajectory:
    """A run by a peer with each of ``steps`` (s, falling) beside one of cutjoint with ``own_dt`` (s) up to ``end`` (s).

    ``limits`` (SI units) are the largest differences with the smallest step, by column, or for every "place" and "velocity";
    ``with_largest`` that with the largest step.  ``ratio`` has the limits of the difference with a step over that with the next.
    """

    name: str
    case: Callable[[], Case]
    steps: tuple[float, ...]
    own_dt: float
    end: float
    integrator: str
    limits: Mapping[str, float]
    with_largest: float = inf
    ratio: tuple[float, float] | None = None

    def limit(self, column: str) -> float | None:
        """That of a column; None where it is not compared."""
        return self.limits.get(column, self.limits.get("velocity" if ".v" in column else "place"))


@dataclass(frozen=True, kw_only=True)
class Breakdown:
    """A run that fails: its model, step and end (s), integrator, and what is said; ``steps`` where it is known when."""

    model: str
    dt: float
    end: float
    integrator: str
    message: str
    steps: int | None = None


@dataclass(frozen=True, kw_only=True)
class Expected:
    """Of a peer: the largest relative differences of accelerations at the start, by model, by seed of a random tree, and in a random loop
    closed by each kind of cut joint; runs."""

    accelerations: Mapping[str, float]
    trees: Mapping[int, float]
    loops: Mapping[str, float] = field(default_factory=dict)
    trajectories: tuple[Trajectory, ...]
    breakdown: Breakdown


#: MuJoCo: trees have hard joints, so that accelerations agree to rounding.  Loops are closed by soft constraints, of which 1e-4 of the
#: unconstrained acceleration remains, times the constraints' condition: a percent of the largest.  Gaps close within a step, so that
#: trajectories agree to what the square of the step leaves.
_MUJOCO = Expected(
    # the pendulum's mass point is given an inertia of 1e-9 m2
    accelerations={"pendulum": 2e-9, "flyball": 1e-13, "four_bar": 0.01, "andrews": 0.01, "slider_crank": 0.01},
    # rounding; with guides the millionth that their armature lets through; with screws the softness between advance and angle
    trees={5: 1e-13, 8: 1e-13, 14: 1e-12, 0: 2e-6, 3: 2e-6, 6: 2e-6, 11: 1e-3},
    trajectories=(
        # the trapezoidal rule's error is the larger part for pendulum and four-bar; with soft loops the square of MuJoCo's step
        *(
            Trajectory(name=name, case=partial(case_of, name), steps=(dt,), own_dt=own_dt, end=end, integrator="rk4",
                   limits={"place": place, "velocity": velocity})
            for name, dt, own_dt, end, place, velocity in (
                ("pendulum", 1e-3, 1e-4, 2.0, 1e-7, 5e-7), ("flyball", 1e-4, 1e-5, 0.2, 5e-10, 5e-9),
                ("four_bar", 1e-3, 1e-4, 0.5, 3e-8, 2e-7), ("andrews", 5e-6, 1e-6, 0.02, 1e-8, 0.0),
                ("slider_crank", 5e-4, 5e-5, 1.0, 5e-6, 1e-3),
            )
        ),
        # the trapezoidal rule's error, which is the larger part
        Trajectory(name="gears", case=geared, steps=(1e-3,), own_dt=2.5e-4, end=1.0, integrator="rk4", limits=everywhere(3e-7)),
        # those of first order err by about ten steps
        *(
            Trajectory(name="pendulum", case=partial(case_of, "pendulum"), steps=(1e-4,), own_dt=1e-3, end=1.0, integrator=integrator,
                   limits=everywhere(3e-3))
            for integrator in ("rk4", "euler", "implicit", "implicitfast")
        ),
        # a loop and forces alone are a quadratic problem, which two iterations solve
        *(
            Trajectory(name="four_bar", case=partial(case_of, "four_bar"), steps=(1e-3,), own_dt=1e-4, end=0.5,
                       integrator=f"{integrator}_two_iterations", limits=limits)
            for integrator, limits in (
                ("rk4", {"place": 3e-8, "velocity": 2e-7}), ("euler", everywhere(4e-3)), ("implicitfast", everywhere(4e-3)),
            )
        ),
        # the links carry tons: softness leaves a tenth of a millimetre, and half the step a quarter of it
        Trajectory(name="bump", case=partial(vehicle, "iavsd_inphase_5"), steps=(1e-3, 5e-4), own_dt=2.5e-4, end=0.3, integrator="rk4",
               limits={"chassis.z": 2e-4}, with_largest=2e-4, ratio=(3, 6)),
        # softness lets the wheels give way, by the square of the step
        Trajectory(name="rack", case=partial(vehicle, "iavsd_sine_2mm", rack=0.5), steps=(5e-4, 2.5e-4), own_dt=2.5e-4, end=0.3,
               integrator="rk4", limits={"chassis.y": 1e-4}, ratio=(3, 5)),
    ),
    breakdown=Breakdown(model="flyball", dt=1e-3, end=1.0, integrator="rk4", message="the state is no longer finite, or too large"),
)  # fmt: skip

#: Exudyn: joints are algebraic equations, whose second derivative it finds by differences, so that accelerations of moving loops agree to
#: about 1e-7 of the largest.  Both integrators are of second order: the difference to a run of cutjoint with a smaller step falls by four
#: when the step is halved.
_EXUDYN = Expected(
    accelerations=dict.fromkeys(MODELS, 1e-7),
    # trees without screws, forces on coordinates of free joints, and guides that turn; the third one has a guide
    trees=dict.fromkeys((5, 8, 3, 14, 17), 1e-7),
    loops={kind: 1e-7 for kind in LOOPS if kind is not JointKind.SCREW},
    trajectories=(
        *(
            Trajectory(name=name, case=partial(case_of, name), steps=(dt, dt / 2), own_dt=own_dt, end=end, integrator=integrator,
                   limits=everywhere(largest), ratio=(3.5, 4.5))
            for integrator in ("generalized_alpha", "trapezoidal_index2")
            for name, dt, own_dt, end, largest in (
                ("pendulum", 2e-3, 1e-4, 1.0, 5e-5), ("four_bar", 2e-3, 1e-4, 0.5, 1e-5), ("andrews", 1e-5, 5e-7, 0.01, 2e-8),
                ("slider_crank", 2e-3, 1e-4, 1.0, 1e-3), ("flyball", 1e-3, 5e-5, 0.2, 2e-4),
            )
        ),
        # two rules of second order at the same step of 0.1 ms, at 30 rad/s: an angle goes on beyond a turn
        Trajectory(name="rotor", case=rotor, steps=(1e-4,), own_dt=1e-4, end=1.0, integrator="generalized_alpha", limits=everywhere(1e-4)),
        # 0.6 mm in 0.3 s, to the error of second order at steps of 2 ms
        Trajectory(name="bump", case=partial(vehicle, "iavsd_inphase_5"), steps=(2e-3,), own_dt=5e-4, end=0.3,
            integrator="generalized_alpha",
               limits={"chassis.x": 2e-6, "chassis.z": 5e-6}),
        Trajectory(name="rack", case=partial(vehicle, "iavsd_sine_2mm", rack=0.5), steps=(2e-3,), own_dt=5e-4, end=0.3,
               integrator="generalized_alpha", limits={"chassis.y": 1e-6}),
    ),
    # equations on velocities alone have no solution in the pose at t = 1.2282 s, in which all bars are in line
    breakdown=Breakdown(model="four_bar", dt=2e-3, end=2.0, integrator="trapezoidal_index2", steps=613,
                        message="a step did not converge at t = 1.228 s"),
)  # fmt: skip

#: Pinocchio: joints of the tree in relative coordinates as in cutjoint, loops closed on accelerations by a proximal method without
#: penalty.  What accelerations differ by is rounding, in loops times cutjoint's penalty; what trajectories differ by is the error of
#: cutjoint's trapezoidal rule, where the steps of the Runge-Kutta rule of fourth order are small enough.
_PINOCCHIO = Expected(
    accelerations=dict.fromkeys(MODELS, 1e-11),
    # rounding, or with guides the billionth that armature lets through
    trees={5: 1e-13, 8: 1e-13, 9: 1e-12, 11: 1e-13, 0: 1e-9, 3: 1e-9, 6: 1e-9},
    # contacts for balls, hinges and welds; bodies in parts, welded together, for the rest
    loops=dict.fromkeys(LOOPS, 1e-8),
    trajectories=(
        *(
            Trajectory(name=name, case=partial(case_of, name), steps=(dt,), own_dt=own_dt, end=end, integrator="rk4",
                   limits=everywhere(largest))
            for name, dt, own_dt, end, largest in (
                ("pendulum", 5e-3, 1e-4, 1.0, 1e-7), ("four_bar", 5e-3, 1e-4, 0.5, 1e-7), ("andrews", 4e-5, 1e-6, 0.01, 2e-9),
                ("slider_crank", 5e-4, 1e-4, 1.0, 1e-5), ("flyball", 1e-4, 5e-5, 0.2, 1e-7),
            )
        ),
        # of first order
        Trajectory(name="pendulum", case=partial(case_of, "pendulum"), steps=(2e-3, 1e-3), own_dt=1e-4, end=1.0,
               integrator="semi_implicit_euler", limits=everywhere(0.01), ratio=(1.8, 2.2)),
        Trajectory(name="four_bar", case=partial(case_of, "four_bar"), steps=(2e-3, 1e-3), own_dt=1e-4, end=0.5,
               integrator="lcaba_semi_implicit_euler", limits=everywhere(0.01), ratio=(1.8, 2.2)),
        # another algorithm for the same accelerations, to 1e-8 of the largest
        Trajectory(name="four_bar", case=partial(case_of, "four_bar"), steps=(5e-3,), own_dt=1e-4, end=0.5, integrator="lcaba_rk4",
               limits=everywhere(1e-6)),
        # rows 0.05 s apart, steps by a tolerance of 1e-6
        *(
            Trajectory(name="four_bar", case=partial(case_of, "four_bar"), steps=(0.05,), own_dt=1e-4, end=0.5, integrator=integrator,
                   limits=everywhere(1e-5))
            for integrator in ("dormand_prince", "lcaba_dormand_prince")
        ),
        Trajectory(name="rotor", case=rotor, steps=(1e-3,), own_dt=1e-4, end=1.0, integrator="rk4", limits=everywhere(1e-4)),
        # to the error of cutjoint's second order at steps of 0.5 ms
        Trajectory(name="bump", case=partial(vehicle, "iavsd_inphase_5"), steps=(1e-3,), own_dt=5e-4, end=0.3, integrator="rk4",
               limits={"chassis.x": 2e-7, "chassis.z": 4e-7}),
        Trajectory(name="rack", case=partial(vehicle, "iavsd_sine_2mm", rack=0.5), steps=(1e-3,), own_dt=5e-4, end=0.3, integrator="rk4",
               limits={"chassis.y": 2e-7}),
    ),
    # the fastest eigenvalue is -8075 1/s: the rule of fourth order is stable up to 2.785/8075 s
    breakdown=Breakdown(model="flyball", dt=1e-3, end=1.0, integrator="rk4",
                        message="the accelerations are not finite: the step is too large, or a motion moves no mass"),
)  # fmt: skip

EXPECTED: Mapping[str, Expected] = {"mujoco": _MUJOCO, "exudyn": _EXUDYN, "pinocchio": _PINOCCHIO}
