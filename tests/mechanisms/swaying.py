"""Two windows of bars that sway about the upright, drawn upwards, and a stop in their way: loops, contacts, and no singular pose."""

from __future__ import annotations

from tests.conftest import MODELS


def swaying_text() -> str:
    """The four-bar with gravity upwards and a stop at -0.1 rad of its first crank."""
    text = (MODELS / "four_bar.yaml").read_text(encoding="utf-8").replace("gravity: [0, -9.81, 0]", "gravity: [0, 9.81, 0]")
    stop = "{stop: {side: below, at: -0.1, stiffness: 3000, damping: 5}}"
    text = text.replace("\nmarkers:", f"\nforces:\n  rest: {{kind: joint_force, joint: crank_0.pin, law: {stop}}}\n\nmarkers:")
    return text.replace("  end: 10\n", "  end: 1.2\n")
