"""The variables of an FMU: time, parameters, settings, the given start, inputs, outputs, and for model exchange states with derivatives.

Outputs depend on other variables at the start and while a host integrates; at a communication point an output is that of the last step,
and follows from nothing else.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace

from cutjoint.elements.joints import JOINTS
from cutjoint.formulate.inputs import INPUT_ORDERS, INPUTS, TIME, guided_by, input_functions
from cutjoint.formulate.records import RecursiveEquations
from cutjoint.methods import INTEGRATORS
from cutjoint.model.records import VALUE
from cutjoint.program.blocks import Block
from cutjoint.run.record import RunFile
from cutjoint.run.run_file import Evaluator

#: The unit of a joint's attitude, a quaternion.
_PLAIN = ""
_STATES = ("An independent coordinate, chosen again during the motion", "The rate of an independent coordinate", "A first-order state")
#: The numbers of a pose, in the order of the C interface, with words and units.
_POSE = (
    *((axis, f"Place along {axis}", "m") for axis in "xyz"),
    *((f"q{part}", f"Part {part} of the unit quaternion of the attitude", "") for part in "wxyz"),
    *((f"v{axis}", f"Velocity along {axis}", "m/s") for axis in "xyz"),
    *((f"w{axis}", f"Angular velocity about {axis}", "rad/s") for axis in "xyz"),
    *((f"d{axis}", f"Place along {axis} in the design position", "m") for axis in "xyz"),
)


@dataclass(frozen=True)
class Variable:
    """A real variable in the words of the standard; its value reference is its place among all.

    ``start`` is its value before a run, None of what is calculated.  ``dependencies`` are the value references that determine an output,
    state or derivative at the start, ``following`` all that do so while a host integrates.  ``derives`` is the value reference of the state
    whose derivative it is.
    """

    name: str
    causality: str
    variability: str
    description: str
    unit: str
    start: float | None
    dependencies: tuple[int, ...] = ()
    following: tuple[int, ...] = ()
    derives: int | None = None


@dataclass(frozen=True, kw_only=True)
class Start:
    """A coordinate or speed that the start gives: ``kind`` says which, ``index`` is its place among all of them."""

    name: str
    kind: str
    index: int
    unit: str
    value: float


@dataclass(frozen=True, kw_only=True)
class Interface:
    """Each kind of variable in the order of value references, after time, which has 0.

    ``poses`` are those of bodies and markers on request; what follows them is for model exchange alone.  ``rates`` are the first and second
    derivatives of the inputs whose numbers ``rated`` has: those that move guides.
    """

    parameters: tuple[Variable, ...]
    settings: tuple[Variable, ...]
    starts: tuple[Start, ...]
    inputs: tuple[Variable, ...]
    outputs: tuple[Variable, ...]
    poses: tuple[Variable, ...] = ()
    rated: tuple[int, ...] = ()
    rates: tuple[Variable, ...] = ()
    states: tuple[Variable, ...] = ()
    derivatives: tuple[Variable, ...] = ()
    indicators: tuple[Variable, ...] = ()

    @property
    def variables(self) -> tuple[Variable, ...]:
        """All of them; their places are their value references.  The model's names stay, others give way to them."""
        time = Variable("time", "independent", "continuous", "Time", "s", None)
        taken = {v.name for v in (*self.parameters, *self.inputs, *self.outputs)}
        fixed = [_beside(taken, v) for v in (time, *self.settings, *map(_of_start, self.starts))]
        exchanged = [_beside(taken, v) for v in (*self.poses, *self.rates, *self.states, *self.derivatives, *self.indicators)]
        return (fixed[0], *self.parameters, *fixed[1:], *self.inputs, *self.outputs, *exchanged)


def _beside(taken: set[str], variable: Variable) -> Variable:
    while variable.name in taken:
        variable = replace(variable, name=f"{variable.name}_")
    return variable


def make_interface(equations: RecursiveEquations, run_file: RunFile, dofs: int | None = None, posed: Sequence[str] = ()) -> Interface:
    """The variables of a C export: those for model exchange too if it has degrees of freedom, and the poses of ``posed`` elements.
    Raises RunError: an input has no finite value at the start."""
    values = ((p, float(run_file.parameters[p.name])) for p in equations.parameters)
    parameters = tuple(Variable(p.name, "parameter", "tunable", "Parameter of the model", p.unit, value) for p, value in values)
    settings, starts, inputs = tuple(_settings(run_file)), tuple(_starts(equations, run_file)), _inputs(equations)
    counts = (len(parameters), len(settings), len(starts), len(inputs))
    outputs = _outputs(equations, starts, counts)
    poses = tuple(replace(_local(f"pose.{body}.{name}", f"{about}, of {body}"), unit=unit) for body in posed for name, about, unit in _POSE)
    interface = Interface(parameters=parameters, settings=settings, starts=starts, inputs=inputs, outputs=outputs, poses=poses)
    return interface if dofs is None else _with_states(interface, equations, dofs)


