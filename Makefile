# Two commands matter: `make figures` rebuilds all figures and tables, `make test` proves them.
# Needs make and Python >= 3.11; everything else goes into .venv, pinned by environment.txt.

.DEFAULT_GOAL := help
.PHONY: help env figures quick test check soak golden unchanged lab bench html lock clean calibrate data

PYTHON_CANDIDATES = $(or $(PYTHON),python3.11 python3.12 python3.13 python3.14 python3)
RUN = .venv/bin/python -m
JOBS =
ONLY =
REF =
RUNS =
SMALL =

# `make -B` asks for everything anew; the runner knows this as --force.
FORCE = $(if $(findstring B,$(firstword -$(MAKEFLAGS))),--force)
RUNNER_OPTIONS = $(FORCE) $(if $(JOBS),--jobs $(JOBS)) $(foreach slug,$(ONLY),--only $(slug))

help: ## list the commands
	@echo "make <command>  [JOBS=n: notebooks at once]  [ONLY=slug: this notebook]  [PYTHON=interpreter]  [SMALL=1: data and calibrations in small form]"
	@sed -n 's/^\([a-z]*\):.*## \(.*\)/  \1	\2/p' Makefile

env: ## set up .venv from environment.txt (the other commands do it themselves)
	@for python in $(PYTHON_CANDIDATES); do \
	    if $$python -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then \
	        exec $$python .ci/environment.py; \
	    fi; \
	done; \
	echo "error: Python 3.11 or newer is needed; tried: $(PYTHON_CANDIDATES). Install it, or name it: make PYTHON=..." >&2; \
	exit 1

figures: env ## run the notebooks whose inputs have changed (-B: all) and write figures/
	@$(RUN) soro_lib.workbook run $(RUNNER_OPTIONS)

quick: env ## run the notebooks with small parameters; writes to build/quick
	@$(RUN) soro_lib.workbook run --quick $(RUNNER_OPTIONS)

test: env ## run all tests, and every notebook with small parameters
	@$(RUN) pytest -n logical --dist worksteal -m "not soak"

soak: env ## run what is too long for make test: other kernels, threads and Pythons, kills, many examples
	@$(RUN) pytest -n logical --dist worksteal -m "soak or hypothesis" --hypothesis-profile soak

golden: env ## keep what a commit writes, tests and offers (REF: that commit)
	@$(RUN) soro_lib.workbook golden $(REF) $(if $(RUNS),--benchmarks $(RUNS))

unchanged: figures ## say what this checkout does otherwise than its golden copy
	@$(RUN) soro_lib.workbook unchanged

check: env ## lint, types, and whether what is committed is what the notebooks produce
	@status=0; \
	for step in "ruff check ." "ruff format --check ." mypy soro_lib.workbook.check; do \
	    $(RUN) $$step || status=1; \
	done; \
	exit $$status

lab: env ## open JupyterLab on the overview notebook
	@$(RUN) jupyterlab notebooks/00_overview.ipynb

bench: env ## measure speed against other libraries (installs them beside), or against a commit (REF)
	@$(RUN) benchmarks.run $(if $(REF),--against $(REF),--install-peers) $(if $(RUNS),--runs $(RUNS)) \
	    $(foreach module,$(ONLY),--only $(module))

html: figures ## export the executed notebooks with an index page to build/html
	@$(RUN) soro_lib.workbook html

lock: env ## renew environment.txt from pyproject.toml
	@$(RUN) pip install --quiet --disable-pip-version-check "uv>=0.9"
	@$(RUN) uv pip compile pyproject.toml --extra dev --universal --fork-strategy fewest --python-version 3.11 \
	    --generate-hashes --no-emit-index-url --no-header --quiet -o environment.txt

calibrate: env ## fit the declared calibrations again
	@$(RUN) soro_lib.workbook generate calibrations $(if $(SMALL),--small --output build/small)

data: env ## simulate the recordings in data/ again
	@$(RUN) soro_lib.workbook generate data $(if $(SMALL),--small --output build/small)

clean: ## remove .venv and everything under build/
	rm -rf .venv build *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis
