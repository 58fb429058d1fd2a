"""Inputs that are fuzzed; simulators are compiled as for the tests, which the flags say before anything reads them."""

import tests.conftest  # noqa: F401
