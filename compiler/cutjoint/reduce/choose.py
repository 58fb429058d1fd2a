"""`method: auto`: the model, method and steps that keep a scene's accuracy with the least work, found by interpreted runs.

The reference is the full model with steps that are refined until the motion has converged. Candidates are the last reduced models of each
motion, with exact or embedded loops, by the methods that embed loops, with adaptive and with equal steps; other methods follow if none of
these keeps the accuracy. Each is run with coarse steps first, and given up where these already take more work than another candidate.
"""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from hashlib import sha256
from importlib.metadata import PackageNotFoundError
from math import ceil, inf
from pathlib import Path

from cutjoint.compile.derivation import with_requested_loops
from cutjoint.compile.options import CompileOptions
from cutjoint.compile.pipeline import compile_scene
from cutjoint.compile.prepared import build_provenance
from cutjoint.methods import DEFAULT_INTEGRATOR, INTEGRATORS, METHODS, Events, Implementation, Loops, Method
from cutjoint.model.records import Model, Numerics, Scene
from cutjoint.package.errors import CutjointError, RunError, ToolchainError
from cutjoint.reduce.measure import Reference, asked_of, distance, find_reference, time_run
from cutjoint.reduce.sequence import ReducedModel, reduction_sequence, started
from cutjoint.reduce.trials import Steps, Trials
from cutjoint.run.run_file import fitting_interval
from cutjoint.run.scenes import with_default_closure, with_loops, with_settings
from cutjoint.run.settings import find_closure
from cutjoint.toolchain.cache import cache_folder, read_record, write_record
from cutjoint.toolchain.compiler import processor

SHARE = 0.8  #: the share of the accuracy that a choice may use; the rest is for the error of the reference
#: Tolerances that are tried: the largest, the number for each power of ten, and powers of ten.
LARGEST_TOLERANCE, PER_DECADE, DECADES = 1e-2, 8, 8
#: Equal steps that are tried: the number for each halving, and halvings; the longest is that of `run_file.fitting_interval`.
PER_HALVING, HALVINGS = 4, 12
ENOUGH = 1.05  #: the search of steps ends where coarser ones would save less
#: The assumed order of errors in the tolerance and in equal steps, on the low side, and the share that is tried after a failed run.
ORDERS, AFTER_FAILURE = (0.7, 2.5), 0.25
#: Reasons for leaving a candidate: its coarser steps take more work than another's; no steps keep the accuracy.
LEFT = DEARER, INACCURATE = "dearer", "inaccurate"
NEAR = 1e-4  #: the largest tolerance of the run that shows whether an approximate model is near at all
APPROXIMATE_FROM = 1e-3  #: the accuracy (m, rad) from which on approximate models are tried; smaller ones they hardly keep
NEARLY = 1.5  #: the full model is tried with steps whose work on the exact reduction is at most so many times the least
FULL = "full"  #: the name of the model that is not reduced


@dataclass(frozen=True, kw_only=True)
class Candidate:
    """A reduced model with a method, one of Loops and steps, its error and the work of a run; or the reason for leaving it."""

    variant: str
    method: str
    loops: str = Loops.EXACT
    steps: Steps
    error: float = inf
    work: float = inf
    failure: str = ""


@dataclass(frozen=True, kw_only=True)
class Choice:
    """The choice of a model, a method and steps. ``reference_change`` is the change of the reference by its last refinement (m, rad),
    ``reduced`` the model and the scene of the choice."""

    chosen: Candidate
    evidence: tuple[Candidate, ...]
    reference_change: float
    reduced: tuple[Model, Scene] = field(compare=False, repr=False)


def choose(model: Model, scene: Scene, *, parameters: Mapping[str, float] | None = None) -> Choice:
    """The choice for a scene, cached. Raises RunError: nothing keeps the accuracy or the budget; the message has the nearest candidate."""
    parameters, begun = parameters or {}, _begun(model, scene, parameters or {})
    with suppress(PackageNotFoundError):  # installed without versions
        place = _cache_path(model, scene, parameters)
        return _read(place, *begun) or _keep(_calibrate(*begun, parameters), place)
    return _calibrate(*begun, parameters)


