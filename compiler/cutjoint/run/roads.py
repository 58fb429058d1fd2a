"""Road segments -> pieces that a wheel can look up.

A point follower sees the profile itself.  A rigid disc of radius R sees the envelope of the profile's polygon::

    h_env(x) = max over |u| <= R of h(x + u) + sqrt(R^2 - u^2) - R

whose pieces are straight lines (offset by the disc) and arcs about the corners.
"""

import math
from bisect import bisect_right
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

from cutjoint.model.records import Road, RoadSegment, SegmentKind
from cutjoint.run.road_field import Surface

#: The number of straight parts that replace a cosine bump for a disc.
BUMP_PARTS = 400


@dataclass(frozen=True, kw_only=True)
class Piece:
    """A piece of a road from x = start on; heights in m.
    "line" a + b (x - start); "arc" a + sqrt(b^2 - (x - c)^2); "cosine" a + b (1 - cos(c (x - start)))."""

    kind: str
    start: float
    a: float
    b: float
    c: float

    def height(self, x: float) -> float:
        """Height at x, m."""
        if self.kind == "arc":
            return self.a + math.sqrt(max(self.b**2 - (x - self.c) ** 2, 0.0))
        if self.kind == "cosine":
            return self.a + self.b * (1 - math.cos(self.c * (x - self.start)))
        return self.a + self.b * (x - self.start)

    def slope(self, x: float) -> float:
        """dz/dx."""
        if self.kind == "arc":
            return -(x - self.c) / math.sqrt(max(self.b**2 - (x - self.c) ** 2, 1e-12))
        if self.kind == "cosine":
            return self.b * self.c * math.sin(self.c * (x - self.start))
        return self.b

    def curvature(self, x: float) -> float:
        """d2z/dx2, 1/m."""
        if self.kind == "arc":
            return -(self.b**2) / math.sqrt(max(self.b**2 - (x - self.c) ** 2, 1e-12)) ** 3
        if self.kind == "cosine":
            return self.b * self.c**2 * math.cos(self.c * (x - self.start))
        return 0.0


@dataclass(frozen=True, kw_only=True)
class WheelRoad:
    """A road as one wheel meets it, as in runtime core/roads/road.hpp.
    A point follower has height and slope, a rigid disc only its envelope's height."""

    left: Sequence[Piece]
    right: Sequence[Piece]
    disc: bool
    on_it: Surface | None = None

    @classmethod
    def of(
        cls, left: Iterable[Mapping[str, Any]], right: Iterable[Mapping[str, Any]], disc: bool, on_it: Surface | None = None
    ) -> "WheelRoad":  # fmt: skip
        """The road of a run file, with a surface on it."""
        return cls(left=[Piece(**p) for p in left], right=[Piece(**p) for p in right], disc=disc, on_it=on_it)

    def _piece(self, x: float, y: float) -> Piece:
        track = self.left if y > 0 else self.right
        return track[max(bisect_right(track, x, key=lambda piece: piece.start) - 1, 0)]

    def height(self, x: float, y: float) -> float:
        """Height, m."""
        return self._piece(x, y).height(x)

    def slope(self, x: float, y: float) -> float:
        """dz/dx as the wheel meets it."""
        return 0.0 if self.disc else self._piece(x, y).slope(x)

    def height_dx(self, x: float, y: float) -> float:
        """The derivative of the height by x."""
        return self._piece(x, y).slope(x)

    def slope_dx(self, x: float, y: float) -> float:
        """The derivative of the slope by x, 1/m."""
        return 0.0 if self.disc else self._piece(x, y).curvature(x)

    def surface(self, x: float, y: float, by_x: int, by_y: int) -> float:
        """The height of the surface, m, or its derivative."""
        return 0.0 if self.on_it is None else self.on_it.height(x, y, by_x, by_y)

    def friction(self, x: float, y: float, by_x: int, by_y: int) -> float:
        """The friction factor, or its derivative."""
        return float(by_x + by_y == 0) if self.on_it is None else self.on_it.friction(x, y, by_x, by_y)


def profile_pieces(segments: Sequence[RoadSegment], start: float) -> list[Piece]:
    """The profile as a point follower sees it: flat before ``start`` and after the last segment."""
    x, z = start, 0.0
    pieces = [Piece(kind="line", start=start, a=0.0, b=0.0, c=0.0)]
    for segment in segments:
        match segment.kind:
            case SegmentKind.STEP:
                z += segment.rise
                continue
            case SegmentKind.COSINE:
                pieces.append(Piece(kind="cosine", start=x, a=z, b=segment.rise, c=2 * math.pi / segment.length))
            case SegmentKind.RAMP:
                pieces.append(Piece(kind="line", start=x, a=z, b=segment.rise / segment.length, c=0.0))
                z += segment.rise
            case SegmentKind.FLAT:
                pieces.append(Piece(kind="line", start=x, a=z, b=0.0, c=0.0))
        x += segment.length
    pieces.append(Piece(kind="line", start=x, a=z, b=0.0, c=0.0))
    first_flat = Piece(kind="line", start=start - 1.0, a=0.0, b=0.0, c=0.0)
    return [first_flat, *(p for p, after in pairwise([*pieces, pieces[-1]]) if p is pieces[-1] or after.start > p.start)]


