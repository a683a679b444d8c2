# Everything a developer types. Needs Python 3.11 or newer with venv and pip, git and make; the rest goes into .venv.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
SOURCES := photostrip tests $(wildcard benchmarks)
DEMO_PROJECTS ?= $(wildcard sample_data/*/project.yaml)
WORKERS ?= 2
# What is imported is compiled then: a third of all modules that are installed.
INSTALL := $(BIN)/python -m pip install --quiet --disable-pip-version-check --no-compile
unexport PYTHONDONTWRITEBYTECODE # or each of the hundreds of processes that the tests start compiles the program anew

KATEX := .venv-site/node_modules/katex/dist

.PHONY: demo test check lint types lowest bench docs site golden regress clean
.DELETE_ON_ERROR:

demo: $(VENV)/photostrip.installed ## run the main job on every sample project and print its accuracy report
	@test -n "$(DEMO_PROJECTS)" || { echo "no project.yaml in sample_data/" >&2; exit 2; }
	@for project in $(DEMO_PROJECTS); do \
	    name=$$(basename "$$(dirname "$$project")"); \
	    printf '\n==> photostrip run %s -o build/demo/%s\n' "$$project" "$$name"; \
	    $(BIN)/photostrip run "$$project" -o "build/demo/$$name" || exit $$?; \
	done

test: lint types ## lint, format, types and all tests
	$(BIN)/python -m pytest -n $(WORKERS) --dist worksteal

check: lint types ## the fast gates: no slow tests, few random examples
	HYPOTHESIS_PROFILE=quick $(BIN)/python -m pytest -n $(WORKERS) --dist worksteal -q -m "not slow"

lint: $(VENV)/dev.installed
	$(BIN)/ruff check $(SOURCES)
	$(BIN)/ruff format --check $(SOURCES)

types: $(VENV)/dev.installed
	$(BIN)/zmypy --python-executable $(BIN)/python $(SOURCES) # or it takes the packages of .venv-site

lowest: ## all tests on exactly the lower bounds of pyproject.toml, in a venv of their own
	rm -rf .venv-lowest
	$(PYTHON) -m venv .venv-lowest
	$(PYTHON) -c "import tomllib; print(*(d.replace('>=', '==') for d in tomllib.load(open('pyproject.toml', 'rb'))['project']['dependencies']), sep='\n')" > .venv-lowest/constraints.txt
	.venv-lowest/bin/python -m pip install --quiet --only-binary :all: --constraint .venv-lowest/constraints.txt ".[test]"
	.venv-lowest/bin/python -m pytest -n $(WORKERS) --dist worksteal

bench: $(VENV)/dev.installed ## tables of seconds, memory and accuracy (by hand: mutations.py takes hours)
	@for program in $(filter-out benchmarks/mutations.py,$(wildcard benchmarks/*.py)); do printf '\n==> %s\n' "$$program"; $(BIN)/python "$$program" || exit $$?; done

docs: $(VENV)/dev.installed ## rewrite the printed output in README.md and docs/ by running the commands there
	$(BIN)/python -m tests.renew_docs

site: $(VENV)/photostrip.installed ## the documentation as a site with search, in build/site (formulas need npm)
	test -d .venv-site || { $(PYTHON) -m venv .venv-site && .venv-site/bin/python -m pip install --quiet zensical==0.0.73; }
	test -d $(KATEX) || npm install --prefix .venv-site --no-save --no-audit --no-fund --ignore-scripts --silent katex@0.19.1
	rm -rf build/docs
	mkdir -p build
	cp -r docs build/docs
	$(BIN)/python -m tests.reference build/docs
	mkdir build/docs/katex
	cp -r $(KATEX)/katex.min.css $(KATEX)/katex.min.js $(KATEX)/fonts build/docs/katex
	.venv-site/bin/zensical build --clean --strict

regress: $(VENV)/photostrip.installed ## adjust the sample projects that changed and compare them with their baselines
	$(MAKE) --no-print-directory -f configs/Makefile.example STRIPS=sample_data OUT=build/regress PHOTOSTRIP=$(BIN)/photostrip check

golden: $(VENV)/dev.installed ## compute the baselines of sample_data, which regress and the tests compare with, anew
	$(BIN)/python -m tests.renew_golden

clean: ## remove everything that make has made
	rm -rf $(VENV) .venv-lowest .venv-site build dist .hypothesis .pytest_cache .ruff_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

# One install per change of pyproject.toml; the package itself is installed editable and follows every change.
$(VENV)/bin/python:
	@$(PYTHON) -c "import sys; sys.exit(sys.version_info < (3, 11))" || { echo "photostrip needs Python 3.11 or newer: make PYTHON=python3.12 ..." >&2; exit 2; }
	$(PYTHON) -m venv $(VENV)

$(VENV)/photostrip.installed: pyproject.toml | $(VENV)/bin/python
	$(INSTALL) --editable .
	@touch $@

$(VENV)/dev.installed: pyproject.toml | $(VENV)/bin/python
	$(INSTALL) --editable ".[dev]"
	@touch $@ $(VENV)/photostrip.installed
