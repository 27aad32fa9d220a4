"""Threads that lead the mechanics of many runs at once."""