def chosen_model(choice: Choice) -> tuple[Model, Scene]:
    """The chosen reduced model, and its scene with the chosen steps."""
    chosen, steps, (model, scene) = choice.chosen, choice.chosen.steps, choice.reduced
    numerics, least = scene.numerics, scene.numerics.of_method(chosen.method).absolute_tolerance or steps.tolerance
    own = {"dt": steps.dt} if steps.dt else {"tolerance": steps.tolerance, "absolute_tolerance": least}
    numerics = replace(numerics, integrator=steps.integrator, events=steps.events or numerics.events, loops=chosen.loops)
    return model, with_settings(replace(scene, numerics=numerics), chosen.method, own)


def _begun(model: Model, scene: Scene, parameters: Mapping[str, float]) -> tuple[Model, Scene]:
    """What trials and the chosen run begin with: the start of these parameters, exact loops, no length of steps."""
    methods = {name: {key: value for key, value in own.items() if key != "dt"} for name, own in scene.numerics.methods.items()}
    return started(model, replace(scene, numerics=replace(scene.numerics, dt=None, loops=Loops.EXACT, methods=methods)), parameters)


def _cache_path(model: Model, scene: Scene, parameters: Mapping[str, float]) -> Path:
    """The file of a choice in the cache: by model, code of functions, scene, what runs it, and for a budget the processor."""
    about = (model.content, model.code, asdict(scene), sorted(parameters.items()), build_provenance(), scene.budget and processor())
    return cache_folder() / "choices" / f"{sha256(repr(about).encode()).hexdigest()[:32]}.json"


def _read(place: Path, model: Model, scene: Scene) -> Choice | None:
    """An earlier choice; None if there is none, its file is damaged, or its reduced model is no longer made."""
    data = read_record(place)
    if data is None:
        return None
    chosen, *evidence = (Candidate(**{**c, "steps": Steps(**c["steps"])}) for c in (data["chosen"], *data["evidence"]))
    made = {FULL: (model, scene)} if chosen.variant == FULL else {v.name: (v.model, v.scene) for v in _reduced_models(model, scene)}
    if chosen.variant not in made:
        return None
    return Choice(chosen=chosen, evidence=tuple(evidence), reference_change=data["reference_change"], reduced=made[chosen.variant])


def _keep(made: Choice, place: Path) -> Choice:
    with suppress(ToolchainError):  # without a cache it is made again next time
        write_record(place, {
            "chosen": asdict(made.chosen), "evidence": [asdict(c) for c in made.evidence], "reference_change": made.reference_change,
        })  # fmt: skip
    return made


def _calibrate(model: Model, scene: Scene, parameters: Mapping[str, float]) -> Choice:
    search = Search(scene, parameters, find_reference(model, scene, parameters))
    variants = _reduced_models(model, scene)
    for variant in variants:
        search.try_model(variant, variants[0])
    if not search.good:
        for name in (method.name for method in METHODS.values() if not method.functions):  # without loop embedding
            search.try_steps(variants[0], variants[0].scene, name, DEFAULT_INTEGRATOR)
    if not search.good:
        words = f"no candidate has the accuracy of {asked_of(scene):g}"
        raise RunError(f"{scene.span}: scene '{scene.name}': {words}: {_nearest(search.found)}")
    chosen = min(search.good, key=lambda c: c.work)
    reduced = next((v.model, v.scene) for v in variants if v.name == chosen.variant)
    choice = Choice(chosen=chosen, evidence=tuple(search.found), reference_change=search.truth.change, reduced=reduced)
    if scene.budget is not None:
        cost = time_run(compile_scene(*chosen_model(choice), CompileOptions(method=chosen.method)), {}, parameters)
        found = f"the run of the least work is {scene.end / cost.seconds:.3g} times as fast as real time; hint: write a larger accuracy"
        if cost.failure or scene.end / cost.seconds < scene.budget:
            raise RunError(f"{scene.span}: scene '{scene.name}': budget {scene.budget:g}: {cost.failure or found}")
    return choice


def _reduced_models(model: Model, scene: Scene) -> list[ReducedModel]:
    """The last reduced model of each motion for the first method that supports the model, then the full one if it is none of them."""
    *others, last = METHODS
    sequence, approximate = list[ReducedModel](), asked_of(scene) >= APPROXIMATE_FROM
    for method in others:
        with suppress(CutjointError):
            sequence = sequence or reduction_sequence(model, scene, method, approximate=approximate)
    sequence = sequence or reduction_sequence(model, scene, last, approximate=approximate)
    last_ones = {reduced.motion: reduced for reduced in sequence}
    return [*last_ones.values(), *(sequence[:1] if last_ones["exact"] is not sequence[0] else [])]