def _with_states(interface: Interface, equations: RecursiveEquations, dofs: int) -> Interface:
    """The interface with rates of inputs, states, their derivatives and event indicators; outputs follow from states."""
    first_input = 1 + len(interface.parameters) + len(interface.settings) + len(interface.starts)
    first_rate = first_input + len(interface.inputs) + len(interface.outputs) + len(interface.poses)
    model = equations.topology.model
    rated = tuple(i for i, p in enumerate(equations.inputs) if guided_by(model, p) is not None)
    first_state = first_rate + 2 * len(rated)
    count = 2 * dofs + len(equations.state.states)
    places = tuple(range(first_state, first_state + dofs))
    speeds = tuple(range(first_state + dofs, first_state + count))
    solving, columns = _leaves_of_columns(equations)

    def with_rates(inputs: Iterable[int]) -> tuple[int, ...]:
        """Inputs by their value references, with those of their rates."""
        numbers = [rated.index(g - first_input) for g in inputs if g - first_input in rated]
        return tuple(sorted({*inputs, *(first_rate + 2 * k + order for k in numbers for order in (0, 1))}))

    def known(direct: LeafSymbols, *, is_solved: bool = False) -> tuple[int, ...]:
        """A value follows from all that accelerations do where it needs these; all speeds of loops follow from places too."""
        is_solved = is_solved or direct.has("vdot:", "lambda:")
        leaves, rates = direct | solving if is_solved else direct, is_solved or direct.has("v:")
        time, inputs = ((0,) if "t" in leaves.symbols else ()), with_rates([first_input + i for i in leaves.inputs])
        return (*time, *inputs, *(places if rates or direct.has("q:") else ()), *(speeds if rates else ()))

    start = with_rates(range(1, first_input + len(interface.inputs)))  # a state is chosen in the pose that all of it leads to
    kinds = [_STATES[0]] * dofs + [_STATES[1]] * dofs + [_STATES[2]] * (count - 2 * dofs)
    states = tuple(_local(f"state[{i}]", about, start) for i, about in enumerate(kinds, 1))
    derivatives = tuple(
        replace(
            _local(f"der(state[{i + 1}])", f"Derivative of state[{i + 1}]", start), derives=first_state + i,
            following=(speeds[i],) if i < dofs else known(solving, is_solved=True),
        )
        for i in range(count)
    )  # fmt: skip
    indicators = tuple(
        _local(f"event[{i + 1}]", f"Changes its sign where {s.element} changes its formula") for i, s in enumerate(equations.indicators)
    )
    outputs = tuple(
        replace(o, dependencies=with_rates(o.dependencies), following=known(found))
        for o, found in zip(interface.outputs, columns, strict=True)
    )
    rates = tuple(rate for i in rated for rate in _rates(interface.inputs[i]))
    return replace(interface, outputs=outputs, rated=rated, rates=rates, states=states, derivatives=derivatives, indicators=indicators)


def _rates(value: Variable) -> tuple[Variable, Variable]:
    unit = value.unit or "1"
    return (
        replace(value, name=f"der({value.name})", description=f"Derivative of {value.name}", unit=f"{unit}/s", start=0.0),
        replace(value, name=f"der({value.name},2)", description=f"Second derivative of {value.name}", unit=f"{unit}/s^2", start=0.0),
    )


def _local(name: str, description: str, dependencies: tuple[int, ...] = ()) -> Variable:
    return Variable(name, "local", "continuous", description, _PLAIN, None, dependencies)


def _settings(run_file: RunFile) -> Iterator[Variable]:
    of_run = run_file.settings
    settings = [("step", "Length of the integrator's steps", "s", of_run.dt)]
    if INTEGRATORS[of_run.integrator].adaptive:
        settings = [("step", "Longest step", "s", of_run.dt)]
        settings.append(("relative_tolerance", "Error of a step as a share of a coordinate or speed", "", of_run.tolerance))
        absolute = "Error of a step relative to nominal values (1 in SI units near a metre)"
        settings.append(("absolute_tolerance", absolute, "", of_run.absolute_tolerance or of_run.tolerance))
    for name, description, unit, value in settings:
        yield Variable(f"integrator.{name}", "parameter", "tunable", description, unit, float(value))


