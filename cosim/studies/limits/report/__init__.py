"""What the study of the limits has found: a ranking, a page, a table and figures."""
