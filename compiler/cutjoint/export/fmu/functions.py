"""Functions of FMI 3 that every FMU exports, and those of them that ours refuse."""

from __future__ import annotations

_REFERENCES = "const fmi3ValueReference*, size_t"
_KNOWN = f", {_REFERENCES}, {_REFERENCES}, const fmi3Float64*, size_t, fmi3Float64*, size_t"

Function = tuple[str, str]

#: What no FMU has: names without the prefix, and what C++ arguments they have after the instance.
MISSING: tuple[Function, ...] = (
    ("GetNumberOfVariableDependencies", ", fmi3ValueReference, size_t*"),
    ("GetVariableDependencies", ", fmi3ValueReference, size_t*, fmi3ValueReference*, size_t*, int*, size_t"),
    ("EnterConfigurationMode", ""),
    ("ExitConfigurationMode", ""),
    ("GetIntervalDecimal", f", {_REFERENCES}, fmi3Float64*, int*"),
    ("GetIntervalFraction", f", {_REFERENCES}, fmi3UInt64*, fmi3UInt64*, int*"),
    ("GetShiftDecimal", f", {_REFERENCES}, fmi3Float64*"),
    ("GetShiftFraction", f", {_REFERENCES}, fmi3UInt64*, fmi3UInt64*"),
    ("SetIntervalDecimal", f", {_REFERENCES}, const fmi3Float64*"),
    ("SetIntervalFraction", f", {_REFERENCES}, const fmi3UInt64*, const fmi3UInt64*"),
    ("SetShiftDecimal", f", {_REFERENCES}, const fmi3Float64*"),
    ("SetShiftFraction", f", {_REFERENCES}, const fmi3UInt64*, const fmi3UInt64*"),
    ("EvaluateDiscreteStates", ""),
    ("GetOutputDerivatives", f", {_REFERENCES}, const fmi3Int32*, fmi3Float64*, size_t"),
    ("ActivateModelPartition", ", fmi3ValueReference, fmi3Float64"),
)

#: What only FMUs for co-simulation with event mode have.
OF_STEPS: tuple[Function, ...] = (("EnterStepMode", ""),)

#: What these and FMUs for model exchange have.
OF_EVENTS: tuple[Function, ...] = (
    ("EnterEventMode", ""),
    ("UpdateDiscreteStates", ", fmi3Boolean*, fmi3Boolean*, fmi3Boolean*, fmi3Boolean*, fmi3Boolean*, fmi3Float64*"),
)

#: What only FMUs for model exchange have.
OF_EXCHANGE: tuple[Function, ...] = (
    ("GetDirectionalDerivative", _KNOWN),
    ("GetAdjointDerivative", _KNOWN),
    ("EnterContinuousTimeMode", ""),
    ("CompletedIntegratorStep", ", fmi3Boolean, fmi3Boolean*, fmi3Boolean*"),
    ("SetTime", ", fmi3Float64"),
    ("SetContinuousStates", ", const fmi3Float64*, size_t"),
    ("GetContinuousStateDerivatives", ", fmi3Float64*, size_t"),
    ("GetEventIndicators", ", fmi3Float64*, size_t"),
    ("GetContinuousStates", ", fmi3Float64*, size_t"),
    ("GetNominalsOfContinuousStates", ", fmi3Float64*, size_t"),
    ("GetNumberOfEventIndicators", ", size_t*"),
    ("GetNumberOfContinuousStates", ", size_t*"),
)


def missing_functions(*, exchanges: bool, stops_at_events: bool) -> tuple[Function, ...]:
    """What an FMU has not that may be for model exchange, and whose co-simulation may have event mode."""
    groups = ((OF_STEPS, stops_at_events), (OF_EVENTS, exchanges or stops_at_events), (OF_EXCHANGE, exchanges))
    return MISSING + tuple(function for group, there in groups if not there for function in group)
