"""The emission stage: a program becomes C++ source.  Expressions come from the printer, structure from the templates."""
