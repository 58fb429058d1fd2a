"""The model stage: a YAML text becomes a validated, flat :class:`Model`; nothing is derived."""