def _starts(equations: RecursiveEquations, run_file: RunFile) -> Iterator[Start]:
    units = {f"{joint.name}.{name}": unit for joint in equations.topology.model.joints for name, unit in JOINTS[joint.kind].units.items()}
    units |= {state.entry: state.unit for state in equations.topology.model.states}
    for kind, part, names in (
        ("coordinate", run_file.positions, equations.coordinate_names), ("speed", run_file.rates, equations.speed_names),
    ):  # fmt: skip
        for name, value in part.items():
            yield Start(name=name, kind=kind, index=names.index(name), unit=units.get(name, _PLAIN), value=float(value))


def _of_start(start: Start) -> Variable:
    what = VALUE if start.name.endswith(f".{VALUE}") else start.kind
    return Variable(f"start.{start.name}", "parameter", "fixed", f"The {what} at the start", start.unit, start.value)


def _inputs(equations: RecursiveEquations) -> tuple[Variable, ...]:
    model, scene = equations.topology.model, equations.scene
    laws, value = input_functions(model, scene), Evaluator(model, {})
    where = f"{scene.span}: scene '{scene.name}': input"
    starts = ((p, value(laws[p.symbol].subs(TIME, 0), f"{where} '{p.name}' at the start")) for p in equations.inputs)
    return tuple(Variable(p.name, "input", "continuous", "Input of the model", p.unit, start) for p, start in starts)


def _outputs(equations: RecursiveEquations, starts: Sequence[Start], counts: tuple[int, int, int, int]) -> tuple[Variable, ...]:
    first_setting = 1 + counts[0]
    first_start = first_setting + counts[1]
    first_input = first_start + counts[2]

    solving, columns = _leaves_of_columns(equations)
    closes = bool(equations.closures) or equations.scene.pose == "equilibrium"

    def initial(leaves: LeafSymbols) -> tuple[int, ...]:
        """All of the start's equations determine a column that needs a result of them, else the given values of its own joints do."""
        is_solved = leaves.has("vdot:", "lambda:", *(("q:", "v:") if closes else ()))
        used = leaves | solving if is_solved else leaves
        joints = ((i, start.name.rpartition(".")[0]) for i, start in enumerate(starts, first_start))
        given = (i for i, joint in joints if is_solved or leaves.has(f"q:{joint}", f"v:{joint}"))
        settings = range(first_setting, first_start) if is_solved else ()
        return tuple(sorted({*(1 + i for i in used.parameters), *(first_input + i for i in used.inputs), *given, *settings}))

    return tuple(
        Variable(c.name, "output", "continuous", f"{o.quantity} of {o.element}", c.unit, None, initial(leaves))
        for c, o, leaves in zip(equations.columns, equations.outputs, columns, strict=True)
    )


@dataclass(frozen=True, kw_only=True)
class LeafSymbols:
    """The symbols that blocks follow from: numbers of inputs and of parameters, and the names of all others."""

    inputs: frozenset[int] = field(default_factory=frozenset)
    parameters: frozenset[int] = field(default_factory=frozenset)
    symbols: frozenset[str] = field(default_factory=frozenset)

    def __or__(self, other: "LeafSymbols") -> "LeafSymbols":
        return LeafSymbols(
            inputs=self.inputs | other.inputs, parameters=self.parameters | other.parameters, symbols=self.symbols | other.symbols
        )

    def has(self, *prefixes: str) -> bool:
        """Return whether a symbol begins with one of these."""
        return any(symbol.startswith(prefixes) for symbol in self.symbols)


def find_leaves(blocks: Iterable[Block]) -> LeafSymbols:
    """The symbols that any of the blocks follows from."""
    inputs, parameters, symbols = set(), set(), set()
    waiting, seen = list(blocks), set()
    while waiting:
        block = waiting.pop()
        if block in seen:
            continue
        seen.add(block)
        of = block.args[0] if block.op == "take" else block
        rows = range(*block.data[0]) if block.op == "take" else range(block.shape[0])  # type: ignore[index]
        if of.op != "symbol":
            waiting += block.args
        elif of.data == INPUTS:
            inputs |= {row // len(INPUT_ORDERS) for row in rows}
        elif of.data == "parameters":
            parameters |= set(rows)
        else:
            symbols.add(str(of.data))
    return LeafSymbols(inputs=frozenset(inputs), parameters=frozenset(parameters), symbols=frozenset(symbols))


def _leaves_of_columns(equations: RecursiveEquations) -> tuple[LeafSymbols, list[LeafSymbols]]:
    """The symbols of all that is solved for accelerations and multipliers, and those of each column."""
    solving = (block for name in ("evaluate", "constraint_residual") for block in equations.function(name).results.values())
    report = equations.function("report").results
    return find_leaves(solving), [find_leaves([report[f"column:{c.name}"]]) for c in equations.columns]
