"""Functions of FMI 3 that every FMU exports, and those of them that ours refuse."""

from __future__ import annotations

_REFERENCES = "const fmi3ValueReference*, size_t"
_KNOWN = f", {_REFERENCES}, {_REFERENCES}, const fmi3Float64*, size_t, fmi3Float64*, size_t"

Function = tuple[str, str, str]

#: Functions that no FMU has: names without the prefix, C++ arguments after the instance, and the missing ability.
MISSING: tuple[Function, ...] = (
    ("GetNumberOfVariableDependencies", ", fmi3ValueReference, size_t*", "dependencies that change"),
    ("GetVariableDependencies", ", fmi3ValueReference, size_t*, fmi3ValueReference*, size_t*, int*, size_t", "dependencies that change"),
    ("EnterConfigurationMode", "", "configuration mode"),
    ("ExitConfigurationMode", "", "configuration mode"),
    ("GetIntervalDecimal", f", {_REFERENCES}, fmi3Float64*, int*", "clocks"),
    ("GetIntervalFraction", f", {_REFERENCES}, fmi3UInt64*, fmi3UInt64*, int*", "clocks"),
    ("GetShiftDecimal", f", {_REFERENCES}, fmi3Float64*", "clocks"),
    ("GetShiftFraction", f", {_REFERENCES}, fmi3UInt64*, fmi3UInt64*", "clocks"),
    ("SetIntervalDecimal", f", {_REFERENCES}, const fmi3Float64*", "clocks"),
    ("SetIntervalFraction", f", {_REFERENCES}, const fmi3UInt64*, const fmi3UInt64*", "clocks"),
    ("SetShiftDecimal", f", {_REFERENCES}, const fmi3Float64*", "clocks"),
    ("SetShiftFraction", f", {_REFERENCES}, const fmi3UInt64*, const fmi3UInt64*", "clocks"),
    ("EvaluateDiscreteStates", "", "discrete states"),
    ("GetOutputDerivatives", f", {_REFERENCES}, const fmi3Int32*, fmi3Float64*, size_t", "derivatives of outputs"),
    ("ActivateModelPartition", ", fmi3ValueReference, fmi3Float64", "model partitions"),
)

#: Functions that only FMUs for co-simulation with event mode have.
OF_STEPS: tuple[Function, ...] = (("EnterStepMode", "", "event mode"),)

#: Functions that these and FMUs for model exchange have.
OF_EVENTS: tuple[Function, ...] = (
    ("EnterEventMode", "", "event mode"),
    ("UpdateDiscreteStates", ", fmi3Boolean*, fmi3Boolean*, fmi3Boolean*, fmi3Boolean*, fmi3Boolean*, fmi3Float64*", "event mode"),
)

#: Functions that only FMUs for model exchange have.
OF_EXCHANGE: tuple[Function, ...] = (
    ("GetDirectionalDerivative", _KNOWN, "directional derivatives"),
    ("GetAdjointDerivative", _KNOWN, "adjoint derivatives"),
    ("EnterContinuousTimeMode", "", "model exchange"),
    ("CompletedIntegratorStep", ", fmi3Boolean, fmi3Boolean*, fmi3Boolean*", "model exchange"),
    ("SetTime", ", fmi3Float64", "model exchange"),
    ("SetContinuousStates", ", const fmi3Float64*, size_t", "model exchange"),
    ("GetContinuousStateDerivatives", ", fmi3Float64*, size_t", "model exchange"),
    ("GetEventIndicators", ", fmi3Float64*, size_t", "model exchange"),
    ("GetContinuousStates", ", fmi3Float64*, size_t", "model exchange"),
    ("GetNominalsOfContinuousStates", ", fmi3Float64*, size_t", "model exchange"),
    ("GetNumberOfEventIndicators", ", size_t*", "model exchange"),
    ("GetNumberOfContinuousStates", ", size_t*", "model exchange"),
)


def missing_functions(*, exchanges: bool, stops_at_events: bool) -> tuple[Function, ...]:
    """The functions that an FMU lacks; it may be for model exchange, and its co-simulation may have event mode."""
    groups = ((OF_STEPS, stops_at_events), (OF_EVENTS, exchanges or stops_at_events), (OF_EXCHANGE, exchanges))
    return MISSING + tuple(function for group, there in groups if not there for function in group)
