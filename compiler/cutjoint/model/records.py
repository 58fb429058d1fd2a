"""The records of a validated model.

A :class:`Model` is flat: submodels are instantiated and mirrored, names are resolved, units are SI.
Nothing is derived.  Every number is a SymPy expression over parameter symbols, so that a parameter can
stay open until the binary loads it.  Points and directions are given in the design position in the one
global frame; every body frame is parallel to it there.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum

from cutjoint.elements.force import Force as Force
from cutjoint.elements.force import LawForce as LawForce
from cutjoint.elements.forces import *  # noqa: F403
from cutjoint.elements.joint import JointElement
from cutjoint.elements.joints import JOINTS
from cutjoint.elements.terms import JointKind as JointKind
from cutjoint.elements.terms import Scalar as Scalar
from cutjoint.elements.terms import Span as Span
from cutjoint.elements.terms import Vector as Vector
from cutjoint.methods import Loops

GROUND = "ground"
VALUE = "value"  #: the quantity of a first-order state, and of a signal
#: The scalar coordinates of each joint kind, in order.
COORDINATES: Mapping[str, tuple[str, ...]] = {kind: element.coordinates for kind, element in JOINTS.items()}
#: The speeds of each joint kind, in order: the rates of the coordinates, then the angular velocity of a ball in the axes of the body before
#: it (rad/s).
SPEEDS: Mapping[str, tuple[str, ...]] = {kind: element.speeds for kind, element in JOINTS.items()}
STEP = 1e-3  #: the length of equal steps where none is given, s


class Binding(StrEnum):
    """The time at which a parameter gets its value."""

    CONST = "const"  #: folded into the generated code
    PARAM = "param"  #: read when the binary loads its parameters
    INPUT = "input"  #: set at every step, by a scene's function of time or by the host program


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """A named number. ``value`` is in SI units, ``unit`` its SI unit's text, empty when the file gives none.
    ``symbol`` stands for the parameter in expressions, for any binding: the real symbol ``p_`` + name, while the variables of laws are
    real symbols of their own names (``length``, ``t``, ...), so that none can clash."""

    name: str
    symbol: Scalar
    value: float
    unit: str
    binding: Binding
    span: Span


@dataclass(frozen=True, kw_only=True)
class DerivedParameter:
    """A parameter that follows from others: ``value`` is an expression of their symbols, which stands wherever the parameter is used."""

    name: str
    value: Scalar
    span: Span


@dataclass(frozen=True, kw_only=True)
class FirstOrderState:
    """A state in addition to the mechanism's, whose rate is an expression of time, parameters, inputs and quantities of elements.

    * ``symbol``: its symbol in expressions
    * ``initial``: its value where a run begins, an expression of parameters
    * ``nominal``: its usual size, in its unit, by which its absolute error tolerance is scaled
    * ``bounds``: the values between which its rate keeps it, or none
    """

    name: str
    symbol: Scalar
    rate: Scalar
    initial: Scalar
    unit: str
    span: Span
    nominal: float = 1.0
    bounds: tuple[float, ...] = ()

    @property
    def entry(self) -> str:
        """The name of its place in a state, and of its column."""
        return f"{self.name}.{VALUE}"


@dataclass(frozen=True, kw_only=True)
class Signal:
    """A named expression of time, parameters, inputs and quantities of elements, for which ``symbol`` stands in other expressions.
    A ``reported`` signal is an output's: nothing reads it, so that it may read accelerations and reactions."""

    name: str
    symbol: Scalar
    value: Scalar
    unit: str
    span: Span
    reported: bool = False


@dataclass(frozen=True, kw_only=True)
class DiscreteState:
    """A discrete state of a controller, constant between samples.

    * ``name``: that of a quantity of the controller; "" of a value that only a later sample reads
    * ``start``: its value before the first sample, an expression of parameters
    * ``next``: its value after a sample, an expression of quantities at the sample
    """

    name: str
    symbol: Scalar
    start: Scalar
    next: Scalar
    unit: str


