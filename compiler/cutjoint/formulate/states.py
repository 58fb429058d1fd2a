"""First-order states beside the mechanism: their rates x' = f, and the part x' - f = 0 of a residual with a tangent.

The unknown of a step is x', with which x changes by ``damping``.  The function ``sample`` updates the discrete states of controllers.
"""

from collections.abc import Callable, Iterator, Mapping

from cutjoint.formulate.inputs import DISCRETE_STATES, discrete_state_name, elements_read
from cutjoint.formulate.layout import Slot, StateLayout
from cutjoint.formulate.quantities import reading
from cutjoint.formulate.records import POSES, SAMPLE, Equations, Function
from cutjoint.formulate.translate import Translator
from cutjoint.model.records import Model, Output
from cutjoint.program.blocks import BindingTime, Block, Builder
from cutjoint.program.differentiate import Inputs, Variation
from cutjoint.program.lower import reachable_blocks

#: A row and a column of the tangent, and the entry there.
Entry = tuple[int, int, Block]
_OBSERVING = frozenset({SAMPLE, "report", "aims", "energy", "domains", POSES})  #: functions that evaluate a motion without changing it


def state_rates(b: Builder, translator: Translator, model: Model) -> dict[str, Block]:
    """f of each state by its name."""
    rates = {}
    for state in model.states:
        with b.section("state", state.name, "x' = f", state.span.place):
            rates[state.name] = b.record(translator.scalar(state.rate), "state_rate", state.name)
    return rates


def state_residuals(b: Builder, translator: Translator, model: Model) -> dict[str, Block]:
    """The results x' - f."""
    residuals = {}
    for state in model.states:
        with b.section("force_residual", state.name, "x' - f", state.span.place):
            change = b.symbol(f"vdot:{state.name}", 1, BindingTime.ITERATION)
            residual = b.sub(change, translator.scalar(state.rate))
            residuals[f"force_residual:{state.name}"] = b.record(residual, "state_residual", state.name)
    return residuals


def placed_states(b: Builder, model: Model) -> dict[str, Block]:
    """The states where a run begins, which are those of the mechanism that has found the start."""
    return {f"placed_rate:{s.name}": b.symbol(f"relative_v:{s.name}", 1, BindingTime.ITERATION) for s in model.states}


def still_states(b: Builder, model: Model, result: str) -> dict[str, Block]:
    """The states' share of a result in which no state takes part."""
    return {f"{result}:{state.name}": b.zero(1) for state in model.states}


def by_state(b: Builder, name: str, damping: Block) -> Variation:
    """The change of blocks with the rate of a state."""
    x = b.symbol(f"v:{name}", 1, BindingTime.ITERATION)
    return Variation(b, Inputs(), frozenset({f"v:{name}"}), {x: damping}, {})


def state_tangent(
    b: Builder, translator: Translator, layout: StateLayout, model: Model, damping: Block, *, symmetric: bool
) -> Iterator[Entry]:
    """The derivatives of the states' equations by the states; of a symmetric tangent those of each by its own state.
    Most states drive others that do not act on them; their symmetric part may have no positive pivots."""
    rates = state_rates(b, translator, model)
    changes = {s.name: by_state(b, s.name, damping) for s in model.states}
    for i, row in enumerate(model.states):
        with b.section("tangent", row.name, "1 - df/dx", row.span.place):
            for j, column in enumerate(model.states):
                if i == j or not symmetric:
                    change = changes[column.name].of(rates[row.name])
                    yield layout.speeds + i, layout.speeds + j, b.sub(b.number(float(i == j)), change)


def sample_function(b: Builder, translator: Translator, model: Model, quantity: Callable[[Output], Block]) -> tuple[Function, ...]:
    """The function of a model with controllers that gives the next value of each discrete state. It depends on the state and the discrete
    states at that instant. ``quantity`` knows accelerations and reactions too, which are those of the forces with the values before."""
    if not model.controllers:
        return ()
    at_sample = reading(b, translator, model, quantity)
    results: dict[str, Block] = {}
    for controller in model.controllers:
        for value in controller.discrete_states:
            with b.section("controller", controller.name, "", controller.span.place):
                results[f"{SAMPLE}:{len(results)}"] = at_sample.scalar(value.next)
    state = ("const Real* q", "const Real* v", "const Real* vdot", "const Real* lambda")
    return (Function(name=SAMPLE, arguments=(*state, "Real* next_discrete"), results=results),)


def sample_slots(model: Model) -> Mapping[str, Slot]:
    """The places of its results."""
    names = map(discrete_state_name, model.discrete_states)
    return {f"{SAMPLE}:{i}": Slot(array="next_discrete", offset=i, names=(name,)) for i, name in enumerate(names)}


def describe_controllers(equations: Equations) -> list[dict[str, object]]:
    """The controllers as steps know them: name, place in the model file, times (s), and the number of discrete states of each.
    ``affects`` has a digit for each of these: 1 if accelerations, states, events or guards read it, plus 2 if samples of later controllers
    do. One that is ``accelerated`` reads more of a state than coordinates and speeds at its samples."""
    affecting = elements_read((b for f in equations.functions if f.name not in _OBSERVING for b in f.results.values()), DISCRETE_STATES)
    sample = next((f.results for f in equations.functions if f.name == SAMPLE), {})
    described, end = list[dict[str, object]](), 0
    for controller in equations.topology.model.controllers:
        own = range(end, end := end + len(controller.discrete_states))
        reached = reachable_blocks(sample[f"{SAMPLE}:{i}"] for i in own if sample)
        later = elements_read(list(sample.values())[end:], DISCRETE_STATES)
        described.append({
            "name": controller.name, "place": controller.span.place, "every": controller.every, "offset": controller.offset,
            "discrete": len(own), "affects": "".join(str((i in affecting) + 2 * (i in later)) for i in own),
            "accelerated": any(
                b.op == "symbol" and b.binding is BindingTime.ITERATION and not str(b.data).startswith(("q:", "v:")) for b in reached
            ),
        })  # fmt: skip
    return described
