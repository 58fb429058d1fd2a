"""Laws, rates, signals and controllers that read quantities of elements, as blocks: the part that all formulations share."""

from collections.abc import Callable, Iterable, Iterator, Mapping

from cutjoint.formulate.forces import is_active
from cutjoint.formulate.translate import Translator
from cutjoint.model.expressions.dependencies import SignalOrder
from cutjoint.model.expressions.parse import quantities_read, quantity_symbol
from cutjoint.model.expressions.quantities import readings_of
from cutjoint.model.records import Force, Model, Output, RodForce, Scalar, Scene, Vector
from cutjoint.program.blocks import Block, Builder


def reading(b: Builder, translator: Translator, model: Model, quantity: Callable[[Output], Block]) -> Translator:
    """A translator that knows signals, and the quantities of bodies, markers, joints and forces as ``quantity`` makes them."""
    sampled = (signal for controller in model.controllers for signal in controller.signals)
    signals = {signal.symbol: signal for signal in (*model.signals, *sampled)}
    made: dict[Scalar, Block] = {}
    order = SignalOrder(signals)

    def read(symbol: Scalar) -> Block:
        if symbol in signals:
            for signal in order.below(symbol):  # each behind those that it reads
                if signal.symbol not in made:
                    with b.section("signal", signal.name, "", signal.span.place):
                        made[signal.symbol] = b.name(known.scalar(signal.value), "signal", signal.name)
            return made[symbol]
        ((element, name),) = quantities_read(symbol)
        return quantity(Output(element=element, quantity=name, span=model.span))

    known = translator.reading(read)
    return known


def measured_forces(model: Model, scene: Scene, outputs: tuple[Output, ...]) -> Iterator[tuple[Force, frozenset[str]]]:
    """Forces with those of their quantities that follow from the motion alone and are read.
    Of forces that are switched off, those of ``outputs`` too."""
    read = readings_of(model)
    for force in model.forces:
        asked, known = (read, force.measured) if is_active(force, scene) else ((*read, *outputs), force.measured_when_off)
        names = frozenset(o.quantity for o in asked if o.element == force.name) & known
        if names:
            yield force, names


def needs_place(force: Force, model: Model, scene: Scene, outputs: Iterable[Output]) -> bool:
    """Return whether a force acts, or the positions of its parts are needed although it is switched off."""
    return is_active(force, scene) or any(
        o.element == force.name and o.quantity in force.measured_when_off for o in (*readings_of(model), *outputs)
    )


def reported_symbol(model: Model, name: str) -> Scalar | None:
    """The symbol of the expression of an output of that name; None if there is none."""
    return next((signal.symbol for signal in model.signals if signal.reported and signal.name == name), None)


def rod_force(b: Builder, translator: Translator, sensor: RodForce, multipliers: Callable[[str], Block]) -> Block:
    """The force of rods of distance joints: the residual of a distance is in m, so that its multiplier is the tension."""
    return b.neg(b.total([b.scale(translator.scalar(weight), multipliers(rod)) for rod, weight in sensor.weights]))


def named_quantity(
    b: Builder, translator: Translator, model: Model, output: Output, forces: Mapping[str, Mapping[str, Block]],
    motion: Callable[[str, Vector, str], Block],
) -> Block | None:  # fmt: skip
    """The value of a quantity of a body's or marker's ``motion``, of ``forces``, of a state, a signal or a controller; None of a joint.
    It is zero for the law of a force that the scene has switched off or that a guard stands for."""
    places = {body.name: (body.name, body.centre_of_mass) for body in model.bodies}
    places |= {marker.name: (marker.body, marker.point) for marker in model.markers}
    if output.element in places:
        return motion(*places[output.element], output.quantity)
    if any(force.name == output.element for force in model.force_elements):
        return forces.get(output.element, {}).get(output.quantity, b.zero(1))
    symbols = {element.name: element.symbol for group in (model.states, model.signals) for element in group}
    symbols |= {c.name: quantity_symbol(c.name, output.quantity) for c in model.controllers}
    return translator.scalar(symbols[output.element]) if output.element in symbols else None
