"""Names that stand in two places are the same names."""

from __future__ import annotations

from typing import Any, get_args, get_type_hints

from cutjoint.methods import CLOSURES, COMPARISON_SOLVERS, EVENTS, EXPLICIT, IMPLICIT, METHODS, SOLVERS, SYMMETRIC_SOLVERS
from cutjoint.model.document import Numerics, Scene


def literals(annotation: Any) -> set[str]:
    """The texts that an annotation allows."""
    if isinstance(annotation, str):
        return {annotation}
    return {text for part in get_args(annotation) for text in literals(part)}


def allowed(part: type, field: str) -> set[str]:
    return literals(get_type_hints(part)[field])


def test_model_files_take_the_names_of_methods() -> None:
    assert allowed(Numerics, "closure") == set(CLOSURES)
    assert allowed(Numerics, "integrator") == {"trapezoidal", *EXPLICIT, *IMPLICIT}
    assert allowed(Numerics, "events") == set(EVENTS)
    assert allowed(Numerics, "methods") == set(METHODS)
    assert allowed(Scene, "method") == {"auto", *METHODS}


def test_solvers_are_of_the_kinds_that_there_are() -> None:
    assert SYMMETRIC_SOLVERS.issubset(SOLVERS)
    assert COMPARISON_SOLVERS.issubset(SOLVERS)
