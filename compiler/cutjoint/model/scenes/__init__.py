"""Scenes: starts, roads, locked and driven joints."""