@dataclass(frozen=True, kw_only=True)
class Controller:
    """Values that are computed at the times ``offset`` + k ``every`` (s) and constant in between.
    ``signals`` are computed at a sample, by symbols of their own; ``discrete_states`` are then updated from these simultaneously."""

    name: str
    every: float
    offset: float
    signals: tuple[Signal, ...]
    discrete_states: tuple[DiscreteState, ...]
    span: Span

    @property
    def quantities(self) -> Mapping[str, str]:
        """The discrete states that other elements may read, with their units."""
        return {value.name: value.unit for value in self.discrete_states if value.name}

    @property
    def expressions(self) -> tuple[Scalar, ...]:
        """All expressions that it computes at a sample."""
        return (*(signal.value for signal in self.signals), *(value.next for value in self.discrete_states))


class ShapeKind(StrEnum):
    """The kind of a body's shape, by its key in the file."""

    BOX = "box"  #: its three lengths along its axes
    CYLINDER = "cylinder"  #: radius and length, around its one axis
    SPHERE = "sphere"  #: its radius
    ROD = "rod"  #: without thickness between two points
    POINT = "point"  #: without extent


@dataclass(frozen=True, kw_only=True)
class Shape:
    """A part of a body that has a shape: ``points`` are its centre, or a rod's two ends, ``sizes`` in m as its kind says.
    A ``hole`` takes mass away."""

    kind: ShapeKind
    points: tuple[Vector, ...]
    axes: tuple[Vector, ...] = ()
    sizes: tuple[Scalar, ...] = ()
    hole: bool = False


@dataclass(frozen=True, kw_only=True)
class Visual:
    """The picture of a body: a ``mesh``, "" for none, and a ``colour``, "" for any. The model file at ``span`` names the file of the mesh.
    A point p of the mesh is at ``at`` + ``scale`` (p1 axes[0] + p2 axes[1] + p3 axes[2]) in the design position; m."""

    mesh: str
    colour: str
    at: Vector
    axes: tuple[Vector, Vector, Vector]
    scale: float
    span: Span


@dataclass(frozen=True, kw_only=True)
class Body:
    """A rigid body; one without mass may have inertia, as a shaft's about its axis, and its centre is the origin unless given.

    ``inertia`` is (Ixx, Iyy, Izz, Ixy, Ixz, Iyz) about the body's own centre of mass in global design axes, kg m2; the last three are
    elements of the inertia matrix (products of inertia with their sign reversed).  ``shapes`` are those that mass, centre and inertia come
    from; none where the file gives these as numbers.  ``visuals`` are drawn in place of shapes; a body welded of several has those of all.
    """

    name: str
    mass: Scalar
    centre_of_mass: Vector
    inertia: tuple[Scalar, Scalar, Scalar, Scalar, Scalar, Scalar]
    span: Span
    shapes: tuple[Shape, ...] = ()
    visuals: tuple[Visual, ...] = ()

    @property
    def is_massless(self) -> bool:
        """Return whether the body has neither mass nor inertia at any values of the parameters."""
        return self.mass == 0 and all(entry == 0 for entry in self.inertia)


@dataclass(frozen=True, kw_only=True)
class Joint:
    """A joint between two bodies, ``base`` and ``follower``.

    ``element`` is the catalogue's record of its kind. ``at`` is the joint's point in the design position, common to both bodies. ``axes``
    holds the joint's axis and second axis, if the kind has them. ``to`` is the follower's point where it is another. ``pitch`` is the
    advance of a screw, m/rad. The joint's coordinates and speeds are named by :data:`COORDINATES` and :data:`SPEEDS`. ``cut`` is True for a
    joint that the model cuts, False for one that must be in the tree, None for the compiler's choice. ``guide`` prescribes the joint's
    coordinates, each as a function of ``t`` and of inputs. ``armature`` is the inertia of its coordinate in addition to that of the bodies,
    such as a geared rotor's, kg m2 or kg. ``arm`` (m) multiplies the equations between directions of a cut joint, 1 unless the mechanism's
    size is far from 1 m.
    """

    name: str
    kind: str
    base: str
    follower: str
    at: Vector
    axes: tuple[Vector, ...]
    to: Vector | None
    pitch: Scalar | None
    cut: bool | None
    guide: tuple[Scalar, ...] | None
    span: Span
    armature: Scalar = 0
    arm: float = 1.0

    @property
    def element(self) -> JointElement:
        """The element of the joint's kind in the catalogue."""
        return JOINTS[self.kind]


