"""The page of the library, from the head and the interface of each of its files."""

from __future__ import annotations

import yaml

from cutjoint.package.locations import library_folder

HEAD = """# Library

Submodels of the package, for `include: library/NAME`. [Build a vehicle](../how-to/build-a-vehicle.md) shows them at work.
Parameters without a default must be given; those in brackets have one. Points are of the design position, in m;
an instance sets them by `points: {NAME: [x, y, z]}`. `steering` is the rack; the chassis, for a wheel that is not steered.
"""

#: Parameters in capitals are coefficients of a property file.
_COEFFICIENTS = "the coefficients of a `.tir` file"


def page() -> str:
    """The page: a section for each file, by name."""
    return "\n".join([HEAD, *(section(path.stem, path.read_text(encoding="utf-8")) for path in sorted(library_folder().glob("*.yaml")))])


def section(name: str, text: str) -> str:
    """The section of a file."""
    head = [line.removeprefix("#").strip() for line in text.partition("cutjoint:")[0].splitlines()]
    paragraphs = [" ".join(part.split()) for part in "\n".join(head).split("\n\n")]
    part = yaml.safe_load(text)
    own = {"connectors": quoted(part["connectors"]), "parameters": parameters(part["parameters"])}
    own["defaults"] = defaults(part.get("defaults", {}))
    own["points"] = placed(part.get("points", {})) if part["connectors"][:1] == ["chassis"] else ""
    table = "\n".join(f"| {title} | {words} |" for title, words in own.items() if words)
    return f"## {name}\n\n" + "\n\n".join(paragraphs) + (f"\n\n| | |\n|---|---|\n{table}\n" if table else "\n")


def quoted(names: list[str]) -> str:
    """Names in code style."""
    return ", ".join(f"`{name}`" for name in names)


def parameters(names: list[str]) -> str:
    """Parameters that an instance gives; coefficients of a property file count as one."""
    own = quoted([name for name in names if not name.isupper() or len(names) <= 20])
    return ", ".join(filter(None, [own, _COEFFICIENTS if len(names) > 20 and any(map(str.isupper, names)) else ""]))


def defaults(values: dict[str, object]) -> str:
    """Parameters with their defaults, without coefficients."""
    return ", ".join(f"[`{name}` = {value}]" for name, value in values.items() if not name.isupper())


def placed(points: dict[str, list[object]]) -> str:
    """Points that an instance may place, with their coordinates."""
    return ", ".join(f"`{name}` = [{', '.join(map(str, place))}]" for name, place in points.items())
