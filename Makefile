# Needs python3 (3.11 or later) and make; everything else is set up in .venv on the first call.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check --quiet
# Bytecode is made of what is used, when it is first used: of everything it takes longer than to install it.
INSTALL := $(PIP) install --no-compile --require-hashes --only-binary :all: -r
LOCK := uv pip compile --quiet --universal --generate-hashes --no-annotate --no-header --python-version 3.11
EXPERIMENT ?= configs/quickstart.yaml
OPTIONS ?=
PYTEST_OPTIONS ?= -m "not long"

.DEFAULT_GOAL := help
.PHONY: help run test check format lint types bench docs lock clean

help:
	@echo "make run     run $(EXPERIMENT) and write its report"
	@echo "make test    run the tests"
	@echo "make check   format, lint, types and tests"
	@echo "make bench   run the benchmarks"
	@echo "make docs    build the documentation in site/, every link checked"
	@echo "make lock    renew the lock files"
	@echo "make clean   remove caches and .venv (results stay)"

# The package itself is installed without its dependencies: those come, with hashes, from the lock file, which also
# holds the build backend.
$(VENV)/run.stamp: requirements.lock pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { echo "nlbench needs Python 3.11 or later" >&2; exit 1; }
	@echo "setting up $(VENV) ..."
	@test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	@$(INSTALL) requirements.lock
	@$(PIP) install --no-deps --no-build-isolation --editable .
	@touch $@

$(VENV)/dev.stamp: requirements-dev.lock $(VENV)/run.stamp
	@echo "adding the tools for tests ..."
	@$(INSTALL) requirements-dev.lock
	@touch $@

run: $(VENV)/run.stamp
	@$(BIN)/nlbench run $(EXPERIMENT) $(OPTIONS)

test: $(VENV)/dev.stamp
	@$(BIN)/python -m pytest --numprocesses auto --dist worksteal $(PYTEST_OPTIONS)

check: format lint types test

format: $(VENV)/dev.stamp
	@$(BIN)/ruff format --check .

lint: $(VENV)/dev.stamp
	@$(BIN)/ruff check .

types: $(VENV)/dev.stamp
	@$(BIN)/mypy

bench: $(VENV)/dev.stamp
	@$(BIN)/python -m benchmarks

$(VENV)/docs.stamp: requirements-docs.lock $(VENV)/run.stamp
	@echo "adding the tools for the documentation ..."
	@$(INSTALL) requirements-docs.lock
	@touch $@

docs: $(VENV)/docs.stamp
	@$(BIN)/python -m docs.generator
	@NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --quiet --strict --config-file build/docs/mkdocs.yml
	@echo "site/index.html"

# Needs uv. hatchling and editables install the package itself. The second file holds all of the first, in the same versions.
lock:
	printf 'hatchling\neditables\n' | $(LOCK) pyproject.toml - -o requirements.lock
	printf 'hatchling\neditables\n' | $(LOCK) pyproject.toml - --extra test --extra dev -c requirements.lock -o requirements-dev.lock
	$(LOCK) pyproject.toml --extra docs -c requirements.lock -o requirements-docs.lock

clean:
	rm -rf $(VENV) .hypothesis .mypy_cache .pytest_cache .ruff_cache build dist site
	find nlbench tests benchmarks -name __pycache__ -type d -prune -exec rm -rf {} +