@dataclass(frozen=True, kw_only=True)
class JointCoordinate:
    """A scalar coordinate of a tree joint, named as in :data:`COORDINATES`, with its unit, "rad" or "m"."""

    joint: str
    name: str
    unit: str


@dataclass(frozen=True, kw_only=True)
class Gear:
    """A relation: the first coordinate is ``ratio`` times the second one, of another joint, or a ``law`` of it, its ``position``.
    ``ratio`` is in the unit of the first coordinate by that of the second one, not zero, and None where there is a law. ``others`` are
    further coordinates with their ratios, whose products are added."""

    name: str
    first: JointCoordinate
    second: JointCoordinate
    ratio: Scalar
    span: Span
    law: Scalar = None
    others: tuple[tuple[JointCoordinate, Scalar], ...] = ()

    @property
    def coordinates(self) -> tuple[JointCoordinate, ...]:
        """The coordinates that it relates."""
        return (self.first, self.second, *(coordinate for coordinate, _ in self.others))

    @property
    def joints(self) -> tuple[str, ...]:
        """The names of its joints."""
        return tuple(coordinate.joint for coordinate in self.coordinates)

    @property
    def terms(self) -> tuple[tuple[JointCoordinate, Scalar], ...]:
        """The coordinates with their factors in its equation without its law, if it has one: the sum of these is zero."""
        if self.law is not None:
            return ((self.first, 1),)
        return ((self.first, 1), (self.second, -self.ratio), *((coordinate, -ratio) for coordinate, ratio in self.others))


@dataclass(frozen=True, kw_only=True)
class Guard:
    """A force that a pass has removed from the model, and the condition of its removal. ``margins`` are expressions over the variables of
    the force's law: while none of them is negative, the law is zero. ``index`` is the force's place among all forces. For a tyre only the
    lateral force was removed, and it has no index; its margins are expressions over ``side``, the value of the lateral force."""

    force: Force
    margins: tuple[Scalar, ...]
    index: int | None

    @property
    def name(self) -> str:
        """The name of the force."""
        return self.force.name

    @property
    def span(self) -> Span:
        """The place of the force."""
        return self.force.span


@dataclass(frozen=True, kw_only=True)
class Series:
    """A function of a coordinate q and, optionally, of a guided coordinate u, as a sum of basis functions.
    ``coefficients`` (n, m) belong to the products of n basis functions of q and m Chebyshev polynomials of u; m is 1 without u.
    ``growth`` is the coefficient of a term linear in q, for functions on a full turn."""

    coefficients: tuple[tuple[float, ...], ...]
    growth: float = 0.0


@dataclass(frozen=True, kw_only=True)
class Interval:
    """A range of values, m or rad."""

    lower: float
    upper: float

    @property
    def middle(self) -> float:
        """The middle of the range."""
        return (self.lower + self.upper) / 2

    @property
    def half(self) -> float:
        """Half the length of the range."""
        return (self.upper - self.lower) / 2


@dataclass(frozen=True, kw_only=True)
class LoopFunctions:
    """Loop embeddings: by tree joint, ``series`` has one for each scalar coordinate, then three for the Rodrigues parameters of a ball.

    They are valid on ``range`` of q and ``drive_range`` of u: one value if u is fixed, None if no guide moves the loops.
    Where ``is_periodic`` they are trigonometric polynomials over a full turn, else polynomials over the range.  ``violation`` (m, rad) is
    the largest residual of the cut joints that was found, ``violation_rate`` the largest rate of one at the speed q' = 1.

    If the geometry is ``open`` (tunable), these functions are for the parameters' default values, and coefficients are fitted again when
    parameters are loaded, with violations of at most ``allowed`` at ``nodes`` values of q.
    """

    series: Mapping[str, tuple[Series, ...]]
    range: Interval
    drive_range: Interval | None
    is_periodic: bool
    violation: float
    violation_rate: float
    open: bool = False
    nodes: int = 0
    allowed: float = 0.0


