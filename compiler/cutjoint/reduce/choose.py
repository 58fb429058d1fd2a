"""`method: auto`: the cheapest model, formulation and steps that keep a scene's accuracy, found by calibration runs.
The reference is the full model at steps that are halved until the motion has converged. The reduced models of the first method that
supports the model, and the cheapest of these for each other method, are tried with steps that divide or multiply the scene's output step,
and with adaptive steps. All are timed at the longest steps, or the largest tolerance, within the accuracy."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from functools import cache, cached_property, partial
from hashlib import sha256
from importlib.metadata import PackageNotFoundError
from math import ceil, inf, log
from pathlib import Path

from cutjoint.compile.prepared import build_provenance
from cutjoint.methods import DEFAULT_INTEGRATOR, INTEGRATORS, METHODS, Implementation, names_of
from cutjoint.model.errors import ModelError
from cutjoint.model.records import Model, Scene
from cutjoint.package.errors import RunError, ToolchainError
from cutjoint.reduce.measure import Reference, distance, find_reference, fraction, time_run
from cutjoint.reduce.sequence import ReducedModel, cheapest_by, reduction_sequence
from cutjoint.reduce.trials import DERIVING, Steps, Trials, at_step, begin, common_step
from cutjoint.run.artifact import Artifact
from cutjoint.run.results import Trajectory
from cutjoint.run.scenes import with_closure, with_default_closure
from cutjoint.run.settings import accuracy_of, find_closure
from cutjoint.run.simulator import SimulatorError
from cutjoint.toolchain.cache import cache_folder, read_record, write_record
from cutjoint.toolchain.compiler import processor

SHARE = 0.8  #: the share of the accuracy that a choice may use; the rest is for the error of the reference
LONGEST, SHORTEST = 16, 2**-9  #: range of tried steps, as multiples of the scene's step for the method, longest first
RATIO = 2**0.5  #: the ratio of successive trial steps

#: Range of tried tolerances, largest first, and the ratio of successive ones.
LARGEST_TOLERANCE, SMALLEST_TOLERANCE, TOLERANCE_RATIO = 1e-2, 1e-10, 10**0.5

#: A reduced model is given up where a compiled run takes so many times as long as the best so far, or any run so many times the
#: instructions.  An error counts as lower below this share of another.
PATIENCE, DEARER, SETTLING = 3.0, 1.5, 0.9

ROUNDS = 2  #: the number of rounds in which the fastest are timed again alternately


@dataclass(frozen=True, kw_only=True)
class Candidate:
    """A reduced model with a method and steps, its error, time (s) and instructions; or the reason for leaving it.
    ``dt`` (s) is the step, or 0 with the ``tolerance`` of an ``integrator``."""

    variant: str
    method: str
    dt: float
    error: float
    seconds: float
    instructions: float = 0.0
    failure: str = ""
    integrator: str = ""
    tolerance: float = 0.0

    @property
    def steps(self) -> Steps:
        """The number of steps of its run."""
        return Steps(dt=self.dt, integrator=self.integrator, tolerance=self.tolerance)


@dataclass(frozen=True, kw_only=True)
class Choice:
    """The choice of a model, a method and a step. ``evidence`` has a candidate for each reduced model of each method, ``reference_change``
    is the change of the reference by its last halving (m, rad), ``reduced`` the chosen model, if the choice was made just now."""

    chosen: Candidate
    evidence: tuple[Candidate, ...]
    reference_change: float
    reduced: ReducedModel | None = field(default=None, compare=False, repr=False)


class _ReducedModels:
    """The reduced models to try: the reduction sequence of the first method that supports the model, the cheapest of these for others."""

    def __init__(self, model: Model, scene: Scene) -> None:
        self._model, self._scene = model, scene
        self._of: dict[str, Future[list[ReducedModel]]] = {}

    def begin(self) -> None:
        """Derive those of all methods in other threads, one method after the other."""
        for method in METHODS:
            self._begin(method)

    def of(self, method: str) -> list[ReducedModel]:
        """The reduced models of a method, one for each motion, when they are there. Raises ModelError, RunError: the method takes none."""
        return self._begin(method).result()

    def _begin(self, method: str) -> Future[list[ReducedModel]]:
        if method not in self._of:
            self._of[method] = begin(partial(self._derive, method))
        return self._of[method]

    def _derive(self, method: str) -> list[ReducedModel]:
        with DERIVING:
            first = self._first
            last = list({reduced.motion: reduced for reduced in first}.values())
            return last if method == first[0].method else cheapest_by(method, first)

    @cached_property
    def _first(self) -> list[ReducedModel]:
        *others, last = METHODS
        for method in others:
            with suppress(ModelError, RunError):
                return reduction_sequence(self._model, self._scene, method, approximate=True)
        return reduction_sequence(self._model, self._scene, last, approximate=True)


def choose(model: Model, scene: Scene, *, parameters: Mapping[str, float] | None = None) -> Choice:
    """The choice for a scene, cached. Raises RunError: nothing keeps the accuracy or the budget; the message has the nearest candidate."""
    try:
        place = _cache_path(model, scene, parameters or {})
    except PackageNotFoundError:
        return _calibrate(model, scene, parameters or {})  # installed without versions
    kept = _read(place)
    return kept if kept is not None else _keep(_calibrate(model, scene, parameters or {}), place)


def chosen_model(model: Model, scene: Scene, choice: Choice) -> ReducedModel:
    """The chosen reduced model, with the chosen steps in its scene."""
    chosen = choice.chosen
    variant = choice.reduced or _find(chosen, _ReducedModels(model, scene))
    numerics = replace(variant.scene.numerics, methods={**variant.scene.numerics.methods, chosen.method: _own(variant.scene, chosen)})
    if chosen.integrator:
        numerics = replace(numerics, dt=None, integrator=chosen.integrator, absolute_tolerance=chosen.tolerance)
        return replace(variant, scene=replace(variant.scene, numerics=numerics))
    step = common_step(chosen.dt, variant.scene.output_step)
    numerics = replace(numerics, integrator=DEFAULT_INTEGRATOR)
    return replace(variant, scene=replace(variant.scene, numerics=numerics, output_step=step))


def _find(chosen: Candidate, reduced_models: _ReducedModels) -> ReducedModel:
    return next(reduced for reduced in reduced_models.of(chosen.method) if reduced.name == chosen.variant)


def _own(scene: Scene, chosen: Candidate) -> dict[str, float]:
    own = {name: value for name, value in scene.numerics.methods.get(chosen.method, {}).items() if name != "dt"}
    return {**own, **({"tolerance": chosen.tolerance} if chosen.integrator else {"dt": chosen.dt})}


def _cache_path(model: Model, scene: Scene, parameters: Mapping[str, float]) -> Path:
    """The file of a choice in the cache: by model, code of functions, scene, compiler, flags, and the machine that times it."""
    about = (model.content, model.code, asdict(scene), sorted(parameters.items()), build_provenance(), processor())
    return cache_folder() / "choices" / f"{sha256(repr(about).encode()).hexdigest()[:32]}.json"


def _read(place: Path) -> Choice | None:
    """An earlier choice; None if there is none or its file is damaged."""
    data = read_record(place)
    if data is None:
        return None
    evidence = tuple(Candidate(**c) for c in data["evidence"])
    return Choice(chosen=Candidate(**data["chosen"]), evidence=evidence, reference_change=data["reference_change"])


def _keep(made: Choice, place: Path) -> Choice:
    with suppress(ToolchainError):  # without a cache it is measured again next time
        write_record(place, {
            "chosen": asdict(made.chosen), "evidence": [asdict(c) for c in made.evidence], "reference_change": made.reference_change,
        })  # fmt: skip
    return made


def _calibrate(model: Model, scene: Scene, parameters: Mapping[str, float]) -> Choice:
    reduced_models = _ReducedModels(model, scene)
    truth = find_reference(model, scene, parameters, when_running=reduced_models.begin)
    steps = _find_steps(reduced_models, scene, parameters, truth)
    compiled = [None if trials is None else trials.compiled for _, trials in steps]  # all of it, before anything is timed
    tried = [timed(candidate, artifact, parameters) for (candidate, _), artifact in zip(steps, compiled, strict=True)]
    evidence = _timed_alternately(list(zip(tried, compiled, strict=True)), parameters)
    good = [c for c in evidence if not c.failure]
    if not good:
        raise RunError(f"{scene.span}: scene '{scene.name}': no candidate has the accuracy of {accuracy_of(scene):g}: {_nearest(evidence)}")
    chosen = min(good, key=lambda c: c.seconds)
    if scene.budget is not None and scene.end / chosen.seconds < scene.budget:
        found = f"the fastest that keeps the accuracy is {scene.end / chosen.seconds:.3g} times as fast as real time"
        raise RunError(f"{scene.span}: scene '{scene.name}': budget {scene.budget:g}: {found}; hint: write a larger accuracy")
    return Choice(chosen=chosen, evidence=evidence, reference_change=truth.change, reduced=_find(chosen, reduced_models))


def _timed_alternately(tried: Sequence[tuple[Candidate, Artifact | None]], parameters: Mapping[str, float]) -> tuple[Candidate, ...]:
    """The candidates; those that may be the fastest are timed again alternately, so that disturbances affect all equally."""
    fastest = min((c.seconds for c, _ in tried if not c.failure), default=inf)
    close = {
        c: at_step(artifact, c.steps)
        for c, artifact in tried if artifact is not None and not c.failure and c.seconds <= PATIENCE * fastest
    }  # fmt: skip
    if len(close) < 2:
        return tuple(c for c, _ in tried)
    rounds = [[time_run(artifact, c.steps, parameters).seconds for c, artifact in close.items()] for _ in range(ROUNDS)]
    seconds = dict(zip(close, (min(column) for column in zip(*rounds, strict=True)), strict=True))
    return tuple(replace(c, seconds=min(c.seconds, seconds.get(c, inf))) for c, _ in tried)


def _nearest(evidence: Sequence[Candidate]) -> str:
    ran = [c for c in evidence if c.error < inf]
    if not ran:
        return "; ".join(f"{c.method}: {c.failure}" for c in evidence)
    best = min(ran, key=lambda c: c.error)
    return f"{best.method} ({best.variant}) came to {best.error:.2g}; hint: write a larger accuracy"


def _find_steps(
    reduced_models: _ReducedModels, scene: Scene, parameters: Mapping[str, float], truth: Reference
) -> list[tuple[Candidate, Trials | None]]:  # fmt: skip
    """The candidates, not yet timed, and the runs of those within the accuracy, whose code is being compiled.
    The first method with one is searched alone; the others, side by side, give up where they take much longer. A saddle point is begun
    last, since it takes longest to prepare."""
    search = partial(_search, reduced_models, scene, parameters, truth)
    found: list[tuple[Candidate, Trials | None]] = []
    others = list(METHODS)
    while others and _fastest(found) is None:
        found += search(others.pop(0), None)
    others.sort(key=lambda method: METHODS[method].saddle_point)
    for searching in [begin(partial(search, method, _fastest(found))) for method in others]:
        found += searching.result()
    return sorted(found, key=lambda of: list(METHODS).index(of[0].method))


def _search(
    reduced_models: _ReducedModels, scene: Scene, parameters: Mapping[str, float], truth: Reference, method: str, fastest: Candidate | None
) -> list[tuple[Candidate, Trials | None]]:  # fmt: skip
    try:
        variants = reduced_models.of(method)
    except (ModelError, RunError) as error:
        return [(Candidate(variant="full", method=method, dt=0.0, error=inf, seconds=inf, failure=str(error)), None)]
    found: list[tuple[Candidate, Trials | None]] = []
    for variant in variants:
        by = trials_by(variant)
        for find, integrator in searches(variant):
            trials = by(integrator)
            candidate = find(variant, scene, parameters, truth, trials, fastest=fastest or _fastest(found))
            if not candidate.failure:
                trials.begin_compiling()
            found.append((candidate, None if candidate.failure else trials))
    return found


def trials_by(variant: ReducedModel) -> Callable[[str], Trials]:
    """Runs of a reduced model by integrators; those with the same closure share them."""
    method = METHODS[variant.method]

    @cache
    def make(closure: str) -> Trials:
        if closure == find_closure(variant.scene.numerics, method).name:
            return Trials(variant.model, variant.scene, variant.method, scheduled=variant.scheduled)
        return Trials(variant.model, with_closure(variant.scene, closure), variant.method)

    def by(integrator: str) -> Trials:
        closed = with_default_closure(variant.scene, variant.method, integrator) if variant.equations else variant.scene
        return make(find_closure(closed.numerics, method).name)

    return by


def _fastest(found: Sequence[tuple[Candidate, Trials | None]]) -> Candidate | None:
    """The candidate with the fewest instructions among those that meet the accuracy."""
    return min((c for c, _ in found if not c.failure), key=lambda c: c.instructions, default=None)


def find_step(
    variant: ReducedModel, scene: Scene, parameters: Mapping[str, float], truth: Reference, trials: Trials, *,
    ratio: float = RATIO, fastest: Candidate | None = None,
) -> Candidate:  # fmt: skip
    """The longest step of a reduced model that keeps the scene's accuracy; steps fall by ``ratio``. It gives up if a run is much slower
    than the ``fastest`` so far, or if a fourth of the step has not reduced the error, which is then that of the reduced model."""
    best = Candidate(variant=variant.name, method=variant.method, dt=0.0, error=inf, seconds=inf, failure="no step keeps the accuracy")
    step = variant.scene.numerics.of_method(variant.method).step
    longest = min(LONGEST * step, variant.scene.end / 8)
    number = ceil(log(longest / (SHORTEST * step)) / log(ratio)) + 1
    steps = {fraction(variant.scene.output_step, longest / ratio**k) for k in range(number)}  # with samples of the reference
    wanted = (replace(best, dt=dt) for dt in sorted(steps, reverse=True))
    vain = "dt", 4, "shorter steps do not lower its error"
    return _first_within(best, wanted, scene, parameters, truth, trials, fastest, vain)


def find_tolerated(
    integrator: str, variant: ReducedModel, scene: Scene, parameters: Mapping[str, float], truth: Reference, trials: Trials, *,
    ratio: float = TOLERANCE_RATIO, fastest: Candidate | None = None,
) -> Candidate:  # fmt: skip
    """The largest tolerance of an integrator that keeps the scene's accuracy.
    It gives up as `find_step` does, where a hundredth of the tolerance has not brought the error down."""
    best = Candidate(
        variant=variant.name, method=variant.method, dt=0.0, error=inf, seconds=inf, failure="no tolerance keeps the accuracy",
        integrator=integrator, tolerance=LARGEST_TOLERANCE,
    )  # fmt: skip
    number = round(log(LARGEST_TOLERANCE / SMALLEST_TOLERANCE) / log(ratio)) + 1
    wanted = (replace(best, tolerance=LARGEST_TOLERANCE / ratio**k) for k in range(number))
    vain = "tolerance", 100, "smaller tolerances do not lower its error"
    return _first_within(best, wanted, scene, parameters, truth, trials, fastest, vain)


def _first_within(
    best: Candidate, wanted: Iterable[Candidate], scene: Scene, parameters: Mapping[str, float], truth: Reference, trials: Trials,
    fastest: Candidate | None, vain: tuple[str, float, str],
) -> Candidate:  # fmt: skip
    """The first of the wanted candidates that meets the accuracy, else the best one.
    ``vain``: it gives up where a setting is less than in the best run, divided by a number, for a reason."""
    setting, share, reason = vain
    for tried in wanted:
        try:
            run = trials.run(tried.steps, parameters)
        except SimulatorError as problem:
            return replace(best, failure=str(problem))
        error = distance(run, truth.run)
        if slow := _gives_up(trials, run, fastest):
            return replace(best, failure=slow)
        if error <= SHARE * accuracy_of(scene):
            return replace(tried, error=error, seconds=run.seconds, instructions=trials.instructions(run), failure="")
        if error < SETTLING * best.error:
            best = replace(tried, error=error)
        elif best.error < inf and getattr(tried, setting) < getattr(best, setting) / share:
            return replace(best, failure=reason)
    return best


def searches(variant: ReducedModel) -> tuple[tuple[Callable[..., Candidate], str], ...]:
    """The searches for steps of a reduced model: equal steps, and the adaptive ones unless the scene names an integrator."""
    numerics, method = variant.scene.numerics, METHODS[variant.method]
    closure, free = method.closure(numerics.closure).name, numerics.integrator is None
    able = names_of(INTEGRATORS, lambda i: free and i.adaptive and closure in i.closures and i.supports(method, Implementation.GENERATED))
    return (find_step, DEFAULT_INTEGRATOR), *((partial(find_tolerated, name), name) for name in able)


def timed(found: Candidate, artifact: Artifact | None, parameters: Mapping[str, float]) -> Candidate:
    """A candidate with what a run takes by its generated code."""
    if artifact is None:
        return found
    try:
        cost = time_run(at_step(artifact, found.steps), found.steps, parameters)
    except SimulatorError as problem:
        return replace(found, seconds=inf, failure=str(problem))
    return replace(found, seconds=cost.seconds, failure=cost.failure)


def _gives_up(trials: Trials, run: Trajectory, fastest: Candidate | None) -> str:
    """The reason that no shorter steps are tried after a run; "" if they are."""
    if fastest is None or run.failure is not None:
        return ""
    if trials.instructions(run) > DEARER * fastest.instructions:
        return f"more than {DEARER:g} times the instructions of another at longer steps already"
    slower = trials.is_compiled and run.seconds > PATIENCE * fastest.seconds  # the run may be interpreted; generated code is faster
    return "slower than another at longer steps already" if slower else ""
