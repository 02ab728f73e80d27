"""Scenes from scenes: later, faster; and the check of a scene's flow."""