@dataclass(frozen=True, kw_only=True)
class EmbeddedLoop:
    """Loops of one degree of freedom as explicit functions of an independent coordinate.
    The scalar coordinate of the joint ``independent`` is q. The ``drive`` is a guided joint whose scalar coordinate is u, if there is
    one. ``bodies`` move relative to ``carrier``; ``cuts`` are the cut joints that the ``functions`` satisfy."""

    independent: str
    drive: str | None
    carrier: str
    bodies: tuple[str, ...]
    cuts: tuple[str, ...]
    functions: LoopFunctions
    span: Span

    @property
    def name(self) -> str:
        """The name of the independent joint, after which the guard of the ranges is named."""
        return self.independent


@dataclass(frozen=True, kw_only=True)
class Reaction:
    """A sensor: the force and moment of a joint, in the tree or cut, on its follower. The moment is about the follower's point of the
    joint. Components are along ``direction``, which is fixed in ``body``, or without one along the axes of ``body``."""

    name: str
    joint: str
    body: str
    direction: Vector | None
    span: Span


@dataclass(frozen=True, kw_only=True)
class RodForce:
    """A sensor of a reduced model: the weighted sum of the compressive forces of cut distance joints.
    ``weights`` are names of joints with their weights."""

    name: str
    weights: tuple[tuple[str, Scalar], ...]
    span: Span


@dataclass(frozen=True, kw_only=True)
class Marker:
    """A sensor: a point of a body with position, velocity and acceleration as quantities."""

    name: str
    body: str
    point: Vector
    span: Span


class SegmentKind(StrEnum):
    """The shape of one stretch of road."""

    FLAT = "flat"  #: constant height over ``length``
    RAMP = "ramp"  #: straight, ``rise`` over ``length``
    STEP = "step"  #: vertical change by ``rise`` (length zero)
    COSINE = "cosine"  #: amplitude * (1 - cos(2 pi x / length)), added to the current height


@dataclass(frozen=True, kw_only=True)
class RoadSegment:
    """One stretch of road; lengths in m."""

    kind: SegmentKind
    length: float
    rise: float
    span: Span


@dataclass(frozen=True, kw_only=True)
class HeightTable:
    """Heights on a grid, m, for each place along x those along y; the first is at ``start``, others at distances ``step`` (x, y), m."""

    start: tuple[float, float]
    step: tuple[float, float]
    heights: tuple[tuple[float, ...], ...]
    bilinear: bool
    span: Span


@dataclass(frozen=True, kw_only=True)
class CurvedGrid:
    """Heights along a line as in OpenCRG: cross sections (x, y, height, banking), m, ``step`` apart, each with heights at ``across``.
    ``borders`` are OpenCRG's modes beyond the edges along and across, with ``offsets`` added; over ``smooth`` from begin and end heights
    become those of the line. A ``closed`` line has its first step and its number of steps, else zeros."""

    sections: tuple[tuple[float, float, float, float], ...]
    across: tuple[float, ...]
    heights: tuple[tuple[float, ...], ...]
    step: float
    borders: tuple[int, int]
    offsets: tuple[float, float]
    smooth: tuple[float, float]
    closed: tuple[float, float]
    span: Span


@dataclass(frozen=True, kw_only=True)
class RoughSurface:
    """A rough road of a class of ISO 8608, which its ``seed`` determines; ``width`` (m) is about y = 0."""

    grade: str
    seed: int
    width: float
    span: Span


@dataclass(frozen=True, kw_only=True)
class Patch:
    """A rectangle of a road (from and to x and y, m) with a factor ``friction``, reached over ``edge`` (m)."""

    x: tuple[float, float]
    y: tuple[float, float]
    friction: float
    edge: float
    span: Span


