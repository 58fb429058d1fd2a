"""Masses and inertias that follow from what a study varies: which runs have some that no body can have."""

from __future__ import annotations

import numpy as np

from cutjoint.model.evaluate import evaluate_runs
from cutjoint.model.mass import can_exist
from cutjoint.model.records import Binding
from cutjoint.run.errors import RunError
from cutjoint.run.run_file import MASSES, following, parameter_values
from cutjoint.sweeps.records import Array, Kind, Study, of_kind


class Masses:
    """Says of runs why no body can have the masses and inertias that their parameters ask for.

    All runs are looked at with NumPy; those that seem impossible are judged as single runs are, in the same words.
    """

    def __init__(self, study: Study) -> None:
        model, places = study.model, of_kind(study.variables, Kind.PARAMETER)
        self._study, self._places = study, {study.variables[i].name: i for i in places}
        self._parameters = [p for p in model.parameters if p.binding is not Binding.INPUT]
        moving = {p.symbol for p in self._parameters if p.name in self._places}
        self._bodies = [body for body in model.bodies if any(entry.free_symbols & moving for entry in (body.mass, *body.inertia))]

    def faults(self, values: Array) -> dict[int, str]:
        """The reasons that runs with values (runs, variables) cannot be, by their places."""
        runs, suspects = len(values), set[int]()
        given = {p.symbol: values[:, self._places[p.name]] if p.name in self._places else p.value for p in self._parameters}
        for body in self._bodies:
            mass, *inertia = (evaluate_runs(entry, given, runs) for entry in (body.mass, *body.inertia))
            suspects.update(map(int, np.flatnonzero(~can_exist(mass, np.column_stack(inertia)))))
        found = {run: self._fault(values[run]) for run in sorted(suspects)}
        return {run: fault for run, fault in found.items() if fault}

    def _fault(self, values: Array) -> str:
        """The reason that no body can have the masses of one run; "" if they can."""
        model = self._study.model
        changes = {name: float(values[place]) for name, place in self._places.items()}
        try:
            following(model, self._study.scenes[0], parameter_values(model, changes), (MASSES,))
        except RunError as error:
            return str(error)
        return ""
