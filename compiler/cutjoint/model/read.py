"""From a model file to a :class:`Model`: read this first.

Problems are collected over all steps and raised together; only a text that is not YAML, or a document whose
frame is wrong, ends the reading early.
"""

from collections.abc import Sequence
from os.path import isfile
from pathlib import Path

from cutjoint.model import validate
from cutjoint.model.document.checks import check_shape
from cutjoint.model.document.renamed import MODEL, rename_fields
from cutjoint.model.document.source import parse_yaml, read_text
from cutjoint.model.elements.expand import expand
from cutjoint.model.errors import Problems
from cutjoint.model.expressions.dependencies import check_levels
from cutjoint.model.expressions.scope import Element
from cutjoint.model.expressions.tunable import TunableNumbers
from cutjoint.model.expressions.units import ACCELERATION, UnitError, display_units
from cutjoint.model.files.referenced import with_files
from cutjoint.model.records import Model, Span
from cutjoint.model.scenes.build import read_scenes
from cutjoint.package.locations import AnyPath, path_of


def read_model(path: AnyPath, *, tunable: Sequence[str] = ()) -> Model:
    """Read and validate the model file at ``path``.  Numbers whose names match one of ``tunable``, such as "*.stiffness", become
    parameters.

    Raises ModelError with all problems found; numbers in the result are SI.
    """
    is_file = isfile(path)  # a pipe is in no folder
    return read_model_text(read_text(Path(path)), str(path), folder=Path(path).parent if is_file else None, tunable=tunable)


def read_model_text(text: str, file: str, *, folder: AnyPath | None = None, tunable: Sequence[str] = ()) -> Model:
    """Read and validate a model from its text; ``file`` is the name that places and messages carry, ``folder`` has the files that it names.

    Raises ModelError with all problems found.
    """
    # text -> plain data with places, that of its files included
    problems = Problems()
    source, files, lost = with_files(parse_yaml(text, file), path_of(folder), problems)
    source, notes = rename_fields(source, problems, MODEL)
    # data -> document of the right shape
    shaped = check_shape(source, problems, lost)
    if shaped is None:
        raise problems.error()
    document = shaped.document
    validate.check_names(source, problems, document)
    validate.check_submodels(source, problems, document)
    # document -> flat elements with expressions
    tunables = TunableNumbers(list(tunable))
    expansion = expand(source, problems, shaped, tunables)
    # elements -> scenes that refer to them
    scenes, reported = read_scenes(document, expansion)
    root = Element(expansion.scope, "model", document.name, ())
    gravity = root.triple(document.gravity, ACCELERATION, ("gravity",))
    try:
        display_units(document.display)
    except UnitError as error:
        root.fail(f"display: {error}", "such as [deg, mm, km/h]", ("display",))
    for problem in tunables.problems(tunable, Span(file=file, line=1, column=1)) if not shaped.removed else ():
        problems.add(problem.span, problem.element, problem.message, problem.hint)
    # one check of the whole
    validate.check_elements(expansion, problems)
    elements = expansion.elements
    sampled = (signal for controller in elements.controllers for signal in controller.signals)
    check_levels(elements.forces, (*elements.signals, *sampled, *reported), problems)
    model = Model(
        name=document.name,
        gravity=gravity,
        display=document.display,
        parameters=(*expansion.parameters, *tunables.parameters.values()),
        derived=expansion.derived,
        bodies=elements.bodies,
        joints=elements.joints,
        gears=elements.gears,
        forces=elements.forces,
        reactions=elements.reactions,
        markers=elements.markers,
        states=elements.states,
        signals=(*elements.signals, *reported),
        controllers=elements.controllers,
        functions=tuple(expansion.scope.functions.values()),
        scenes=scenes,
        span=source.key_span(("name",)),
        text=text,
        files=files,
        notes=(
            *notes, *problems.notes, *validate.unused_parameters(source, document), *validate.unused_properties(source, document),
            *validate.silent_outputs(source, scenes, elements.forces), *validate.warnings_of(document, expansion.reporting),
        ),
        choices=validate.choices_made(document, expansion.reporting),
    )
    if problems:
        raise problems.error(model if validate.is_connected(expansion) else None)
    return model
