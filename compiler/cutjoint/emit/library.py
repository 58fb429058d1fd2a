"""Program -> a library with the C interface of a C export, one file per function: unchanged functions are not recompiled.

Its classes are those of the C export. Only their layout is separate, with the interface: another column changes just the layout and
`report`.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from cutjoint.emit.classes import LANES, CppClass, Defaults, SimulationCode, derived_classes, sized_mechanism_class, sized_system_class
from cutjoint.emit.source import FACTORISATION, LIBRARY, SPACE, Page, Source, code_file, compiled
from cutjoint.emit.standalone import OF_INTERFACE, headers_of, prepare, render_header, render_interface
from cutjoint.formulate.records import CLOSE
from cutjoint.methods import STEPS, Steps

_SIDE = "side_by_side"  #: the namespace of instances side by side


@dataclass(frozen=True, kw_only=True)
class _Number:
    """A number type that functions are compiled for: the headers that know it, and the names of functions, none for all.  A double needs
    nothing."""

    unity: str
    real: str = ""
    headers: Sequence[str] = ()
    functions: frozenset[str] = frozenset()


_OF_INSTANCES = _Number(unity=_SIDE, real=LANES, headers=("cutjoint/core/mechanism/instances.hpp",))

#: Functions of the earlier stages; those of loop fits belong to the parameters' stage.
_STAGES = frozenset({"load", "load_values", "start_step", "begin_step", "scene_inputs"})

_OF_DERIVATIVES = _Number(
    unity="dual", real="cutjoint::Dual", headers=("cutjoint/core/numbers/dual_lanes.hpp",),
    functions=_STAGES | {"constraint_residual", "project", "report", "sample"},
)  # fmt: skip

_OF_SYSTEM_DERIVATIVES = replace(_OF_DERIVATIVES, unity="system_dual", functions=_STAGES | {"report", "sample"})

_OF_LOADED = replace(_OF_DERIVATIVES, unity="balance_dual", functions=frozenset({"load", "load_values", "loaded_values"}))


@dataclass(frozen=True, kw_only=True)
class _Placed:
    """A class of the library and where it goes.
    ``header``: its file without the ending; ``prefix``: the beginning of its functions' files; ``space``: its namespace within that of
    generated classes; ``target``: the target of the project that compiles it; ``numbers``: its number types."""

    made: CppClass
    header: str
    prefix: str = ""
    space: str = ""
    target: str = "mechanism"
    numbers: Sequence[_Number]

    def files(self, page: Page) -> dict[str, str]:
        """The headers of the class."""
        headers = {f"{self.header}.hpp": self.made.header}
        if self.made.factorisation:
            headers[f"{FACTORISATION}.hpp"] = self.made.factorisation
        return page.files(headers, space=self._space)

    def functions(self, page: Page, names: frozenset[str] = frozenset()) -> dict[str, str]:
        """Functions by file, all unless some are named."""
        some = {
            f"{self.prefix}{f}": piece for f, piece in self.made.functions.items()
            if not names or f.removesuffix(".cpp") in names or f.startswith(CLOSE)
        }  # fmt: skip
        return page.files(some, space=self._space)

    @property
    def _space(self) -> str:
        return f"{SPACE}::{self.space}" if self.space else SPACE


def emit_library(parts: SimulationCode, defaults: Defaults, digest: str, code: str = "", calls: Sequence[str] = ()) -> Source:
    """The files of a library and of the project that builds it; ``code`` is what it has behind its interface.
    ``defaults`` and ``digest`` as of `emit_standalone`, ``calls`` of `render_interface`."""
    parts, view = prepare(parts, defaults, digest)
    page, classes = parts.page, list(_classes(parts, STEPS[parts.method][defaults.integrator]))
    files = {f"{view['header']}.h": render_header(page, view), "interface.cpp": _interface(parts, classes, defaults, view, calls) + code}
    sources: dict[str, list[str]] = {"mechanism": [], "system": []}
    for each in classes:
        files |= each.files(page) | each.functions(page)
        for number in each.numbers:
            some, unity = compiled(page, number.unity, each.functions(page, number.functions), number.headers, number.real)
            sources[each.target] += some
            files |= unity
    supplied = code_file(parts.mechanism.topology.model)
    files |= supplied
    sources["mechanism"] += supplied
    project = page.render("library/CMakeLists.txt.jinja", sources=sources, **view)
    return page.source({**files, "CMakeLists.txt": project}, driver=LIBRARY)


def _classes(parts: SimulationCode, steps: Steps) -> Iterator[_Placed]:
    name, has_derivatives = parts.page.header, parts.dofs is not None
    mechanism = sized_mechanism_class(parts, parts.program, header=name)
    of_mechanism, of_system = (replace(x, functions=x.functions | {"events"}) if steps.finds_events else x
                               for x in (_OF_DERIVATIVES, _OF_SYSTEM_DERIVATIVES))  # fmt: skip
    yield _Placed(made=mechanism, header=name, numbers=[_Number(unity="mechanism"), *([of_mechanism] if has_derivatives else [])])
    if parts.side_by_side is not None:
        header = f"{_SIDE}/{name}"
        instances = sized_mechanism_class(parts, parts.side_by_side, "Mask", header=header)
        yield _Placed(made=instances, header=header, prefix=f"{_SIDE}/", space=_SIDE, numbers=[_OF_INSTANCES])
    for derived, made in derived_classes(parts, header=f"{name}_{{}}"):
        numbers = [_Number(unity=derived), *([_OF_LOADED] if derived == "force_residual" else [])]
        yield _Placed(made=made, header=f"{name}_{derived}", prefix=f"{derived}_", numbers=numbers)
    if parts.system is not None:
        header, more = f"{name}_system", [of_system] if has_derivatives else []
        system = sized_system_class(parts, parts.system, header=header)
        yield _Placed(made=system, header=header, prefix="system_", target="system", numbers=[_Number(unity="system"), *more])


def _interface(
    parts: SimulationCode, classes: Sequence[_Placed], defaults: Defaults, view: Mapping[str, object], calls: Sequence[str]
) -> str:  # fmt: skip
    page, has_lanes = parts.page, any("cutjoint/core/numbers/lanes.hpp" in each.made.header.headers for each in classes)
    runtime = headers_of(parts, STEPS[parts.method][defaults.integrator], has_lanes=has_lanes)
    own = [f"{each.header}.hpp" for each in classes]
    return page.render(
        "library/interface.cpp.jinja", standard=OF_INTERFACE, headers=[*runtime, *own],
        p=page.stem, header=view["header"],
        classes=[{"space": x.space, "code": x.made.sized(page, x.space)} for x in classes if x.made.layout],
    ) + render_interface(page, view, calls_of=calls)  # fmt: skip
