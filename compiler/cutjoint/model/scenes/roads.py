"""Roads of scenes: their profiles, surfaces and patches of friction."""

from collections.abc import Mapping
from itertools import pairwise
from math import isnan, nan
from typing import Any

from cutjoint.methods import join_or
from cutjoint.model.document import model_file
from cutjoint.model.document.source import Path
from cutjoint.model.expressions.scope import Element
from cutjoint.model.expressions.units import LENGTH, NONE, Quantity
from cutjoint.model.records import CurvedGrid, HeightTable, Patch, Road, RoadSegment, RoughSurface, SegmentKind, Span

_SEGMENTS: Mapping[type[Any], tuple[SegmentKind, str, str]] = {
    model_file.Flat: (SegmentKind.FLAT, "flat", ""),
    model_file.Ramp: (SegmentKind.RAMP, "ramp", "rise"),
    model_file.Step: (SegmentKind.STEP, "", "step"),
    model_file.Cosine: (SegmentKind.COSINE, "cosine", "amplitude"),
}


def read_road(where: Element, road: model_file.Road) -> Road:
    """The road of a scene."""
    tracks = {}
    for side in ("left", "right"):
        name = "profile" if road.profile is not None else side
        segments = getattr(road, name) or ()
        tracks[side] = tuple(_segment(where, part, ("road", name, i)) for i, part in enumerate(segments))
    return Road(
        contact=road.contact, start=where.number(road.start, LENGTH, ("road", "start")), **tracks, surface=_surface(where, road.surface),
        patches=tuple(_patch(where, patch, ("road", "friction", i)) for i, patch in enumerate(road.friction)),
    )  # fmt: skip


def _surface(where: Element, surface: model_file.RoadSurface | None) -> HeightTable | CurvedGrid | RoughSurface | None:
    keys: Path = ("road", "surface")
    if surface is None:
        return None
    span = where.scope.source.value_span((*where.path, *keys))
    if isinstance(surface, model_file.Rough):
        width = where.positive(where.number(surface.width, LENGTH, (*keys, "width")), (*keys, "width"))
        return RoughSurface(grade=surface.iso8608, seed=surface.seed, width=width, span=span)
    if isinstance(surface, model_file.Sections):
        return _sections(where, surface, keys, span)
    keys = (*keys, "table")
    if missing := [name for name in ("x", "y", "value") if name not in surface.table]:
        where.fail(f"the table of heights has no {join_or(missing)}", "it needs x, y and value: a row of a file for each place", keys)
        return None
    first, second = (name for name in surface.table if name != "value")
    places = {name: _even(where, name, surface.table[name], (*keys, name)) for name in (first, second)}
    counts, rows = {name: len(surface.table[name]) for name in places}, surface.table["value"]
    heights = tuple(_lengths(where, row, (*keys, "value", i)) if isinstance(row, tuple) else () for i, row in enumerate(rows))
    if len(rows) != counts[first] or any(len(row) != counts[second] for row in heights):
        message = f"the table has {counts[first]} of {first} and {counts[second]} of {second}, and needs as many rows of as many heights"
        where.fail(message, f"give a list of heights for each {first}: value: [[...], [...]]", (*keys, "value"))
        return None
    (x, dx), (y, dy) = places["x"], places["y"]
    if not x or not y:
        return None
    across = heights if first == "x" else tuple(zip(*heights, strict=True))
    return HeightTable(start=(x[0], y[0]), step=(dx, dy), heights=across, bilinear=surface.interpolation == "linear", span=span)


