# Set-up included, each of these is one command:
#   make run        the main job on the embedded sweep, into ridgebayes-out/
#   make fast       lint, types, and the tests that need no sub-process, CalculiX or long chain
#   make test       lint, types, the tests, doctests, the notebook and the README's code blocks
#   make test-long  all tests, those marked `long` too, on every Python of PYTHONS with the extra
#                   `samplers` (PyMC, NumPyro, Stan), and fuzzing
#   make docs       the site, into docs/_build/html
#   make notebooks  runs all notebooks and stores their outputs
#   make gallery    runs the scripts of docs/gallery and stores their figures
#   make dist       wheel and sdist, checked, and the main job from the wheel alone on every Python,
#                   and among the lowest versions of its dependencies
#   make coverage   the tests of `make test`, with the share of branches that they reach
#   make studies    long studies of the numbers in docs/validation, and their tests: hours
#   make hard-cases, make mutation, make architecture: the pages of docs/ that are made by running code
# Another Python: make test PYTHON=python3.12 VENV=.venv-3.12

PYTHON  ?= python3
PYTHONS ?= python3.11 python3.12 python3.13
VENV    ?= .venv
OUT     ?= ridgebayes-out
BIN      = $(VENV)/bin
# The studies that `make studies` runs: make studies STUDIES=verdicts
STUDIES ?= brackets coverage cylinder friction kills load_coverage new_series plan sbc verdicts
PYTEST   = $(BIN)/python -m pytest -n auto --dist worksteal
# One BLAS thread: the matrices are small, and threads only fight over the cores.
export OMP_NUM_THREADS ?= 1
export OPENBLAS_NUM_THREADS ?= 1
# Tests start many processes: none of them has to compile the package anew.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: setup run lint types fast fast-tests pytest test test-long coverage docs notebooks gallery dist studies hard-cases mutation architecture clean

setup: $(VENV)/.installed

$(VENV)/.installed: pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check uv
	$(BIN)/uv pip install --quiet --compile-bytecode --python $(BIN)/python --editable '.[dev]'
	touch $@

run: setup
	$(BIN)/ridgebayes run --force -o $(OUT)

lint: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/lint-imports
	$(BIN)/python docs/check_docstrings.py
	$(BIN)/python docs/architecture/code_lines.py --check

types: setup
	$(BIN)/mypy

# Types are checked beside the first tests, so that no core waits for them.
fast: setup
	$(MAKE) --no-print-directory --jobs=2 lint types fast-tests

fast-tests: setup
	$(PYTEST) -q -m "not slow and not process and not ccx and not long"

# With --jobs=2 types are checked beside docs and the first tests, so that no core waits for them.
test: lint types pytest

pytest: docs
	$(PYTEST) -m "not long"

coverage: setup
	$(PYTEST) -q -m "not long" --cov --cov-report=term:skip-covered

# One environment for each Python; one that is not there is an error, not a silent skip.
test-long: setup
	set -e; for python in $(PYTHONS); do \
	    $(MAKE) --no-print-directory test-python PYTHON=$$python VENV=.venv-$$(basename $$python); \
	done
	$(BIN)/python -m tests.fea.fuzzing --n 200 --seed 1
	$(MAKE) --no-print-directory dist

.PHONY: test-python
test-python: setup
	$(BIN)/uv pip install --quiet --python $(BIN)/python --editable '.[dev,samplers]'
	$(PYTEST) -q tests src studies

# From stored outputs; warnings are errors, and every reference has to resolve.
docs: setup
	$(BIN)/python -m sphinx -W --keep-going -n -q docs docs/_build/html

notebooks: setup
	cd notebooks && MPLBACKEND=module://matplotlib_inline.backend_inline \
	    $(abspath $(BIN))/jupyter-execute --inplace *.ipynb
	rm -f notebooks/report.html

gallery: setup
	$(BIN)/python -m sphinx -b dummy -D plot_gallery=True docs docs/_build/gallery
	rm docs/examples/*.md5

dist: setup
	rm -rf dist
	$(BIN)/uv build --quiet
	$(BIN)/uvx twine check --strict dist/*
	set -e; for python in $(PYTHONS); do $(BIN)/python -m tests.wheel $$python dist; done
	$(BIN)/python -m tests.wheel $(firstword $(PYTHONS)) dist --lowest

studies: setup
	$(PYTEST) -q studies
	set -e; for study in $(STUDIES); do $(BIN)/python -m studies.$$study; done

hard-cases: setup
	$(BIN)/python -m tests.hard_cases.page

mutation: setup
	$(BIN)/uv pip install --quiet --compile-bytecode --python $(BIN)/python --editable '.[dev,mutation]'
	$(BIN)/python -m studies.mutation.run
	$(BIN)/python -m studies.mutation.page

architecture: setup
	$(BIN)/python docs/architecture/figure.py
	$(BIN)/python docs/architecture/walk.py
	$(BIN)/python docs/architecture/code_lines.py

clean:
	rm -rf $(VENV) .venv-* dist docs/_build docs/_generated docs/notebooks docs/examples/*.* docs/names .pytest_cache .mypy_cache .ruff_cache .import_linter_cache
