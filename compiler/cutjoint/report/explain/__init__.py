"""``cutjoint explain``: what the compiler derived from a model, as Markdown with LaTeX."""
