# `make run` is enough on a bare machine: each stage installs only what is still missing, and only
# what it needs, at the versions and hashes of requirements/*.lock.
#
#   make run         sets up and runs the paper's scene (SCENE=name for another)
#   make test        sets up and runs the quick tests   (ARGS='-k name' for some of them)
#   make test-all    the slow ones too
#   make fuzz        the random tests with new examples, many more (ARGS=--hypothesis-seed=N to repeat)
#   make setup       sets up for all that follows: also the tools that check
#   make charts      remakes the figures and tables in results/, some minutes (TRIALS=DIR:
#                    those that need the trials, too); `make test` writes results/datasheet.*
#   make bench       remakes results/bench.json, some minutes (ARGS='--trials DIR')
#   make docs        draws the pictures and builds the documentation site, site/index.html
#   make check       ruff and pyright; tells which results another core has made
#   make wasm        compiles the FMU for the page of `cosim live`
#   make dist        what a release has, for five platforms, in dist/: wheels, sources, the FMU
#   make lock        remakes the locks with uv  (ARGS=--upgrade for newer versions)
#   make clean       removes the environments and everything built
#
# PYTHON=/path/to/python3 chooses the interpreter that .venv is made with.

SHELL := /bin/sh
.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
MAKEFLAGS += --no-print-directory

SCENE ?= paper
ARGS ?=
TRIALS ?=
UV ?= uv

VENV := .venv
PY := $(VENV)/bin/python
PIP := $(PY) -m pip --disable-pip-version-check --no-input -q
# A lock names all that is needed: pip need not look again, nor bring what the lock leaves out.
# Python compiles what it imports by itself, and keeps that: else each process would take a second more.
unexport PYTHONDONTWRITEBYTECODE
LOCKED := install --require-hashes --no-deps --no-compile -r

# An environment that was moved, or whose Python is gone, counts as not made.
VENV_READY := $(shell test -x $(PY) && test "$$(cat $(VENV)/.created 2>/dev/null)" = "$$(pwd)" && echo yes)

# What is compiled, and what compiles it.
SOURCES := $(sort $(shell find fmu/src fmu/include fmu/thin fmu/netlist fmu/models cosim -path cosim/_compiled -prune -o \
	-type f \( -name '*.[ch]' -o -name '*.def' \) -print)) build_c.py setup.py pyproject.toml fmu/LICENSE
COMPILED := cosim/_compiled/build.json

.PHONY: help run test test-all fuzz setup charts bench docs check wasm dist lock clean FORCE
.PRECIOUS: $(VENV)/.locked-%

help:
	@sed -n 's/^#  \( .*\)/\1/p' Makefile

run: $(COMPILED)
	@$(VENV)/bin/cosim run $(SCENE) $(ARGS)

# The tests fill all processors; threads of their linear algebra would wait for each other, spinning.
test: $(COMPILED) $(VENV)/.locked-test
	@OPENBLAS_NUM_THREADS=1 $(PY) -m pytest -n auto --dist worksteal -m "not slow" $(ARGS)

test-all: $(COMPILED) $(VENV)/.locked-test
	@$(PY) -m pytest $(ARGS)

fuzz: $(COMPILED) $(VENV)/.locked-test
	@$(PY) -m pytest -m hypothesis --hypothesis-profile=fuzz -o timeout=0 $(ARGS)

setup: $(COMPILED) $(VENV)/.locked-dev
	@:

# The machine: Python, libngspice, a C compiler; and an empty .venv.
$(VENV)/.created: .ci/setup-system.sh $(if $(VENV_READY),,FORCE)
	@PYTHON='$(PYTHON)' sh .ci/setup-system.sh

# The Python packages for run, test, dev (which has those of the first two) or dist. While the first
# are installed another processor compiles the C; if that fails, the next rule says why.
$(VENV)/.locked-%: requirements/%.lock $(VENV)/.created
	@echo "Installing the Python packages of $< into $(VENV)"
	@$(if $(filter run,$*),$(PY) build_c.py >/dev/null 2>&1 &) $(PIP) $(LOCKED) $< || \
		{ echo "cosim set-up: pip could not install the Python packages (see above); try again." >&2; exit 1; }; wait
	@touch $@

# This project, in place; that compiles its C.
$(COMPILED): $(VENV)/.locked-run $(VENV)/.sources $(SOURCES)
	@echo "Installing cosim and compiling its C"
	@$(PIP) install --no-build-isolation --no-deps \
		--config-settings editable_mode=compat -e . || \
		{ echo "cosim set-up: cosim could not be installed (see above)." >&2; exit 1; }
	@touch $@