def _nearest(evidence: Sequence[Candidate]) -> str:
    ran = [c for c in evidence if c.error < inf]
    if not ran:
        return "; ".join(f"{c.method}: {c.failure}" for c in evidence)
    best = min(ran, key=lambda c: c.error)
    return f"{best.method} ({best.variant}) came to {best.error:.2g}; hint: write a larger accuracy"


class Search:
    """The candidates ``found`` so far for a scene, measured by the reference ``truth``."""

    def __init__(self, scene: Scene, parameters: Mapping[str, float], truth: Reference) -> None:
        self.found: list[Candidate] = []
        self.truth = truth
        artifact, method = truth.trials.artifact, METHODS[truth.trials.artifact.method]
        self._parameters, self._goal, self._row = parameters, SHARE * asked_of(scene), fitting_interval(artifact.model, scene)
        self._targets = scene.targets
        closure = find_closure(artifact.scene.numerics, method).name
        self._made: dict[tuple[str, str, str], dict[str, Trials]] = {(FULL, Loops.EXACT, method.name): {closure: truth.trials}}

    @property
    def good(self) -> list[Candidate]:
        """Those that keep the accuracy."""
        return [c for c in self.found if not c.failure]

    def try_model(self, variant: ReducedModel, exact: ReducedModel) -> None:
        """Try a reduced model: with exact and with embedded loops by one integrator, then what takes less work by all others.
        The full model beside an ``exact`` reduction is tried with embedded loops alone, where evaluations take fewer instructions: parts
        that are alike share lanes, and a reduction may have left fewer of them."""
        (first, *pairs), scene = pairs_of(variant.scene.numerics), variant.scene
        if variant.motion != "exact" and not self._is_near(variant, *first):
            return
        forms = {Loops.EXACT: scene, Loops.EMBEDDED: with_loops(scene, Loops.EMBEDDED)}
        if not (variant.equations and with_requested_loops(variant.model, forms[Loops.EMBEDDED], first[0]).embedded_loops):
            del forms[Loops.EMBEDDED]
        if variant.name == FULL != exact.name:
            costs, both = [0, 0], (variant, exact) if Loops.EMBEDDED in forms else ()
            with suppress(CutjointError):  # what has no such loops is no candidate
                costs = [self._trials(v, with_loops(v.scene, Loops.EMBEDDED), *first[:2]).iteration for v in both] or costs
            if costs[0] >= costs[1]:
                return
            del forms[Loops.EXACT]
            beside = [c for c in self.good if c.variant == exact.name]
            near = [c.steps for c in beside if c.work <= NEARLY * min(other.work for other in beside)]
            pairs = [pair for pair in pairs if pair[1:] in {(steps.integrator, steps.events) for steps in near}]
        tried = {loops: self.try_steps(variant, form, *first) for loops, form in forms.items()}
        best = min(tried, key=lambda loops: (bool(tried[loops].failure), tried[loops].work))
        for method, integrator, events in pairs:
            if events is None or self.truth.run.statistics.events:
                self.try_steps(variant, forms[best], method, integrator, events)

    def _is_near(self, variant: ReducedModel, method: str, integrator: str, events: str | None) -> bool:
        """Whether the motion of a reduced model is within the accuracy at all."""
        tolerance, dt = min(self._goal / 100, NEAR), 0.0 if INTEGRATORS[integrator].adaptive else self._row / 64
        steps = Steps(integrator=integrator, tolerance=tolerance, dt=dt)
        try:
            run = self._trials(variant, variant.scene, method, integrator).run(steps, self._parameters)
            error, failure = distance(run, self.truth.run, self._targets), str(run.failure or INACCURATE)
        except CutjointError as fault:
            error, failure = inf, str(fault)
        if not error <= self._goal:
            self.found.append(Candidate(variant=variant.name, method=method, steps=steps, error=error, failure=failure))
        return error <= self._goal

    def try_steps(self, variant: ReducedModel, scene: Scene, method: str, integrator: str, events: str | None = None) -> Candidate:
        """The coarsest steps of a model that keep the accuracy, or the reason for leaving it."""
        grid = steps_of(integrator, self._row, events)
        tried = Candidate(variant=variant.name, method=method, loops=scene.numerics.loops, steps=grid[0])
        try:
            tried = self._coarsest(tried, self._trials(variant, scene, method, integrator), grid)
        except CutjointError as error:
            tried = replace(tried, failure=str(error))
        self.found.append(tried)
        return tried

    def _coarsest(self, tried: Candidate, trials: Trials, grid: Sequence[Steps]) -> Candidate:
        least = min((c.work for c in self.good), default=inf)
        low, high, at, below, found = -1, len(grid), 0, replace(tried, work=0.0), None
        while True:
            run = trials.run(grid[at], self._parameters)
            tried = replace(tried, steps=grid[at], error=distance(run, self.truth.run, self._targets), work=trials.work(run, grid[at]))
            if run.fallback or not tried.error <= self._goal:
                low, below = at, tried
                if run.failure is None and tried.work > least:
                    return replace(tried, failure=DEARER)
                at = _next(grid, at, self._goal / tried.error)
            else:
                high, found = at, tried
            if found is None and at == len(grid):
                return replace(tried, failure=str(run.failure or run.fallback or INACCURATE))
            if found is not None:
                if high - low == 1 or found.work <= ENOUGH * below.work:
                    return found
                at = (low + high) // 2

    def _trials(self, variant: ReducedModel, scene: Scene, method: str, integrator: str) -> Trials:
        closed = with_default_closure(scene, method, integrator)
        closure = find_closure(closed.numerics, METHODS[method]).name
        made = self._made.setdefault((variant.name, scene.numerics.loops, method), {})
        for other, trials in made.items():
            if other == closure or not trials.artifact.mechanism.equation_names:
                return trials
        own = (scene, method, closure) == (variant.scene, variant.method, find_closure(scene.numerics, METHODS[method]).name)
        made[closure] = Trials(variant.model, closed, method, scheduled=variant.scheduled if own else None)
        return made[closure]