def _sections(where: Element, surface: model_file.Sections, keys: Path, span: Span) -> CurvedGrid | None:
    """Heights along a line."""
    lists, part = surface.sections, (*keys, "sections")
    if missing := [name for name in ("x", "y", "z", "banking", "across", "value") if name not in lists]:
        where.fail(f"the cross sections have no {join_or(missing)}", "name a file in OpenCRG", part)
        return None
    lines = {name: _lengths(where, lists[name], (*part, name)) for name in ("x", "y", "z", "across")}
    banking = tuple(where.number(number, NONE, (*part, "banking", i)) for i, number in enumerate(lists["banking"]))
    heights = tuple(_lengths(where, row, (*part, "value", i)) if isinstance(row, tuple) else () for i, row in enumerate(lists["value"]))
    counts = {len(numbers) for numbers in (lines["x"], lines["y"], lines["z"], banking, heights)}
    across = lines["across"]
    if len(counts) > 1 or min(counts) < 2 or len(across) < 2 or any(len(row) != len(across) for row in heights):
        where.fail("the cross sections are not as many in all lists, or less than two by two", "name a file in OpenCRG", part)
        return None
    pairs = {}
    for name, unit in (("border", NONE), ("offset", LENGTH), ("smooth", LENGTH), ("closed", NONE)):
        first, second = (where.number(x, unit, (*keys, name, i)) for i, x in enumerate(getattr(surface, name)))
        pairs[name] = first, second
    step = where.positive(where.number(surface.step, LENGTH, (*keys, "step")), (*keys, "step"))
    if any(mode not in (1, 2, 3, 4) for mode in pairs["border"]) or any(a >= b for a, b in pairwise(across)):
        where.fail("a border is not 1 to 4, or places across do not rise", "name a file in OpenCRG", keys)
        return None
    chords = [(b[0] - a[0], b[1] - a[1]) for a, b in pairwise(zip(lines["x"], lines["y"], strict=True))]
    if any(first[0] * second[0] + first[1] * second[1] <= 0 for first, second in pairwise([*chords, chords[-1]])):
        where.fail("the line stands still, or turns by a right angle or more from one cross section to the next", "a road leads on", part)
        return None
    return CurvedGrid(
        sections=tuple(zip(lines["x"], lines["y"], lines["z"], banking, strict=True)), across=across, heights=heights, step=step,
        borders=(int(pairs["border"][0]), int(pairs["border"][1])), offsets=pairs["offset"], smooth=pairs["smooth"],
        closed=pairs["closed"], span=span,
    )  # fmt: skip


def _lengths(where: Element, numbers: tuple[Any, ...], keys: Path) -> tuple[float, ...]:
    """Numbers of a list in m; the unit of a file's column, which all its numbers have, is checked once."""
    if all(isinstance(x, (int, float)) and (not isinstance(x, Quantity) or x.dimension == LENGTH) for x in numbers):
        return tuple(map(float, numbers))
    found = []
    for i, number in enumerate(numbers):
        if isinstance(number, tuple):
            where.fail("a list stands where a number should", "give one height for each place", (*keys, i))
            return (nan,) * len(numbers)
        found.append(where.number(number, LENGTH, (*keys, i)))
        if isinstance(number, Quantity) and isnan(found[-1]):
            return (nan,) * len(numbers)
    return tuple(found)


def _even(where: Element, name: str, numbers: tuple[Any, ...], keys: Path) -> tuple[tuple[float, ...], float]:
    """Places that rise by equal steps, and their step, m; none where they do not."""
    places = _lengths(where, numbers, keys)
    if len(places) < 2:
        where.fail(f"the table of heights has {len(places)} of {name}", "a surface needs two places or more along x and along y", keys)
        return (), nan
    if any(map(isnan, places)):
        return (), nan
    step = (places[-1] - places[0]) / (len(places) - 1)
    for i, place in enumerate(places):
        if i and place <= places[i - 1]:
            where.fail(f"the table's {name} does not rise", "sort the table", (*keys, i))
            return (), nan
        if abs(place - places[0] - i * step) > 1e-6 * step:
            message = f"the table's {name} has steps that are not equal: {place:g} m is not {places[0] + i * step:g} m"
            where.fail(message, "take heights on an even grid, as by interpolation between those that are measured", (*keys, i))
            return (), nan
    return places, step


def _patch(where: Element, patch: model_file.Patch, keys: Path) -> Patch:
    ends = {name: tuple(_lengths(where, getattr(patch, name), (*keys, name))) for name in ("x", "y")}
    for name, (begin, end) in ends.items():
        if end <= begin:
            where.fail(f"the patch ends along {name} where it begins, or before", f"write {name}: [smaller, larger]", (*keys, name))
    friction = where.positive(where.number(patch.value, NONE, (*keys, "value")), (*keys, "value"))
    edge = where.positive(where.number(patch.edge, LENGTH, (*keys, "edge")), (*keys, "edge"))
    span = where.scope.source.value_span((*where.path, *keys))
    return Patch(x=(ends["x"][0], ends["x"][1]), y=(ends["y"][0], ends["y"][1]), friction=friction, edge=edge, span=span)


def _segment(where: Element, part: Any, keys: Path) -> RoadSegment:
    kind, length_key, rise_key = _SEGMENTS[type(part)]
    length = where.number(getattr(part, length_key), LENGTH, (*keys, length_key)) if length_key else 0.0
    rise = where.number(getattr(part, rise_key), LENGTH, (*keys, rise_key)) if rise_key else 0.0
    if length_key:
        where.positive(length, (*keys, length_key))
    return RoadSegment(kind=kind, length=length, rise=rise, span=where.scope.source.value_span((*where.path, *keys)))