@dataclass(frozen=True, kw_only=True)
class Road:
    """Height over x, of the left (y > 0) and the right track; the first segment begins at x = ``start``.

    Before it the road is flat at height zero, after the last segment it stays at the height reached.
    ``contact`` is "point" (a follower, force along the local normal) or "disc" (the wheel as a rigid disc,
    vertical force).  The heights of a ``surface`` are added to both tracks, ``patches`` have another friction, a later one on those before.
    """

    contact: str = "point"
    start: float = 0.0
    left: tuple[RoadSegment, ...] = ()
    right: tuple[RoadSegment, ...] = ()
    surface: HeightTable | CurvedGrid | RoughSurface | None = None
    patches: tuple[Patch, ...] = ()

    @property
    def parts(self) -> frozenset[str]:
        """The parts that it has in addition to its tracks: "surface", "friction"."""
        found = {"surface": self.surface is not None, "friction": bool(self.patches)}
        return frozenset(name for name, has in found.items() if has)


@dataclass(frozen=True, kw_only=True)
class Output:
    """One column of the results: ``element`` is a body, joint, force or sensor, ``quantity`` the reported quantity.
    In a reduced model ``stands_for`` is the column's name in the full one, whose value is ``factor`` times this one's. An output by an
    expression has a ``name`` of its own and may have a ``unit``, which has ``factor`` of those of the element's quantity."""

    element: str
    quantity: str
    span: Span
    stands_for: str = ""
    factor: float = 1.0
    name: str = ""
    unit: str = ""

    @property
    def column(self) -> str:
        """The column's name in a CSV header."""
        return self.stands_for or self.name or f"{self.element}.{self.quantity}"


@dataclass(frozen=True, kw_only=True)
class Numerics:
    """Settings of the numerical method.

    * ``dt`` (s): equal steps, None for adaptive ones; ``integrator``: None for the default by method and ``dt``
    * ``tolerance``: relative change of accelerations that ends an iteration, or relative error of an adaptive step, whose
      ``absolute_tolerance`` (m, rad, m/s, rad/s) is the same value if None; ``iterations``: their limit
    * ``events``: "located" or "crossed", None for the integrator's default; ``spectral_radius``: of "generalised-alpha"
    * ``closure``: "proximal", "solved" or "penalty", None for the integrator's default
    * ``penalty`` (alpha), ``damping_ratio`` (xi), ``frequency`` (omega, 1/s): of cut joints; a penalty of None follows from masses and else
      bounds that of "proximal" and "solved"; ``multiplier_updates``: corrections of multipliers in a step
    * ``loops``: "exact" or "embedded", by functions within ``loop_tolerance`` (m, rad) on the range that ``loop_terms`` allow
    * ``methods``: settings by method; ``by_step``: penalty and frequency as expressions of dt
    """

    dt: float | None = None
    penalty: float | None = None
    damping_ratio: float = 1.0
    frequency: float = 10.0
    tolerance: float = 1e-6
    iterations: int = 100
    multiplier_updates: int = 4
    integrator: str | None = None
    events: str | None = None
    absolute_tolerance: float | None = None
    spectral_radius: float = 0.8
    methods: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    by_step: Mapping[str, Scalar] = field(default_factory=dict)
    closure: str | None = None
    loops: str = Loops.EXACT
    loop_tolerance: float = 1e-10
    loop_terms: int = 20

    @property
    def step(self) -> float:
        """The length of equal steps, s."""
        return STEP if self.dt is None else self.dt

    def of_method(self, method: str) -> "Numerics":
        """The settings of one method, at its step; NaN where an expression has no value there."""
        from cutjoint.model.expressions.evaluate import evaluate

        own = self.methods.get(method, {})
        dt = own.get("dt", self.dt)
        laws = self.by_step if dt != self.dt else {}
        followed = {name: evaluate(law, dict.fromkeys(law.free_symbols, STEP if dt is None else dt)) for name, law in laws.items()}
        return replace(self, **{**followed, **own})  # type: ignore[arg-type]


@dataclass(frozen=True, kw_only=True)
class Plot:
    """A picture of a scene's run: the columns ``y`` over the column ``x``."""

    name: str
    x: str
    y: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class Aim:
    """A condition on a scene's start: an expression of coordinates and places, given as text, has a value, SI units.
    ``unit`` is that in which the value is written, or the expression is, and ``size`` its size in SI."""

    name: str
    expression: Scalar
    value: Scalar
    unit: str
    size: float
    span: Span


