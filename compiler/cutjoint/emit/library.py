"""Program -> a library with the C interface of a folder that stands alone, a file a function: what is unchanged is not compiled again.

Its classes are those of the folder.  Their layout alone stands apart, beside the interface: another column changes it and `report`, and no
other function.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from cutjoint.emit.beginning import Beginning
from cutjoint.emit.classes import LANES, CppClass, SimulationCode, class_of_mechanism, class_of_system
from cutjoint.emit.source import FACTORISATION, LIBRARY, SPACE, Page, Source, compiled
from cutjoint.emit.standalone import OF_INTERFACE, STEPS, headers_of, prepare, render_header

#: The namespace of classes with their layout, and that of instances side by side.
_SIZED, _SIDE = "cutjoint::sized", "side_by_side"


@dataclass(frozen=True, kw_only=True)
class _Number:
    """A number type that functions are compiled for: the headers that know it, and the names of functions, none for all.  A double needs
    nothing."""

    unity: str
    real: str = ""
    headers: Sequence[str] = ()
    functions: frozenset[str] = frozenset()


_OF_INSTANCES = _Number(
    unity=_SIDE, real=f"cutjoint::Lanes<double, {LANES}>", headers=("cutjoint/core/instances.hpp", "cutjoint/core/lane_road.hpp")
)  # fmt: skip

_OF_DERIVATIVES = _Number(
    unity="dual", real="cutjoint::Dual", headers=("cutjoint/core/dual_lanes.hpp",),
    functions=frozenset({"load", "start_step", "begin_step", "scene_inputs", "evaluate", "constraint_residual", "report"}),
)  # fmt: skip

_OF_SYSTEM_DERIVATIVES = _Number(
    unity="system_dual", real="cutjoint::Dual", headers=("cutjoint/core/dual_lanes.hpp",),
    functions=frozenset({"load", "start_step", "begin_step", "scene_inputs", "report"}),
)  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class _Placed:
    """A class of the library: the place of its ``header``, without the ending, the beginning of its functions' files, its namespace within
    that of generated classes, the target of the project that compiles it, and its number types."""

    made: CppClass
    header: str
    prefix: str = ""
    space: str = ""
    target: str = "mechanism"
    numbers: Sequence[_Number]

    @property
    def files(self) -> dict[str, str]:
        """The header and the functions of the class."""
        factorisation = {f"{FACTORISATION}.hpp": self.made.factorisation} if self.made.factorisation else {}
        return {f"{self.header}.hpp": self.made.header, **factorisation, **self.functions(frozenset())}

    def functions(self, names: frozenset[str]) -> dict[str, str]:
        """Functions by file, all unless some are named."""
        some = {file: text for file, text in self.made.functions.items() if not names or file.removesuffix(".cpp") in names}
        return {f"{self.prefix}{file}": text for file, text in some.items()}


def emit_library(parts: SimulationCode, begin: Beginning, digest: str, code: str = "") -> Source:
    """The files of a library and of the project that builds it; ``begin`` and ``digest`` as of `emit_standalone`, ``code`` is what it
    has behind its interface."""
    parts, view = prepare(parts, begin, digest)
    page, classes = parts.page, list(_classes(parts))
    files = {f"{view['header']}.h": render_header(page, view), "interface.cpp": _interface(parts, classes, begin, view) + code}
    sources: dict[str, list[str]] = {"mechanism": [], "system": []}
    for each in classes:
        files |= each.files
        for number in each.numbers:
            some, unity = compiled(page, number.unity, each.functions(number.functions), number.headers, number.real)
            sources[each.target] += some
            files |= unity
    project = page.render("library/CMakeLists.txt.jinja", sources=sources, **view)
    return page.source({**files, "CMakeLists.txt": project}, driver=LIBRARY)


def _classes(parts: SimulationCode) -> Iterator[_Placed]:
    """The classes of a library."""
    name, has_derivatives = parts.page.header, parts.freedoms is not None
    mechanism = class_of_mechanism(parts, parts.program, apart=True, header=name)
    yield _Placed(made=mechanism, header=name, numbers=[_Number(unity="mechanism"), *([_OF_DERIVATIVES] if has_derivatives else [])])
    if parts.side_by_side is not None:
        header = f"{_SIDE}/{name}"
        instances = class_of_mechanism(parts, parts.side_by_side, "Mask", apart=True, header=header, space=f"{SPACE}::{_SIDE}")
        yield _Placed(made=instances, header=header, prefix=f"{_SIDE}/", space=_SIDE, numbers=[_OF_INSTANCES])
    if parts.system is not None:
        header, more = f"{name}_system", [_OF_SYSTEM_DERIVATIVES] if has_derivatives else []
        system = class_of_system(parts, parts.system, apart=True, header=header)
        yield _Placed(made=system, header=header, prefix="system_", target="system", numbers=[_Number(unity="system"), *more])


def _interface(parts: SimulationCode, classes: Sequence[_Placed], begin: Beginning, view: Mapping[str, object]) -> str:
    """The C++ file of the C interface, with the simulation and its integrator."""
    page, has_lanes = parts.page, any("Lanes<Real, " in each.made.header for each in classes)
    runtime = headers_of(parts, STEPS[parts.method][begin.integrator], has_lanes=has_lanes)
    own = [f"{each.header}.hpp" for each in classes]
    return page.render(
        "library/interface.cpp.jinja", standard=OF_INTERFACE, headers=[*runtime, *own],
        p=page.stem, header=view["header"], sized=_SIZED, classes=[_sized(page, each) for each in classes],
    ) + page.render("standalone/api.cpp.jinja", **view, space=_SIZED)  # fmt: skip


def _sized(page: Page, each: _Placed) -> dict[str, str]:
    """A class with what a simulation is told of it, and its namespace."""
    base = "::".join(filter(None, ("generated", each.space, each.made.name)))
    layout = {**each.made.layout, "class_name": each.made.name, "base": base, "summary": "The same, with what a simulation is told of it."}
    return {"space": each.space, "code": page.render("sized.hpp.jinja", **layout)}
