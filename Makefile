# Requires Python >= 3.11, pip and make:  make fly   make test
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
WORKERS ?= 2

.DEFAULT_GOAL := help
.PHONY: help venv fly test test-long fuzz mutants lint clean

help:  ## list the targets
	@grep -hE '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/:[^#]*## /\t/' | expand -t 12

venv: $(STAMP)  ## create .venv with the project, editable, and its development tools

# Dependency groups need pip >= 25.1, which a system Python seldom brings; Debian's brings no pip for a venv at all.
$(STAMP): pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
		{ echo "wingslevel needs Python >= 3.11; name one with: make $(MAKECMDGOALS) PYTHON=python3.12" >&2; exit 1; }
	$(PYTHON) -m venv $(VENV) || $(PYTHON) -m venv --clear --without-pip $(VENV)
	$(BIN)/python -m pip --version >/dev/null 2>&1 || $(PYTHON) -m pip --python $(BIN)/python install --quiet pip
	$(BIN)/python -m pip install --quiet --upgrade 'pip>=25.1'
	$(BIN)/python -m pip install --quiet --editable . --group dev
	@touch $@

fly: venv  ## set up, and fly the hand launch
	@$(BIN)/wingslevel fly hand_launch

lint: venv  ## style, types, layers
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

test: lint  ## set up, lint, and run all tests
	$(BIN)/pytest -n $(WORKERS)

test-long: venv  ## the long tests: hundreds of command lines, kills and damaged files
	$(BIN)/pytest -n $(WORKERS) -m long

fuzz: venv  ## test with other random examples, for an hour
	HYPOTHESIS_PROFILE=explore $(BIN)/pytest -n $(WORKERS) -m hypothesis
	@end=$$(( $$(date +%s) + 3600 )); while [ $$(date +%s) -lt $$end ]; do \
		WINGSLEVEL_FUZZ_SEED=$$(date +%s) $(BIN)/pytest -n $(WORKERS) -m long tests/fuzz || exit 1; done

mutants: venv  ## mutation tests: 200 flipped signs and comparisons; takes hours, continues where it stopped
	nice $(BIN)/python tests/mutants --number 200 --seed 1 --jobs $(WORKERS)

clean:  ## remove build products and the virtual environment
	rm -rf $(VENV) flights dist build .mypy_cache .pytest_cache .ruff_cache .import_linter_cache .hypothesis
