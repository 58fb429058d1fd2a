"""Models and their texts with passages deleted, doubled, renamed, exchanged or replaced."""

from __future__ import annotations

import copy
import random
from typing import Any

from .models import Node, make_document, write
from .odd import NASTY, ODD_NAMES, ODD_VALUES


def _places(node: Any) -> list[tuple[Any, Any]]:
    """Every container with every of its keys."""
    items = list(node.items()) if isinstance(node, dict) else list(enumerate(node)) if isinstance(node, list) else []
    return [place for key, value in items for place in ((node, key), *_places(value))]


def mutate_document(rng: random.Random, document: Node) -> Any:
    """The model with a few values or keys deleted, doubled, renamed, exchanged or replaced."""
    changed = copy.deepcopy(document)
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        places = _places(changed)
        if not places:
            break
        container, key = rng.choice(places)
        other, other_key = rng.choice(places)
        kind = rng.randrange(7)
        if kind == 0:
            del container[key]
        elif kind == 1 and isinstance(container, dict):
            container[rng.choice((*NASTY, *ODD_NAMES))] = copy.deepcopy(container[key])
        elif kind == 2 and isinstance(container, dict):
            container[rng.choice((*NASTY, *ODD_NAMES))] = container.pop(key)
        elif kind == 3:
            container[key] = copy.deepcopy(other[other_key])
        elif kind == 4:
            container[key] = rng.choice(NASTY)
        elif kind == 5 and isinstance(container, list):
            container.append(copy.deepcopy(container[key]))
        else:
            container[key] = copy.deepcopy(rng.choice(ODD_VALUES))
    return changed


def mutate_text(rng: random.Random, text: str) -> str:
    """The text of a model with a passage deleted, doubled or replaced."""
    i = rng.randrange(len(text))
    j = min(len(text), i + rng.randint(0, 20))
    return rng.choice(
        (
            text[:i] + text[j:],
            text[:j] + text[i:],
            text[:i] + rng.choice((*NASTY, ".nan", ".inf", "&a [*a]", "!!python/object:os")) + text[j:],
        )
    )


def any_model(rng: random.Random) -> str:
    """A model's text of any of these kinds."""
    document = make_document(rng)
    kind = rng.random()
    if kind < 0.35:
        return write(document)
    if kind < 0.85:
        return write(mutate_document(rng, document))
    return mutate_text(rng, write(document))
