"""Draws docs/pictures/signs.svg: what a positive law or reaction does.  Run it as `.venv/bin/python -m docs.pictures.signs`."""

from __future__ import annotations

from pathlib import Path

FILE = Path(__file__).with_name("signs.svg")
BODY, FORCE, INK = "#d9d4c8", "#c1440e", "#222222"
WIDTH, HEIGHT = 900, 190


def main() -> None:
    """Write the picture."""
    FILE.write_text(picture(), encoding="utf-8")


def picture() -> str:
    """The three panels as SVG."""
    spring = " ".join(f"{80 + 8.8 * i:.1f},{90 + (0, 9, -9)[0 if i in (0, 15) else 1 + i % 2]}" for i in range(16))
    panels = (
        (
            "point_spring: a tension", "law > 0 pulls the points together",
            f'{block(20, "base")}{block(212, "follower")}<polyline points="{spring}" fill="none" stroke="{INK}"/>'
            f"{arrow(50, 128)}{arrow(242, 164)}",
        ),
        (
            "joint_force, axial_force: a push", "law > 0: the coordinate grows",
            f'{block(20, "base")}{block(180, "follower")}<line x1="80" y1="90" x2="180" y2="90" stroke="{INK}" stroke-dasharray="4 3"/>'
            f'<text x="105" y="84">+axis &#8594;</text>{arrow(50, -2)}{arrow(212, 272)}',
        ),
        (
            "reaction: of the joint on the follower", "F > 0 acts along +direction",
            f'{block(20, "base")}{block(150, "follower")}<circle cx="116" cy="90" r="6" fill="white" stroke="{INK}"/>'
            f'<line x1="80" y1="90" x2="110" y2="90" stroke="{INK}"/><line x1="122" y1="90" x2="150" y2="90" stroke="{INK}"/>'
            f"{arrow(50, -2)}{arrow(180, 250)}",
        ),
    )
    parts = "".join(
        f'<g transform="translate({20 + 295 * i} 0)"><text x="10" y="24" font-weight="bold">{title}</text>{drawn}'
        f'<text x="10" y="170" font-size="12">{words.replace(" > ", " &gt; ")}</text></g>\n'
        for i, (title, words, drawn) in enumerate(panels)
    )
    head = (
        '<defs><marker id="head" markerWidth="8" markerHeight="8" refX="6" refY="3" orient="auto"><path d="M0 0 L6 3 L0 6 z" '
        f'fill="{FORCE}"/></marker></defs>'
    )
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" font-family="sans-serif" font-size="13" fill="{INK}">\n'
        f'<rect width="{WIDTH}" height="{HEIGHT}" fill="white"/>{head}\n{parts}</svg>\n'
    )


def block(x: int, name: str) -> str:
    """A body of 60 by 40 with its name."""
    return (
        f'<rect x="{x}" y="70" width="60" height="40" rx="4" fill="{BODY}" stroke="{INK}"/><text x="{x + 30}" y="62" '
        f'text-anchor="middle">{name}</text>'
    )


def arrow(begin: int, end: int) -> str:
    """A force from one place to another."""
    return f'<line x1="{begin}" y1="128" x2="{end}" y2="128" stroke="{FORCE}" stroke-width="3" marker-end="url(#head)"/>'


if __name__ == "__main__":
    main()