def _next(grid: Sequence[Steps], at: int, share: float) -> int:
    """The index of the steps that are tried after those at an index, whose error is to fall to a share."""
    value, adaptive = grid[at].setting, not grid[at].dt
    wanted = value * (share ** (ORDERS[0] if adaptive else 1 / ORDERS[1]) if share > 0 else AFTER_FAILURE)
    return next((k for k in range(at + 1, len(grid)) if grid[k].setting <= wanted * (1 + 1e-9)), len(grid))


def pairs_of(numerics: Numerics) -> list[tuple[str, str, str | None]]:
    """Methods, integrators and treatments of events that are tried, adaptive integrators first; events are crossed unless the scene says.
    An integrator that the scene names is the only one of its methods."""
    pairs = [(method, i) for method in METHODS.values() if method.functions for i in _integrators(method, numerics)]
    crossed = [
        (method.name, i, Events.CROSSED) for method, i in pairs
        if INTEGRATORS[i].adaptive and INTEGRATORS[i].events is Events.LOCATED and numerics.events is None
    ]  # fmt: skip
    plain = sorted(((method.name, i, None) for method, i in pairs), key=lambda pair: not INTEGRATORS[pair[1]].adaptive)
    return [plain[0], *crossed, *plain[1:]]


def _integrators(method: Method, numerics: Numerics) -> list[str]:
    able = {name: i for name, i in INTEGRATORS.items() if i.supports(method, Implementation.GENERATED)}
    if numerics.integrator in able:
        return [numerics.integrator]
    return [name for name, i in able.items() if method.closure(numerics.closure, usual=i.closure).name in i.closures]


def steps_of(integrator: str, row: float, events: str | None = None) -> list[Steps]:
    """The steps that are tried, coarsest first; equal ones divide an interval ``row`` (s)."""
    if INTEGRATORS[integrator].adaptive:
        tolerances = (float(f"{LARGEST_TOLERANCE / 10 ** (k / PER_DECADE):.2g}") for k in range(PER_DECADE * DECADES + 1))
        return [Steps(integrator=integrator, tolerance=tolerance, events=events) for tolerance in tolerances]
    numbers = sorted({ceil(2 ** (k / PER_HALVING) - 1e-9) for k in range(PER_HALVING * HALVINGS + 1)})
    return [Steps(integrator=integrator, dt=row / number, events=events) for number in numbers]
