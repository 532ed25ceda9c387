# make bench   set up, run the paper's suite, write results/paper and its report; SUITE=quick: another
# make test    set up with test extras, run lint, types and tests
# make help    the other targets

PYTHON ?= python3
SUITE ?= paper
VENV := .venv
BIN := $(VENV)/bin
# Python compiles what is imported; of all these libraries, that is the smaller part.
INSTALL := $(BIN)/pip install --quiet --disable-pip-version-check --no-compile --editable
# Each time, since an update of the sources brings other kernels; at once where they are compiled.
COMPILE := $(BIN)/python -m mobman.kernels.ahead

.PHONY: bench test test-slow speed lint format pictures clean help
.DEFAULT_GOAL := help

help:
	@grep -E '^# make' $(MAKEFILE_LIST) | sed 's/^# //'
	@echo "make test-slow   the longer studies among the tests"
	@echo "make speed       measure what a tick costs, beside Pinocchio, Pink and MuJoCo (ten minutes)"
	@echo "make lint        ruff and mypy alone"
	@echo "make format      let ruff format the code"
	@echo "make pictures    draw the pictures of README and docs from results/paper"
	@echo "make clean       remove $(VENV) and caches; results stay"

bench: $(VENV)/installed
	$(COMPILE)
	$(BIN)/mobman bench run $(SUITE) -o results/$(SUITE)

test: lint
	$(COMPILE)
	$(BIN)/python -m pytest -n auto --dist loadfile --no-loadscope-reorder

test-slow: $(VENV)/installed-test
	$(COMPILE)
	$(BIN)/python -m pytest -n auto --dist loadfile --no-loadscope-reorder -m slow

speed: $(VENV)/installed-speed
	$(COMPILE)
	$(BIN)/python benchmarks/speed.py -o results/speed

lint: $(VENV)/installed-test
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

format: $(VENV)/installed-test
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

pictures: bench $(VENV)/installed-film
	$(BIN)/python docs/pictures.py results/paper docs/images

$(VENV)/python: 
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
		{ echo "mobman needs Python 3.11 or newer; choose one with: make PYTHON=python3.11 ..."; exit 1; }
	$(PYTHON) -m venv $(VENV)
	touch $@

# The stamps depend on what is installed; a changed pyproject.toml installs anew.
$(VENV)/installed: $(VENV)/python pyproject.toml
	$(INSTALL) .
	touch $@

$(VENV)/installed-test: $(VENV)/python pyproject.toml
	$(INSTALL) '.[test,speed,view,film]'
	touch $@ $(VENV)/installed $(VENV)/installed-speed $(VENV)/installed-film

$(VENV)/installed-speed: $(VENV)/python pyproject.toml
	$(INSTALL) '.[speed]'
	touch $@ $(VENV)/installed

$(VENV)/installed-film: $(VENV)/python pyproject.toml
	$(INSTALL) '.[view,film]'
	touch $@

clean:
	rm -rf $(VENV) .pytest_cache .mypy_cache .ruff_cache build dist
