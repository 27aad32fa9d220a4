"""Commands that simulate scenes, and what goes with that."""
