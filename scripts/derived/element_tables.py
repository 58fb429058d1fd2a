"""The tables of joints and forces in pages, from the records of the kinds in `cutjoint.elements`."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from itertools import groupby
from pathlib import Path

from cutjoint.elements.force import REQUIRED, ForceElement, ForceField, Law
from cutjoint.elements.forces import FORCES
from cutjoint.elements.joint import Ball, JointElement, JointField, Motion, Offset, Rotation, Translation
from cutjoint.elements.joints import JOINTS

#: The kind of forces whose fields have a table of their own.
_APART = "joint_friction"
DOCS = Path(__file__).resolve().parents[2] / "docs"


def pages() -> Mapping[Path, str]:
    """The pages with their tables written anew; a table is found by its head."""
    joints = table("kind", "leaves free", "further fields", "coordinates", "velocities", rows=map(joint_row, JOINTS.values()))
    forces = table("kind", "meaning", "fields", "law", rows=(force_row(force.element) for force in FORCES.values()))
    (apart,) = (force.element for force in FORCES.values() if force.element.kind == _APART)
    fields = table(f"field of `{_APART}`", "meaning", rows=map(field_row, apart.fields))
    chains = table("kind", "chain", rows=map(chain_row, JOINTS.values()))
    return {
        DOCS / "reference" / "model-file.md": written("reference/model-file.md", joints, forces, fields),
        DOCS / "background" / "mechanics.md": written("background/mechanics.md", chains),
    }


def written(page: str, *tables: str) -> str:
    """A page of docs/ with tables in the places of those with the same heads."""
    text = (DOCS / page).read_text(encoding="utf-8")
    for new in tables:
        head = re.escape("".join(new.splitlines(keepends=True)[:2]))
        places = list(re.finditer(rf"^{head}(?:\|.*\n)*", text, flags=re.MULTILINE))
        assert len(places) == 1, f"{page} needs one table with the head {new.splitlines()[0]}"
        text = text[: places[0].start()] + new + text[places[0].end() :]
    return text


def table(*head: str, rows: Iterable[tuple[str, ...]]) -> str:
    """A table in Markdown."""
    lines = [head, ("---",) * len(head), *rows]
    return "".join("|" + "|".join(cell if cell == "---" else f" {cell} " if cell else " " for cell in line) + "|\n" for line in lines)


def joint_row(joint: JointElement) -> tuple[str, ...]:
    """The row of a joint kind: its name, text, fields, coordinates and speeds."""
    fields = [shown(field, is_optional=field.optional) for field in joint.fields]
    guide = [shown(JointField("guide"), is_optional=True)] if joint.can_be_guided else []
    coordinates, speeds = (with_units({name: joint.units[name] for name in names}) for names in (joint.coordinates, joint.speeds))
    return f"`{joint.kind}`", joint.text, ", ".join(fields + guide), coordinates, speeds


def force_row(force: ForceElement) -> tuple[str, ...]:
    """The row of a force kind: its name, text, fields, and the units and variables of its laws."""
    fields = [shown(f, is_optional=f.default is not REQUIRED, default=default_of(f), unit=f.unit) for f in force.fields]
    return f"`{force.kind}`", force.text, "below" if force.kind == _APART else ", ".join(fields), laws_text(force.forms)


def field_row(field: ForceField) -> tuple[str, str]:
    """The row of a field in a table of its own."""
    name = shown(field, is_optional=field.default is not REQUIRED, default=default_of(field), unit=field.unit)
    return name.removesuffix(field.words), field.words.lstrip(" :")


def chain_row(joint: JointElement) -> tuple[str, ...]:
    """The row of a joint kind's chain of elementary motions."""
    return str(joint.kind), ", ".join(map(motion_text, joint.chain))


def shown(field: JointField | ForceField, *, is_optional: bool, default: str = "", unit: str = "") -> str:
    """A field with its unit and default, in square brackets if it may be left out."""
    name = f"`{field.name}`" + (f" ({plain(unit)})" if unit else "") + (f" = {default}" if default else "")
    return (f"[{name}]" if is_optional else name) + field.words


def default_of(field: ForceField) -> str:
    """The default of a field as a file writes it, "" for a field without one."""
    if field.default in (REQUIRED, None, {}):
        return ""
    return str(list(field.default) if isinstance(field.default, tuple) else field.default).lower()


def laws_text(laws: Sequence[Law]) -> str:
    """The units of laws over their variables; neighbours of the same variables share them."""
    groups = ((list(group), variables) for variables, group in groupby(laws, key=lambda law: law.variables))
    return "; ".join(
        f"{' and '.join(plain(law.unit) for law in group)} as a function of "
        f"{with_units({f'`{name}`': unit for name, unit in variables.items()})}, `t`"
        for group, variables in groups
    )


def with_units(units: Mapping[str, str]) -> str:
    """Names with their units; neighbours of one unit share it."""
    groups = groupby(units.items(), key=lambda item: item[1])
    return ", ".join(f"{', '.join(name for name, _ in items)} ({plain(unit)})" for unit, items in groups)


def plain(unit: str) -> str:
    """A unit as prose writes it."""
    return unit.replace("*", " ")


def motion_text(motion: Motion) -> str:
    """An elementary motion in words."""
    match motion:
        case Translation():
            return "translation"
        case Ball():
            return "ball"
        case Offset():
            return "offset (the rod)"
        case Rotation(share=share) if share != 1:
            return f"{share} {motion.coordinate}"
        case Rotation(is_screw=True):
            return "rotation with a pitch"
    return "rotation"