# Sums of the sources, so that one that is gone, or changed but not newer, is noticed too.
$(VENV)/.sources: $(VENV)/.created FORCE
	@cksum $(SOURCES) | cmp -s - $@ || cksum $(SOURCES) >$@

# benchmarks/made.json keeps with which core each of them was made.
charts: setup
	@touch $(VENV)/.began
	@$(VENV)/bin/cosim run paper
	@cp results/paper/figure.png results/paper.png
	@$(VENV)/bin/cosim theory
	@cp results/theory/figure[34].png results
	@$(VENV)/bin/cosim sweep paper-limited --over drive.pot_frequency=0.1:0.95:18 \
		--over drive.pot_offset=0:0.7:15 --over drive.pot_max=0.4:1:4
	@cp results/paper-limited-sweep/figure.png results/sweep.png
	@$(VENV)/bin/cosim chart stability
	@$(PY) -m benchmarks.charts
	@$(PY) -m benchmarks.ports
	@$(VENV)/bin/cosim chart limits --rigs results/identify.json
	@$(VENV)/bin/cosim chart measure --rigs results/identify.json
	@$(VENV)/bin/cosim chart ladder paper trial-05 gripper
	@cp results/choice.csv cosim/simulation/choice.csv
	@test -z '$(TRIALS)' || { $(VENV)/bin/cosim chart trials '$(TRIALS)' && $(VENV)/bin/cosim chart paper '$(TRIALS)'; }
	@find results -maxdepth 1 -type f -newer $(VENV)/.began -exec $(PY) -m benchmarks.stale {} +

bench: setup
	@$(PY) -m benchmarks $(ARGS)
	@cp results/bench/bench.json results/bench.json
	@$(PY) -m benchmarks.stale results/bench.json

# In an environment of its own. The tables come from modules that load what is compiled.
DOCS := .venv-docs
DOCS_PY := PYTHONPATH=. $(DOCS)/bin/python

$(DOCS)/.installed: requirements/docs.lock $(VENV)/.created
	@echo "Installing what the site is built with into $(DOCS)"
	@$(or $(PYTHON),python3) -m venv --clear $(DOCS)
	@$(DOCS)/bin/python -m pip --disable-pip-version-check --no-input -q $(LOCKED) $<
	@touch $@

docs: $(COMPILED) $(DOCS)/.installed
	@for drawing in machine circuit coupling; do $(DOCS_PY) docs/drawings/$$drawing.py || exit; done
	@$(DOCS_PY) docs/programs/reference.py
	@NO_MKDOCS_2_WARNING=1 $(DOCS_PY) -m mkdocs build --strict

check: setup
	@$(VENV)/bin/ruff check
	@$(VENV)/bin/ruff format --check
	@$(VENV)/bin/pyright
	@$(PY) -m benchmarks.stale

# The result is kept in the repository, so that only who changes the FMU's C needs zig.
wasm: $(COMPILED) $(VENV)/.locked-dist
	@$(PY) build_wasm.py

dist: $(COMPILED) $(VENV)/.locked-dist
	@$(PY) build_dist.py

# The largest first: the others have its versions. cmake is for `fmpy compile` alone.
COMPILE = $(UV) pip compile --quiet --universal --fork-strategy fewest --generate-hashes \
	--python-version 3.11 --custom-compile-command "make lock" --no-emit-package cmake pyproject.toml

lock:
	@command -v $(UV) >/dev/null || { echo "make lock needs uv: install it (pip install uv) or name it with UV=/path/to/uv." >&2; exit 1; }
	@$(COMPILE) --group install --extra test --extra dev -o requirements/dev.lock $(ARGS)
	@$(COMPILE) --group install --extra test -c requirements/dev.lock -o requirements/test.lock $(ARGS)
	@$(COMPILE) --group install -c requirements/dev.lock -o requirements/run.lock $(ARGS)
	@$(COMPILE) --group install --extra dist -c requirements/dev.lock -o requirements/dist.lock $(ARGS)
	@$(COMPILE) --extra docs -o requirements/docs.lock $(ARGS)
	@! grep -n '://' requirements/*.lock || { echo "A lock must name no registry." >&2; exit 1; }

clean:
	@rm -rf $(VENV) $(DOCS) site build dist *.egg-info cosim/_compiled .pytest_cache .hypothesis .ruff_cache
	@find . -name __pycache__ -type d -prune -exec rm -rf {} +
