# Set up, run and test mobman; `make` lists the targets.

PYTHON ?= python3
SUITE ?= paper
# What make table renews: words of the commands of tables, see docs/claims.py
TABLE ?= suite_table.py table
# Of the script that the target runs: make speed OPTIONS=--quick, make browser OPTIONS=--dry-run
OPTIONS ?=
RESULTS := results
IMAGES := docs/images
VENV := .venv
BIN := $(VENV)/bin
# Python compiles what is imported; of all these libraries, that is the smaller part.
INSTALL := $(BIN)/pip install --quiet --disable-pip-version-check --no-compile --editable
PYTEST := $(BIN)/python -m pytest -n auto --dist loadfile --no-loadscope-reorder
# The results of the suite, which may be a name or a file.
OUT = $(RESULTS)/$(basename $(notdir $(SUITE)))

# Tests start hundreds of processes that import the same files: Python keeps what it compiles of them.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: bench test test-slow nightly lowest speed lint kernels format claims table pictures gallery docs browser clean help
.DEFAULT_GOAL := help

help: ## list the targets
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "make %-10s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

bench: $(VENV)/installed ## set up, run the paper's suite, write results/paper and its report; SUITE=quick: another
	$(BIN)/mobman bench run $(SUITE) -o $(OUT)

# The tests read and print UTF-8, whatever the locale
test test-slow: export PYTHONUTF8 := 1

# One core compiles what the tests need while another checks style and types.
test: $(VENV)/installed-test ## set up with test extras, run lint, types and tests
	@$(MAKE) --no-print-directory --jobs=2 lint kernels
	$(PYTEST)

test-slow: $(VENV)/installed-test ## the longer studies among the tests
	$(PYTEST) -m slow

nightly: test test-slow claims ## every test, the longer studies, 500 made robots among them, and make claims

lowest: $(VENV)/python ## try the lowest versions that pyproject.toml allows, in build/lowest (ten minutes)
	$(BIN)/python .ci/lowest.py $(OPTIONS)

speed: $(VENV)/installed-speed ## measure what a tick costs, and Pinocchio, Pink and MuJoCo with it (ten minutes)
	$(BIN)/python benchmarks/speed.py $(OPTIONS) -o $(RESULTS)/speed

lint: $(VENV)/installed-test ## ruff, import-linter and mypy alone
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/lint-imports --no-logo --no-cache
	$(BIN)/mypy

kernels: $(VENV)/installed-test ## compile what most tests need (half a minute, once)
	cd tests && ../$(BIN)/python -m support.kernels

format: $(VENV)/installed-test ## let ruff format the code
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

claims: $(VENV)/installed-test ## renew the numbers of README and docs that runs produced, some hours; fails if one drifted
	$(BIN)/python docs/claims.py $(OPTIONS)

table: $(VENV)/installed-test ## of these, every law in what robots meet: the suites table and table-tuned (an hour)
	$(BIN)/python docs/claims.py "$(TABLE)"

pictures: bench $(VENV)/installed-film ## draw the pictures of README and docs; this needs a browser
	$(BIN)/python docs/pictures.py $(OPTIONS) $(OUT) $(IMAGES)

gallery: $(VENV)/installed-test ## run the scripts of docs/examples in full, draw their pictures, write docs/gallery.md (some minutes)
	$(BIN)/python docs/gallery.py $(OPTIONS)

docs: $(VENV)/installed-docs ## build the documentation site into build/site; a warning or a broken link is an error
	$(BIN)/python docs/site/build.py build/site

browser: $(VENV)/installed-film ## install a browser if there is none: for pictures, films and the viewer's tests
	$(BIN)/python .ci/browser.py $(OPTIONS)

clean: ## remove .venv and caches; results stay
	rm -rf $(VENV) .pytest_cache .mypy_cache .ruff_cache build dist

$(VENV)/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
		{ echo "mobman needs Python 3.11 or newer; choose one with: make PYTHON=python3.11 ..."; exit 1; }
	$(PYTHON) -m venv $(VENV)
	touch $@

# The stamps depend on what is installed; a changed pyproject.toml installs again.
$(VENV)/installed: $(VENV)/python pyproject.toml
	$(INSTALL) .
	touch $@

$(VENV)/installed-test: $(VENV)/python pyproject.toml
	$(INSTALL) '.[test,speed,view,film,docs]'
	touch $@ $(VENV)/installed $(VENV)/installed-speed $(VENV)/installed-film $(VENV)/installed-docs

$(VENV)/installed-speed: $(VENV)/python pyproject.toml
	$(INSTALL) '.[speed]'
	touch $@ $(VENV)/installed

$(VENV)/installed-film: $(VENV)/python pyproject.toml
	$(INSTALL) '.[view,film]'
	touch $@

$(VENV)/installed-docs: $(VENV)/python pyproject.toml
	$(INSTALL) '.[docs]'
	touch $@ $(VENV)/installed
