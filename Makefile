# Two commands do everything on a fresh Debian or Ubuntu machine with Python 3.11 or newer, git and make:
#   make reproduce   environment, then the whole pipeline           (SCALE=quick|default|full, CORES=2)
#   make test        environment, then the test suite               (TESTS="-m 'not slow'" for the fast part)
.DEFAULT_GOAL := help
.PHONY: help setup reproduce report test bench check format clean

PYTHON ?= $(shell command -v python3.11 || command -v python3)
BIN := .venv/bin
STAMP := .venv/.installed
CORES ?= 2
SCALE ?= default
TESTS ?=
PIP_OPTIONS ?=
# snakemake runs the scripts; matplotlib and friends must not look for a screen or a writable HOME
export MPLBACKEND := Agg
export MPLCONFIGDIR := $(CURDIR)/.venv/.matplotlib
export XDG_CACHE_HOME := $(CURDIR)/.venv/.cache

CONFIG_default :=
CONFIG_quick := --configfile config/quick.yaml
CONFIG_full := --configfile config/full.yaml

help:  ## show this text
	@grep -hE '^[a-z]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 12

setup: $(STAMP)  ## create .venv and install environment.txt

$(STAMP): environment.txt
	@sh .ci/system-packages check "$(PYTHON)"
	@echo "Creating .venv with $$($(PYTHON) --version) and installing environment.txt (about 2 GB, some minutes)"
	$(PYTHON) -m venv .venv
	$(BIN)/pip install --quiet --disable-pip-version-check $(PIP_OPTIONS) --requirement environment.txt
	@touch $@

reproduce: setup  ## run the main job: every table, figure and claim
	$(BIN)/snakemake --cores $(CORES) $(CONFIG_$(SCALE))

report: reproduce  ## as reproduce, then one page with all of it: results/report.html
	$(BIN)/snakemake --cores $(CORES) $(CONFIG_$(SCALE)) --report results/report.html

test: setup  ## run the tests (TESTS='-m "not slow"' for the fast ones)
	$(BIN)/python -m pytest -n 2 $(TESTS)

bench: setup  ## measure speed: laws, identification, simulators, programs, critique, learning, beliefs, pipeline
	$(BIN)/python -m benchmarks.laws
	$(BIN)/python -m benchmarks.identification
	$(BIN)/python -m benchmarks.simulators
	$(BIN)/python -m benchmarks.programs --mechanisms block ellipse wheel arm_disk --windows 5 --starts 2
	$(BIN)/python -m benchmarks.critique
	$(BIN)/python -m benchmarks.gaussian_processes
	$(BIN)/python -m benchmarks.belief
	$(BIN)/python -m benchmarks.pipeline

check: setup  ## lint and formatting, as CI does
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/snakefmt --check Snakefile workflow
	$(BIN)/snakemake --lint

format: setup  ## format the code
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .
	$(BIN)/snakefmt Snakefile workflow

clean:  ## delete results and simulated data (not .venv, not measured data)
	rm -rf results data/simulated .snakemake
