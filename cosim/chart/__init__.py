"""The studies: speed against accuracy, and where methods fail."""