def disc_pieces(segments: Sequence[RoadSegment], start: float, radius: float) -> list[Piece]:
    """The envelope of a disc of the given radius, minus the radius."""
    corners = _polygon(segments, start)
    pieces: list[Piece] = []
    arcs = [_Candidate(Piece(kind="arc", start=x - radius, a=z - radius, b=radius, c=x), x - radius, x + radius) for x, z in corners]
    for part in _envelope([*_offset_lines(corners, radius), *arcs]):
        if part.last - part.first >= 1e-12 and not (pieces and _continues(pieces[-1], part.piece)):
            a = part.piece.height(part.first) if part.piece.kind == "line" else part.piece.a
            pieces.append(replace(part.piece, start=part.first, a=a))
    return pieces


@dataclass(frozen=True)
class _Candidate:
    piece: Piece
    first: float
    last: float


def _polygon(segments: Sequence[RoadSegment], start: float) -> list[tuple[float, float]]:
    """Corners (x, z) of the profile; bumps are cut into short straight parts, steps at one place are one step."""
    x, z = start, 0.0
    corners = [(x, z)]
    for segment in segments:
        if segment.kind is SegmentKind.COSINE:
            corners.extend(
                (x + segment.length * i / BUMP_PARTS, z + segment.rise * (1 - math.cos(2 * math.pi * i / BUMP_PARTS)))
                for i in range(1, BUMP_PARTS + 1)
            )
        else:
            z += segment.rise if segment.kind is not SegmentKind.FLAT else 0.0
            corners.append((x + segment.length, z))
        x += segment.length
    return [c for i, c in enumerate(corners) if i in (0, len(corners) - 1) or not corners[i - 1][0] == c[0] == corners[i + 1][0]]


def _offset_lines(corners: Sequence[tuple[float, float]], radius: float) -> Iterable[_Candidate]:
    """The straight pieces of the centre's path, with the disc's contact between the ends of a line."""
    (x0, z0), (x1, z1) = corners[0], corners[-1]
    margin = 10 * radius + 1.0
    ends = [(x0 - margin, z0), *corners, (x1 + margin, z1)]
    for (xa, za), (xb, zb) in pairwise(ends):
        if xb <= xa:
            continue
        slope = (zb - za) / (xb - xa)
        lean = radius * slope / math.hypot(1, slope)  # distance of the contact ahead of the centre
        lift = radius * (math.hypot(1, slope) - 1)
        piece = Piece(kind="line", start=xa, a=za + lift, b=slope, c=0.0)
        yield _Candidate(piece, xa - lean, xb - lean)


def _envelope(candidates: Sequence[_Candidate]) -> list[_Candidate]:
    """The highest curve at every x, in pieces from left to right, by divide and conquer."""
    if len(candidates) < 2:
        return list(candidates)
    half = len(candidates) // 2
    return _higher(_envelope(candidates[:half]), _envelope(candidates[half:]))


def _higher(one: Sequence[_Candidate], other: Sequence[_Candidate]) -> list[_Candidate]:
    parts: list[_Candidate] = []
    breaks = sorted({x for c in (*one, *other) for x in (c.first, c.last) if math.isfinite(x)})
    ahead = [list(reversed(one)), list(reversed(other))]
    for left, right in pairwise(breaks):
        for waiting in ahead:
            while waiting and waiting[-1].last <= left:
                waiting.pop()
        here = [waiting[-1].piece for waiting in ahead if waiting and waiting[-1].first <= left]
        cuts = sorted(x for x in _meet(*here) if left < x < right) if len(here) == 2 else []
        for a, b in pairwise([left, *cuts, right]) if here else ():
            best = max(here, key=lambda piece, x=(a + b) / 2: piece.height(x))  # type: ignore[misc]
            if parts and parts[-1].piece is best and parts[-1].last == a:
                a = parts.pop().first
            parts.append(_Candidate(best, a, b))
    return parts


def _meet(one: Piece, other: Piece) -> list[float]:
    """The abscissas where two pieces' curves can cross."""
    if one.kind == other.kind == "line":
        if one.b == other.b:
            return []
        return [(other.a - other.b * other.start - one.a + one.b * one.start) / (one.b - other.b)]
    if one.kind == other.kind == "arc":
        dx, dz = other.c - one.c, other.a - one.a
        distance = math.hypot(dx, dz)
        if distance == 0 or distance > 2 * one.b:
            return []
        height = math.sqrt(one.b**2 - distance**2 / 4)
        return [(one.c + other.c) / 2 - sign * height * dz / distance for sign in (1, -1)]
    line, arc = (one, other) if one.kind == "line" else (other, one)
    # (m x + k)^2 + (x - c)^2 = R^2 with k the line's height over the arc's centre at x = 0
    m, k = line.b, line.a - line.b * line.start - arc.a
    a, b, c = 1 + m * m, 2 * (m * k - arc.c), k * k + arc.c**2 - arc.b**2
    root = b * b - 4 * a * c
    return [] if root < 0 else [(-b + sign * math.sqrt(root)) / (2 * a) for sign in (1, -1)]


def _continues(before: Piece, piece: Piece) -> bool:
    if before.kind != piece.kind:
        return False
    if before.kind == "arc":
        return (before.a, before.c) == (piece.a, piece.c)
    return before.b == piece.b and abs(before.height(piece.start) - piece.a) < 1e-12


def road_pieces(road: Road, radius: float) -> dict[str, list[Piece]]:
    """Both tracks of a road for a wheel of the given radius."""
    tracks = {"left": road.left, "right": road.right}
    if road.contact == "disc":
        return {side: disc_pieces(segments, road.start, radius) for side, segments in tracks.items()}
    return {side: profile_pieces(segments, road.start) for side, segments in tracks.items()}
