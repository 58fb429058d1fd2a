"""The solution of a step by ``recursive-newton``, and the cost of its functions."""

from __future__ import annotations

from cutjoint.compile.systems import formulate_system
from cutjoint.formulate.records import RecursiveEquations
from cutjoint.program.schedule import schedule
from cutjoint.report.explain.views import Chapter, Entry, make_table

_ABOUT = {
    "dynamic_residual": r"$f$ and $\Phi$",
    "linearise": r"the same and $T$",
    "constraint_residual": r"$\Phi$, $\dot \Phi$, $\ddot \Phi$",
    "apply_jacobian_transposed": r"$\Phi_z^T w$",
    "apply_jacobian": r"$\Phi_z x$",
}

_STEP = (
    "The elimination above finds where a run begins. A step solves the balance of the same bodies, joints and forces for the accelerations "
    "of the joints, from which positions and speeds follow by the trapezoidal rule (eqs. 43, 44)."
)

_BALANCE = (
    r"f = S^T \sum F + \Phi_z^T (\alpha \Phi + \lambda) - \tau = 0, \quad F_i = M_i \ddot Z_i - Q_i",
    r"T = f_{\ddot z} + \frac{\Delta t}{2} f_{\dot z} + \frac{\Delta t^2}{4} (f_z + \Phi_z^T \alpha \Phi_z)",
)

_ITERATION = (
    r"Factors of the tangent at the pose $z_0$ are kept, over steps too, while the iteration gets on with them; what violates the "
    r"constraints is corrected along their $\Phi_z$. Multipliers take over what the penalty carries when the iteration is near its end."
)

_CORRECTIONS = (
    r"T_0 \, \Delta z = -\frac{\Delta t^2}{4} (f + \Phi_{z_0}^T \alpha \Phi), \quad \lambda \leftarrow \lambda + \alpha \Phi",
)


def explain_newton(start: RecursiveEquations, method: str) -> Chapter:
    """The equations of a step in the recursion's coordinates; ``start`` are those that begin a run."""
    equations, _ = formulate_system(start, method, ())
    program = schedule(equations.builder, [(f.name, f.results) for f in equations.functions])
    rows = [(f"`{name}`", about, str(program.operations(name))) for name, about in _ABOUT.items()]
    costs, nothing = make_table(("function", "gives", "operations"), rows), make_table((), ())
    return Chapter(title=f"The {method} method", notes=(_STEP,), formulas=_BALANCE, entries=(
        Entry(title="Iteration", notes=(_ITERATION,), formulas=_CORRECTIONS, table=nothing),
        Entry(title="Operations", notes=("Of one call, all lanes counted.",), formulas=(), table=costs),
    ))  # fmt: skip