@dataclass(frozen=True, kw_only=True)
class Unknown:
    """A number that a trim finds. ``entry`` is its place among the numbers of its ``kind``, "position", "rate", "state", "input" or
    "parameter". ``bounds`` are the least and the largest value, SI units, of one that has some."""

    name: str
    kind: str
    entry: str
    unit: str
    span: Span
    bounds: tuple[Scalar, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Trim:
    """A start at which rates of speeds and states are zero, except those ``unsteady``, and expressions have the values of ``hold``."""

    find: tuple[Unknown, ...]
    hold: tuple[Aim, ...]
    unsteady: tuple[Unknown, ...]
    span: Span


@dataclass(frozen=True, kw_only=True)
class Found:
    """A number that a trim has found, SI units: its value, ``begin``, the ``size`` of its changes, and its bounds.
    ``kind``: "move", the coordinate of the speed ``name``, which has a value only if it is listed, "rate", "input" or "parameter"."""

    kind: str
    name: str
    begin: float
    size: float
    lower: float
    upper: float


@dataclass(frozen=True, kw_only=True)
class SolvedTrim:
    """A trimmed start: the ``aims`` besides rates of zero, what was ``found``, velocities that follow from loops, and ``unsteady`` ones."""

    aims: tuple[Aim, ...]
    found: tuple[Found, ...]
    dependent: frozenset[str]
    unsteady: frozenset[str]


@dataclass(frozen=True, kw_only=True)
class Scene:
    """One run of the model: its start, inputs, switches, road, numerics and outputs.

    * ``pose``: "design" or "equilibrium"; ``positions``, ``rates``: by ``joint.coordinate``; an attitude by ``joint.e0`` to ``joint.e3``,
      the quaternion from the follower's axes to the base's, of length one within `UNIT_BOUND`; ``near``: positions that are initial guesses
    * ``assemble``: conditions on the start with closed loops, after which ``positions`` are all coordinates; ``trim``: the steady start,
      ``solved_trim`` once it is found
    * ``starts``: initial values of first-order states by their places; ``entries``: places by "section.joint.coordinate"
    * ``inputs``: expressions of ``t``, parameters' values by default; ``switches``: forces on or off; ``guides``: of joints that the scene
      locks or drives, None of released ones
    * ``method``: the formulation, "" for the default, "auto" to choose for ``accuracy`` (m, rad) and ``budget`` (times real time);
      ``targets``: the largest errors of outputs, by their columns and in their units, in place of ``accuracy``
    * ``on_violation``: of a guard: "stop", "restart" with the full model, None to stop for forces alone; ``plots``: its plots
    """

    name: str
    end: float
    output_step: float
    pose: str
    positions: Mapping[str, Scalar]
    rates: Mapping[str, Scalar]
    inputs: Mapping[str, Scalar]
    switches: Mapping[str, bool]
    road: Road
    numerics: Numerics
    outputs: tuple[Output, ...]
    span: Span
    method: str = ""
    accuracy: float | None = None
    targets: Mapping[str, float] = field(default_factory=dict)
    budget: float | None = None
    on_violation: str | None = None
    entries: Mapping[str, Span] = field(default_factory=dict, compare=False)
    starts: Mapping[str, Scalar] = field(default_factory=dict)
    guides: Mapping[str, tuple[Scalar, ...] | None] = field(default_factory=dict)
    plots: tuple[Plot, ...] = ()
    assemble: tuple[Aim, ...] = ()
    near: tuple[str, ...] = ()
    trim: Trim | None = None
    solved_trim: SolvedTrim | None = field(default=None, compare=False)

    def __repr__(self) -> str:
        return f"<Scene '{self.name}': to {self.end:g} s, a row each {self.output_step:g} s, {len(self.outputs)} outputs>"


@dataclass(frozen=True, kw_only=True)
class SuppliedFunction:
    """A function of a model: its name, the names of its arguments, and whether its code has partial derivatives too.
    ``units`` are those of arguments that have one. ``results`` are their names with their units, "" where none is known; the only result
    of a function has the name "". ``memory`` is the size in bytes of its memory, which it reads and its update writes."""

    name: str
    arguments: tuple[str, ...]
    partials: bool
    span: Span
    units: Mapping[str, str] = field(default_factory=dict)
    results: Mapping[str, str] = field(default_factory=lambda: {"": ""})
    memory: int = 0

    @property
    def words(self) -> int:
        """The number of discrete states of its memory: each has four bytes as a whole number, which every double holds to the bit."""
        return -(-self.memory // 4)

    @property
    def is_plain(self) -> bool:
        """True for one result and no memory."""
        return self.words == 0 and "" in self.results


@dataclass(frozen=True, kw_only=True)
class Model:
    """A validated model: the content of the file, flat and in SI units.
    Element names are unique; an element of an instance is called ``instance.element``.

    * ``derived``: parameters replaced by expressions; ``frozen``: those that exported code has as constants
    * ``states``, ``signals``, ``controllers``: first-order states, named expressions, discrete states
    * ``guards``: forces that a pass removed; a run stops where one would act; ``embedded_loops``: loops replaced by functions
    * ``written``: joints as in the file where those of a scene differ; ``functions``, ``code``: supplied by the user, in C++
    * ``text``, ``files``: of the model file and of those that it names; ``notes``: warnings; ``choices``: declared by submodels, by
      instance; ``display``: units of plots, pages and tables
    """

    name: str
    gravity: Vector
    parameters: tuple[Parameter, ...]
    bodies: tuple[Body, ...]
    joints: tuple[Joint, ...]
    forces: tuple[Force, ...]
    reactions: tuple[Reaction | RodForce, ...]
    markers: tuple[Marker, ...]
    scenes: Mapping[str, Scene]
    span: Span
    text: str = field(repr=False)
    guards: tuple[Guard, ...] = ()
    gears: tuple[Gear, ...] = ()
    derived: tuple[DerivedParameter, ...] = ()
    states: tuple[FirstOrderState, ...] = ()
    signals: tuple[Signal, ...] = ()
    controllers: tuple[Controller, ...] = ()
    embedded_loops: tuple[EmbeddedLoop, ...] = ()
    files: Mapping[str, str] = field(default_factory=dict, repr=False)
    notes: tuple[str, ...] = ()
    choices: Mapping[str, str] = field(default_factory=dict)
    written: tuple[Joint, ...] | None = None
    functions: tuple[SuppliedFunction, ...] = ()
    code: str = field(default="", repr=False)
    frozen: tuple[str, ...] = ()
    display: tuple[str, ...] = ()

    def __repr__(self) -> str:
        elements = {"bodies": self.bodies, "joints": self.joints, "gears": self.gears, "forces": self.forces, "scenes": self.scenes}
        return f"<Model '{self.name}': {', '.join(f'{len(x)} {name}' for name, x in elements.items())}>"

    @property
    def content(self) -> str:
        """All texts that the model follows from."""
        return "\0".join((self.text, *self.files.values()))

    @property
    def constraint_spans(self) -> Mapping[str, Span]:
        """The places of all elements that may have equations: bodies, joints, gears and states by their names."""
        elements: tuple[Body | Joint | Gear | FirstOrderState, ...] = (*self.bodies, *self.joints, *self.gears, *self.states)
        return {element.name: element.span for element in elements}

    @property
    def discrete_states(self) -> tuple[DiscreteState, ...]:
        """The discrete states of all controllers, in their order."""
        return tuple(value for controller in self.controllers for value in controller.discrete_states)

    @property
    def dependent_joints(self) -> Mapping[str, EmbeddedLoop]:
        """The embedded loop of each dependent joint, by the joint's name."""
        return {joint: embedded_loop for embedded_loop in self.embedded_loops for joint in embedded_loop.functions.series}

    @property
    def force_elements(self) -> tuple[Force, ...]:
        """The forces, with those that were removed, in their original order."""
        forces = list(self.forces)
        for guard in self.guards:
            if guard.index is not None:
                forces.insert(guard.index, guard.force)
        return tuple(forces)
