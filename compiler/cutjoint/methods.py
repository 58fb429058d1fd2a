"""The methods, integrators and solvers by name, and which go together."""

from __future__ import annotations

METHODS = ("recursive", "augmented", "classical", "recursive-newton")

#: Methods that have a generic twin.
TWINS = ("recursive", "augmented", "classical")

#: How the recursive method holds its cut joints.
CLOSURES = ("penalty", "proximal")

#: What each iteration of a step calls, by method.
ITERATIONS = {"recursive": "evaluate", "augmented": "linearise", "classical": "linearise", "recursive-newton": "linearise"}

#: Linear solvers of the Lagrangian methods: the emitted factorisation, and libraries.
SOLVERS = ("emitted", "eigen-ldlt", "eigen-lu", "cholmod", "klu", "umfpack")

#: Those that need a symmetric matrix.
SYMMETRIC_SOLVERS = frozenset({"eigen-ldlt", "cholmod"})

#: Those of SuiteSparse, some of them under the GPL: simulators that have them are for comparison.
COMPARISON_SOLVERS = frozenset({"cholmod", "klu", "umfpack"})

#: Explicit Runge-Kutta methods of the recursive equations: with steps of equal length, and with steps as long as the tolerance allows.
EXPLICIT = ("rk4", "dormand-prince")

#: Implicit methods of the equations `recursive-newton`: of order 4 with steps as long as the tolerance allows or of equal length, and of
#: order 2 with damping of what is fast.
IMPLICIT = ("sdirk4", "sdirk4-fixed", "generalised-alpha")

#: Those of both that take steps as long as the tolerance allows.
ADAPTIVE = ("dormand-prince", "sdirk4")

#: What becomes of events, where forces, guides or drives change their formulas: steps end there, or go over them.
EVENTS = ("located", "crossed")

#: The integrators whose steps end at events unless they are asked to go over them; those of the others, but for the reference, do if asked.
LOCATING = ("rk4", "dormand-prince", "sdirk4", "sdirk4-fixed")

#: The trapezoidal rule of the methods, explicit and implicit methods, and accurate solutions to measure them by: extrapolation in
#: relative coordinates (recursive) and a Runge-Kutta method of order 8 in natural coordinates (classical).
INTEGRATORS = ("trapezoidal", *EXPLICIT, *IMPLICIT, "reference")

#: Code made for the model, or the generic twin that interprets the model at run time.
IMPLEMENTATIONS = ("generated", "generic")
