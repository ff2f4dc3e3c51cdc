# Two commands do everything on a fresh Debian or Ubuntu machine with Python 3.11 or newer, git and make:
#   make reproduce   environment, then the whole pipeline           (SCALE=quick|default, CORES=2)
#   make test        environment, then the test suite               (TESTS="-m 'not slow'" for the fast part)
.DEFAULT_GOAL := help
.PHONY: help setup reproduce test test-fuzz test-kill test-slurm bench check lint types audit docs site format clean

PYTHON ?= $(shell command -v python3.11 || command -v python3)
BIN := .venv/bin
STAMP := .venv/.installed
CORES ?= 2
SCALE ?= default
TESTS ?=
INPUTS ?= 10000
SEED ?= 0
BENCH ?=
BENCH_OUT ?= results/benchmarks
BENCH_JOBS ?= 1
PIP_OPTIONS ?=
# snakemake runs the scripts; matplotlib and friends must not look for a screen or a writable HOME
export MPLBACKEND := Agg
export MPLCONFIGDIR := $(CURDIR)/.venv/.matplotlib
export XDG_CACHE_HOME := $(CURDIR)/.venv/.cache
# most of the modules that jobs import
IMPORTED := fontTools.subset, jax, matplotlib.backends.backend_pdf, numba, numpyro.infer, pandas, pydantic, scipy.signal, \
    scipy.stats, sklearn.mixture, snakemake.cli, stable_baselines3, torch._dynamo
# hundreds of short processes: each would compile the package anew
unexport PYTHONDONTWRITEBYTECODE

CONFIG_default :=
CONFIG_quick := --configfile config/quick.yaml

help:  ## show this text
	@grep -hE '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 13

# the command thesis-lib, which uses the code as it stands here; a .venv that is a link belongs to another checkout
setup: $(STAMP)  ## create .venv with environment.txt and the command thesis-lib
	@test -L .venv || $(BIN)/thesis-lib --help >/dev/null 2>&1 || $(BIN)/pip install --quiet \
	    --disable-pip-version-check --no-index --no-deps --no-build-isolation --editable .

$(STAMP): environment.txt
	@sh .ci/system-packages check "$(PYTHON)"
	@echo "Creating .venv with $$($(PYTHON) --version) and installing environment.txt (about 2 GB, some minutes)"
	$(PYTHON) -m venv .venv
	@# most of torch is never imported, so only what the pipeline imports is compiled
	$(BIN)/pip install --quiet --disable-pip-version-check --no-compile $(PIP_OPTIONS) --requirement environment.txt
	$(BIN)/python -c "import $(IMPORTED)"
	@touch $@

reproduce: setup  ## run the main job: every table, figure and claim; an interrupted run goes on where it was
	$(BIN)/python -m thesis_lib.thesis.pipeline --scale $(SCALE) --cores $(CORES)

test: setup  ## run the tests (TESTS='-m "not slow"' for the fast ones)
	$(BIN)/python -m pytest -n 2 --dist loadfile $(TESTS)

test-fuzz: setup  ## read 10,000 spoilt inputs (INPUTS, SEED): nothing but results and clear refusals may come out
	$(BIN)/python -m tests.fuzz.mutate --inputs $(INPUTS) --seed $(SEED) --jobs $(CORES)

test-kill: setup  ## stop a one-minute pipeline at 20 random moments, in seven ways, and compare the results
	$(BIN)/python -m tests.workflow.interruption --kills 20

test-slurm: setup  ## the quick pipeline on a real Slurm of two nodes, one of which dies (root; apt: slurm-wlm, munge)
	TEST_SLURM=1 $(BIN)/python -m pytest -s tests/slurm

BENCHMARKS := laws engines contacts_in_space engine_fits bandwidth identification ensemble arcs simulators programs critique hidden_effects \
    gaussian_processes belief pipeline growth next_experiment

bench: setup  ## measure speed and accuracy against other tools, into results/benchmarks (BENCH=--quick: does it run)
	$(BIN)/pip install --quiet --disable-pip-version-check $(PIP_OPTIONS) --requirement benchmarks/requirements.txt
	@printf '%s\n' $(BENCHMARKS) | xargs -n 1 -P $(BENCH_JOBS) sh -c 'echo "== $$0"; \
	    $(BIN)/python -m benchmarks.$$0 $(BENCH) --out $(BENCH_OUT)/$$0.csv || exit 255'
	$(BIN)/python -m benchmarks.table $(BENCH_OUT)

audit: setup  ## known vulnerabilities of what is installed (says so where it cannot look)
	$(BIN)/python tests/safety/audit.py

docs: setup  ## write the reference pages in docs/ from the code (with pictures: python -m thesis_lib.studies.docs --pictures)
	$(BIN)/python -m thesis_lib.studies.docs

site: setup  ## build the documentation with search and an API reference (site/index.html)
	$(BIN)/pip install --quiet --disable-pip-version-check $(PIP_OPTIONS) --requirement docs/site/requirements.txt
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --strict

check: lint types  ## lint, formatting and types, as CI does (make -j2 check: both at once)

lint: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/snakefmt --check Snakefile workflow
	$(BIN)/snakemake --lint

types: setup
	$(BIN)/basedpyright --level error

format: setup  ## format the code
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .
	$(BIN)/snakefmt Snakefile workflow

clean:  ## delete results and simulated data (not .venv, not measured data)
	rm -rf results site data/simulated .snakemake
