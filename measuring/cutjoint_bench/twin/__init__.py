"""The generic twin: the runtime's other mechanism, which interprets a description of the model in place of code made for it."""
