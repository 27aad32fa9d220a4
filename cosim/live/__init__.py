"""The live bench: a page on which the machine runs and is turned by hand."""
