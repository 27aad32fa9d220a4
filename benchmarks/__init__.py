"""Measurements of this project's own methods and models, beside the package."""

import os

# OpenBLAS's threads spin while they wait, which would count as CPU time. Before numpy is loaded.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
